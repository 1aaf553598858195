#include "tendril/dynamics/state_access.hpp"

#include "tendril/energy/edge.hpp"
#include "tendril/layout/same_vertices.hpp"
#include "tendril/state/commit.hpp"

#include <algorithm>
#include <sstream>

namespace tendril {
namespace {

int rodNamed(const Scene &scene, const std::string &name) {
  if (scene.rods.empty()) return 0; // refused later
  for (std::size_t r = 0; r < scene.rods.size(); ++r)
    if (scene.rods[r].name == name) return int(r);
  std::string names;
  for (std::size_t r = 0; r < std::min<std::size_t>(scene.rods.size(), 8); ++r)
    names += (r > 0 ? ", '" : "'") + scene.rods[r].name + "'";
  throw SceneError("no rod is called '" + name + "'; there are " + names + (scene.rods.size() > 8 ? " ..." : ""));
}

const Elements &elementsOf(const Simulation &simulation) {
  if (!simulation.elements) throw SceneError("the simulation has no rods yet: set it up first");
  return *simulation.elements;
}

int rodInRange(const Scene &scene, int rod) {
  if (rod >= 0 && rod < int(scene.rods.size())) return rod;
  throw SceneError("rod " + std::to_string(rod) + " does not exist; rods are 0 to " +
                   std::to_string(scene.rods.size() - 1));
}

template <class T> std::vector<T> slice(const std::vector<T> &values, int first, int count) {
  return {values.begin() + first, values.begin() + first + count};
}

bool isFinite(double x) { return std::isfinite(x); }
bool isFinite(const Vec3 &x) { return x.allFinite(); }

/// Index of the first value that is not finite, or -1.
template <class T> int firstNotFinite(const std::vector<T> &values) {
  const auto found = std::find_if(values.begin(), values.end(), [](const T &x) { return !isFinite(x); });
  return found == values.end() ? -1 : int(found - values.begin());
}

template <class... Parts> std::string text(Parts &&...parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}

} // namespace

RodAccess::RodAccess(Simulation &simulation, int rod)
    : scene_(simulation.scene), elements_(elementsOf(simulation)), state_(simulation.state),
      dynamic_(simulation.dynamic), index_(rodInRange(scene_, rod)), range_(elements_.rods[index_]),
      cells_(cellsOf(elements_, index_)) {
  for (const Support &support : scene_.supports)
    if (support.rod == index_) supports_.push_back(&support);
}

RodAccess::RodAccess(Simulation &simulation, const std::string &name)
    : RodAccess(simulation, rodNamed(simulation.scene, name)) {}

std::vector<Vec3> RodAccess::positions() const { return slice(state_.position, range_.first_vertex, range_.vertices); }
std::vector<Vec3> RodAccess::directors() const { return slice(state_.director, range_.first_edge, range_.edges); }
std::vector<Vec3> RodAccess::velocities() const { return slice(state_.velocity, range_.first_vertex, range_.vertices); }
std::vector<double> RodAccess::twistRates() const { return slice(state_.twist_rate, range_.first_edge, range_.edges); }
std::vector<double> RodAccess::axialForces() const {
  return slice(state_.axial_force, range_.first_edge, range_.edges);
}
std::vector<double> RodAccess::twists() const { return atVertices(cellTwists(state_)); }

void RodAccess::fail(const std::string &what) const { throw SceneError("rod '" + rod().name + "': " + what); }

void RodAccess::checkCount(std::size_t given, int wanted, const char *what) const {
  if (given != std::size_t(wanted)) fail(text(given, " ", what, " given where it takes ", wanted));
}

bool RodAccess::holds(int vertex, bool (Support::*what)() const) const {
  return std::any_of(supports_.begin(), supports_.end(),
                     [&](const Support *s) { return s->vertex == vertex && (s->*what)(); });
}

/// Whether a vertex goes with a body.
bool RodAccess::isOnBody(int vertex) const {
  const auto joined = elements_.joinedVertices({index_, index_ + 1});
  return std::any_of(joined.begin(), joined.end(),
                     [=](const JoinedVertex &j) { return j.vertex == vertex && j.isOnBody(); });
}

Frame RodAccess::edgeFrame(const State &state, int i) const {
  const int v = range_.first_vertex + i, w = range_.first_vertex + rod().next(i);
  const Vec3 edge = (state.position[w] - state.position[v]) + (state.position_low[w] - state.position_low[v]);
  const double length = edge.norm();
  return {edge / length, state.director[range_.first_edge + i], length};
}

/// Frame of an edge, or of the support whose frame is at that slot.
Frame RodAccess::frameAt(const State &state, int slot) const {
  if (const int edge = edgeAt(range_, slot); edge >= 0) return edgeFrame(state, edge);
  for (const Support *s : supports_)
    if (elements_.support_slot[s - scene_.supports.data()] == slot) return supportFrame(*s, state.time);
  for (const JoinedEdge &j : elements_.joinedEdges({index_, index_ + 1}))
    if (j.frame == slot) return joinedFrame(state, elements_, j);
  throw std::logic_error("a cell joins a frame that nothing has");
}

int RodAccess::vertexOf(const LooseCell &cell) const {
  const int v = cell.vertex - range_.first_slot;
  return v == range_.vertices ? 0 : v; // a ring's first vertex lies behind its last
}

std::vector<double> RodAccess::cellTwists(const State &state) const {
  std::vector<double> twists;
  for (std::size_t n = 0; n < cells_.size(); ++n)
    twists.push_back(halfAngleBetween(frameAt(state, cells_[n].frame0), frameAt(state, cells_[n].frame1)).angle() +
                     state.winding[elements_.rod_cells[index_] + n]);
  return twists;
}

/// Where the twist of a vertex along a rod is held, its angle is that of both half cells.
std::vector<double> RodAccess::atVertices(const std::vector<double> &cell_twists) const {
  std::vector<double> twists(range_.vertices, 0.0);
  for (std::size_t n = 0; n < cells_.size(); ++n) {
    const int v = vertexOf(cells_[n]);
    const bool whole = edgeAt(range_, cells_[n].frame0) >= 0 && edgeAt(range_, cells_[n].frame1) >= 0;
    if (!whole || !holds(v, &Support::holdsTwist)) twists[v] += cell_twists[n]; // of a junction, both half cells
  }
  return twists;
}

void RodAccess::setTurns(State &next, std::vector<double> twists, const std::vector<double> &by) const {
  auto turning = [&](int slot) {
    const int edge = edgeAt(range_, slot);
    return edge < 0 ? 0.0 : by[edge];
  };
  std::vector<double> turns(cells_.size(), 0.0);
  for (std::size_t n = 0; n < cells_.size(); ++n) {
    const LooseCell &cell = cells_[n];
    const double expected = twists[n] + turning(cell.frame1) - turning(cell.frame0);
    const double principal = halfAngleBetween(frameAt(next, cell.frame0), frameAt(next, cell.frame1)).angle();
    if (!std::isfinite(principal))
      fail(text("folds back on itself at vertex ", vertexOf(cell), "; edges may turn by less than 179 degrees"));
    if (rod().measure == Measure::tan && std::abs(principal) > 0.9999 * pi)
      fail(text("is twisted by half a turn at vertex ", vertexOf(cell),
                ", the barrier of measure tan; use less, or measure: angle"));
    turns[n] = 2 * pi * std::round((expected - principal) / (2 * pi));
  }
  if (rod().measure == Measure::angle)
    std::copy(turns.begin(), turns.end(), next.winding.begin() + elements_.rod_cells[index_]);
}

void RodAccess::accept(State &&next) {
  settleBodies(elements_, {0, int(elements_.rods.size())}, next);
  next.memory.clear();
  next.strains.clear();
  next.support_actions.clear();
  next.last_dt = next.dt_before = 0;
  if (!dynamic_) next.time = 0;
  state_ = std::move(next);
}

void RodAccess::setPositions(const std::vector<Vec3> &x) {
  checkCount(x.size(), range_.vertices, "positions");
  if (x == positions()) return;
  Rod moved = rod(); // as checkRod wants it
  moved.position = x;
  checkRod(moved);
  double length = 0;
  for (int i = 0; i < range_.edges; ++i) length += elements_.restLength()[range_.slot(i)];
  State next = state_;
  for (int i = 0; i < range_.vertices; ++i) {
    const int v = range_.first_vertex + i;
    if (x[i] == state_.position[v]) continue; // with its second word
    if (holds(i, &Support::holdsPosition)) {
      const Vec3 &at = state_.position[v];
      if ((x[i] - at).norm() > 1e-9 * length)
        fail(text("vertex ", i, " is held at (", at[0], ", ", at[1], ", ", at[2], "), and cannot be put at (", x[i][0],
                  ", ", x[i][1], ", ", x[i][2], "); it moves by the motion of its support"));
      continue;
    }
    for (const JoinedVertex &j : elements_.joinedVertices({index_, index_ + 1}))
      if (j.vertex == i)
        fail(text("vertex ", i,
                  j.isOnBody() ? " is tied to body '" + scene_.bodies[j.body].name + "', and cannot be put elsewhere"
                               : " is in junction '" + scene_.junctions[j.junction].name +
                                     "', and cannot be put elsewhere by one of its rods"));
    next.position[v] = x[i];
    next.position_low[v].setZero();
  }
  for (int i = 0; i < range_.edges; ++i) {
    const Frame before = edgeFrame(state_, i);
    Frame after = edgeFrame(next, i);
    if (after.tangent == before.tangent && after.length == before.length) continue;
    // Minimal rotations to the opposite tangent are half turns about any normal: this one is about the director.
    if (before.tangent.dot(after.tangent) > -1 + 1e-12)
      after.director = transport<double>(before.director, before.tangent, after.tangent);
    next.director[range_.first_edge + i] = orthonormalised(after.director, after.tangent);
    next.axial_force[range_.first_edge + i] =
        rod().material.axial_stiffness *
        axialStrain<double>(rod().energy, after.length, elements_.inverseRestLength()[range_.slot(i)]);
  }
  setTurns(next, cellTwists(state_), std::vector<double>(range_.edges, 0.0));
  accept(std::move(next));
}

void RodAccess::setDirectors(const std::vector<Vec3> &d) {
  checkCount(d.size(), range_.edges, "directors");
  if (d == directors()) return;
  State next = state_;
  std::vector<double> by(range_.edges, 0.0);
  for (int i = 0; i < range_.edges; ++i) {
    const Frame f = edgeFrame(state_, i);
    if (!d[i].allFinite() || std::abs(d[i].norm() - 1) > 1e-3 || std::abs(d[i].dot(f.tangent)) > 1e-3)
      fail(text("the director of edge ", i, " is (", d[i][0], ", ", d[i][1], ", ", d[i][2],
                "); it must be of unit length and normal to its edge within 1e-3"));
    if (d[i] == f.director) continue;
    next.director[range_.first_edge + i] = orthonormalised(d[i], f.tangent);
    by[i] = halfAngleBetween(f, edgeFrame(next, i)).angle();
  }
  setTurns(next, cellTwists(state_), by);
  accept(std::move(next));
}

void RodAccess::setTwists(const std::vector<double> &angle) {
  checkCount(angle.size(), range_.vertices, "twist angles");
  if (!range_.twist) fail("is a cable, whose twist means nothing");
  std::vector<double> cells = cellTwists(state_);
  const std::vector<double> now = atVertices(cells);
  if (angle == now) return;
  const int last = range_.closed ? 0 : range_.vertices - 1;
  auto has = [&](int v) { return range_.closed || (v > 0 && v < last) || holds(v, &Support::holdsTwist); };
  for (int v = 0; v < range_.vertices; ++v) {
    if (!has(v)) continue;
    if (!std::isfinite(angle[v])) fail(text("the twist angle at vertex ", v, " is not finite"));
    if (rod().measure == Measure::tan && std::abs(angle[v]) >= pi)
      fail(text("the twist angle at vertex ", v, " is ", angle[v], "; measure tan takes less than half a turn, ", pi));
  }
  std::vector<double> by(range_.edges, 0.0);
  if (!range_.closed && has(0)) by[0] = angle[0] - now[0];
  for (int i = 1; i < range_.edges; ++i) by[i] = by[i - 1] + angle[i] - now[i];
  if (has(last)) {
    const double follows = now[last] + (range_.closed ? by.front() : 0.0) - by.back();
    const double turns = 2 * pi * std::round((angle[last] - follows) / (2 * pi));
    if (std::abs(angle[last] - follows - turns) > 1e-6)
      fail(text("the twist angle at vertex ", last, " follows from the others: ", follows,
                ", up to whole turns, and not ", angle[last]));
    for (std::size_t n = 0; n < cells_.size(); ++n) // into the half cell next to edge 0 of a ring, and the whole one
      if (vertexOf(cells_[n]) == last && (!range_.closed || edgeAt(range_, cells_[n].frame1) >= 0)) cells[n] += turns;
  }
  State next = state_;
  for (int i = 0; i < range_.edges; ++i) {
    const Frame f = edgeFrame(state_, i);
    if (by[i] != 0)
      next.director[range_.first_edge + i] =
          orthonormalised(rotateAbout<double>(f.director, f.tangent, by[i]), f.tangent);
  }
  setTurns(next, cells, by);
  accept(std::move(next));
}

void RodAccess::setVelocities(const std::vector<Vec3> &v) {
  checkCount(v.size(), range_.vertices, "velocities");
  if (const int i = firstNotFinite(v); i >= 0) fail(text("the velocity of vertex ", i, " is not finite"));
  if (v == velocities()) return;
  State next = state_;
  for (int i = 0; i < range_.vertices; ++i)
    if (elements_.freedom()[range_.slot(i)] != 0 && !isOnBody(i))
      forSameVertices(elements_, index_, i,
                      [&](int rod, int vertex) { next.velocity[elements_.rods[rod].first_vertex + vertex] = v[i]; });
  accept(std::move(next));
}

void RodAccess::setTwistRates(const std::vector<double> &rate) {
  checkCount(rate.size(), range_.edges, "twist rates");
  if (!range_.twist) fail("is a cable, whose twist means nothing");
  if (const int i = firstNotFinite(rate); i >= 0) fail(text("the twist rate of edge ", i, " is not finite"));
  if (rate == twistRates()) return;
  State next = state_;
  std::copy(rate.begin(), rate.end(), next.twist_rate.begin() + range_.first_edge);
  accept(std::move(next));
}

void RodAccess::stop() {
  setVelocities(std::vector<Vec3>(range_.vertices, Vec3::Zero()));
  if (range_.twist) setTwistRates(std::vector<double>(range_.edges, 0.0));
}

void RodAccess::reset() {
  const State initial = initialState(scene_, elements_);
  State next = state_;
  auto copy = [](const auto &from, auto &to, int first, int count) {
    std::copy_n(from.begin() + first, count, to.begin() + first);
  };
  copy(initial.position, next.position, range_.first_vertex, range_.vertices);
  copy(initial.position_low, next.position_low, range_.first_vertex, range_.vertices);
  copy(initial.velocity, next.velocity, range_.first_vertex, range_.vertices);
  copy(initial.director, next.director, range_.first_edge, range_.edges);
  copy(initial.twist_rate, next.twist_rate, range_.first_edge, range_.edges);
  copy(initial.axial_force, next.axial_force, range_.first_edge, range_.edges);
  copy(initial.winding, next.winding, elements_.rod_cells[index_], int(cells_.size()));
  accept(std::move(next));
}

} // namespace tendril
