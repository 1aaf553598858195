#include "tendril/contact/touching_rods.hpp"

#include "tendril/contact/contact.hpp"
#include "tendril/energy/load.hpp"

namespace tendril {

TouchingRods::TouchingRods(const Scene &scene, const Elements &elements)
    : scene_(scene), elements_(elements), neighbours_(scene, elements), stiffness_(scene.rods.size(), 0),
      bounded_(scene.rods.size(), 0), surprised_(scene.rods.size(), false) {
  for (std::size_t r = 0; r < scene.rods.size(); ++r) stiffness_[r] = scene.rods[r].contact.stiffness;
  for (int q = 0; q < 4; ++q) points_[std::size_t(q)] = samplePoints(q == 0 ? 3 : q, 1, 1);
}

int TouchingRods::spheresOf(int r, int edge, std::array<SamplePoint, 3> &out) const {
  const RodRange &rod = elements_.rods[std::size_t(r)];
  auto length = [&](int i) { return elements_.restLength()[rod.slot(i)]; };
  if (const int gauss = settings(r).cloud; gauss > 0) {
    for (int k = 0; k < gauss; ++k) {
      const SamplePoint &p = points_[std::size_t(gauss)][std::size_t(k)];
      out[std::size_t(k)] = {p.at, p.weight * length(edge)};
    }
    return gauss;
  }
  const bool first = edge == 0 && !rod.closed, last = edge + 1 == rod.edges && !rod.closed;
  out[0] = {0, 0.5 * (length(edge) + (first ? 0 : length(edge > 0 ? edge - 1 : rod.edges - 1)))};
  if (last) out[1] = {1, 0.5 * length(edge)};
  return last ? 2 : 1;
}

void TouchingRods::find(const State &state, const Configuration &start, const Planes &way, const Step &step,
                        double room) {
  static_ = step.isStatic();
  const bool surprised = room > 1 && std::find(surprised_.begin(), surprised_.end(), true) != surprised_.end();
  makeRoom(start, &way, room);
  take(neighbours_.find(room_));
  expect(start, way, surprised);
  std::fill(bounded_.begin(), bounded_.end(), 0);
  std::fill(surprised_.begin(), surprised_.end(), false);
  setStiffness(state, start, way, step);
  setLaws();
}

void TouchingRods::setLaws() const {
  laws_.clear();
  for (const TouchingPair &p : pairs_.items) laws_.push_back(lawOf(stiffness_, p));
}

/// Those of one rod that the way takes near each other, and all of two rods. \param all of one rod, too
void TouchingRods::expect(const Configuration &start, const Planes &way, bool all) {
  int count = 0;
  for (const TouchingPair &p : pairs_.items) {
    bool expected = all || p.rod != p.to_rod;
    if (!expected) {
      const std::array<Vec3, 4> x = pointsOf(p, start);
      std::array<Vec3, 4> ways;
      for (std::size_t k = 0; k < 4; ++k) ways[k] = way.vector(0, p.slot[k]);
      expected = nearlyTouch(scene_, p, x) ||
                 freePart(x, ways, radiiOf(p) + 3 * lawOf(stiffness_, p).reach(), 0.1 * widthOf(p)) < 1;
    }
    expected_[std::size_t(p.number)] = expected ? count++ : -1;
  }
}

std::vector<TouchingPair> TouchingRods::expected() const {
  std::vector<TouchingPair> pairs;
  std::copy_if(pairs_.items.begin(), pairs_.items.end(), std::back_inserter(pairs),
               [&](const TouchingPair &p) { return expectedNumber(p) >= 0; });
  return pairs;
}

void TouchingRods::cover(const Configuration &c, int r) const {
  const bool covered = room_.start.size() > 0 && isInRoom(c, c, 0, r);
  if (covered) return;
  makeRoom(c, nullptr, 1);
  take(neighbours_.find(room_));
  setLaws();
}

/// Between samples edges come a little nearer to each other than samples do, whose energy is what holds them apart: no
/// way is ended before that does.
double TouchingRods::wallOf(const TouchingPair &p) const {
  const double wall = wallBetween(settings(p.rod), settings(p.to_rod));
  return settings(p.rod).isBarrier() ? wall - 0.25 * widthOf(p) : wall;
}

/// Vertices go along their ways, and as far to all sides; edges turn by about 15 degrees from theirs, or in statics,
/// where no way is known, by 60.
void TouchingRods::makeRoom(const Configuration &start, const Planes *way, double room) const {
  const double turn = (static_ ? 1 : 0.25) * room;
  if (room_.start.size() == 0) room_ = Room(elements_.slots, scene_.rods.size());
  std::fill(room_.bend.begin(), room_.bend.end(), turn);
  for (std::size_t r = 0; r < scene_.rods.size(); ++r) {
    const RodRange &rod = elements_.rods[r];
    double most = 0;
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) {
      room_.start.setVector(0, s, start.positionAt(s));
      room_.way.setVector(0, s, way ? way->vector(0, s) : Vec3(Vec3::Zero()));
      most = std::max(most, room_.wayOf(s).squaredNorm());
    }
    room_.beyond[r] = room * std::max(settings(int(r)).radius, std::min(std::sqrt(most), elements_.length(int(r))));
  }
}

void TouchingRods::addRooms(int r, std::vector<Box> &rooms) const {
  if (!settings(r).touchesRods()) return;
  Box room;
  for (int i = 0; i < elements_.rods[std::size_t(r)].edges; ++i) room.include(neighbours_.boxOf(room_, r, i));
  rooms.push_back(room);
}

/// Whether a rod is in its room at a part of the straight way between two configurations.
bool TouchingRods::isInRoom(const Configuration &from, const Configuration &to, double part, int r) const {
  const RodRange &rod = elements_.rods[r];
  auto moved = [&](int slot) {
    const Vector3<Pack> x = readVector<Pack>(from.values(), Configuration::position, slot),
                        y = readVector<Pack>(to.values(), Configuration::position, slot);
    return Vector3<Pack>(x + (y - x) * Pack(part) - readVector<Pack>(room_.start, 0, slot));
  };
  Pack along(0.0), all(0.0);
  for (int i = 0; i < rod.vertices; i += lanes) {
    const Vector3<Pack> way = readVector<Pack>(room_.way, 0, rod.slot(i));
    const Pack::mask_type counts = firstLanes(rod.vertices - i);
    along += select(counts, way.dot(moved(rod.slot(i))), Pack(0.0));
    all += select(counts, way.squaredNorm(), Pack(0.0));
  }
  const double gone = sum(all) > 0 ? std::clamp(sum(along) / sum(all), 0.0, 1.0) : 0, bend = room_.bend[std::size_t(r)],
               beyond = room_.beyond[std::size_t(r)];
  auto off = [&](int slot) { return Vector3<Pack>(moved(slot) - readVector<Pack>(room_.way, 0, slot) * Pack(gone)); };
  for (int i = 0; i < rod.vertices; i += lanes)
    if (any_of(firstLanes(rod.vertices - i) && !(off(rod.slot(i)).squaredNorm() <= Pack(beyond * beyond))))
      return false;
  if (settings(r).rods != ContactSettings::Rods::all) return true;
  for (int i = 0; i < rod.edges; i += lanes) {
    const int slot = rod.slot(i), count = std::min(rod.edges, rod.vertices - 1) - i; // but for what closes a ring
    const Pack most = Pack(bend) * read<Pack>(elements_.restLength() + slot);
    const Vector3<Pack> turned = off(slot + 1) - off(slot);
    if (count > 0 && any_of(firstLanes(count) && !(turned.squaredNorm() <= most * most))) return false;
  }
  if (!rod.closed) return true;
  auto first = [](const Vector3<Pack> &v) { return Vec3(v[0][0], v[1][0], v[2][0]); };
  const int last = rod.slot(rod.vertices - 1);
  return (first(off(rod.first_slot)) - first(off(last))).norm() <= bend * elements_.restLength()[last];
}

void TouchingRods::take(std::vector<TouchingPair> pairs) const {
  pairs_ = {};
  pairs_.items = std::move(pairs);
  pairs_.sort(scene_.rods.size());
  goes_on_.clear();
  expected_.assign(pairs_.items.size(), -1);
  of_rod_.assign(scene_.rods.size(), {});
  auto goesOn = [&](int rod, int edge, int to_rod, int to_edge) {
    const RodRange &range = elements_.rods[std::size_t(to_rod)];
    if (!range.closed && to_edge + 1 == range.edges) return false;
    return neighbours_.mayTouch(rod, edge, to_rod, (to_edge + 1) % range.edges);
  };
  for (TouchingPair &p : pairs_.items) {
    p.number = int(goes_on_.size());
    goes_on_.push_back({goesOn(p.rod, p.edge, p.to_rod, p.to_edge), goesOn(p.to_rod, p.to_edge, p.rod, p.edge)});
    of_rod_[std::size_t(p.rod)].push_back(p.number);
    if (p.to_rod != p.rod) of_rod_[std::size_t(p.to_rod)].push_back(p.number);
  }
}

double TouchingRods::smallestGap(const Configuration &c, int r) const {
  double least = HUGE_VAL;
  for (const TouchingPair &p : pairs_.of({r, r + 1})) {
    const std::array<Vec3, 4> x = pointsOf(p, c);
    if (isCloud(p)) {
      visitCloud(p, x, least, [&](const Touching &t) { least = std::min(least, t.gap); });
      continue;
    }
    const double radii = radiiOf(p), apart = farApart(x) - radii;
    if (apart < least) least = std::min(least, closest(x[0], x[1], x[2], x[3]).distance - radii);
  }
  return least;
}

double TouchingRods::freeFraction(const Configuration &from, const Configuration &to, int r) const {
  constexpr double near = 0.2;
  double free = 1;
  if (!isInRoom(from, to, 1, r)) {
    ++bounded_[std::size_t(r)];
    free = largestPart([&](double part) { return isInRoom(from, to, part, r); });
  }
  for (const TouchingPair &p : pairs_.of({r, r + 1})) {
    const std::array<Vec3, 4> x = pointsOf(p, from);
    const double wall = wallOf(p);
    std::array<Vec3, 4> way;
    double longest = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      way[k] = to.displacementAt(p.slot[k], from);
      longest = std::max(longest, way[k].norm());
    }
    if (farApart(x) - 2 * longest > wall + widthOf(p)) continue;
    const double gap = closest(x[0], x[1], x[2], x[3]).distance - wall;
    if (gap <= 0) return 0;
    free = std::min(free, freePart(x, way, wall, near * std::min(gap, widthOf(p))));
  }
  return free;
}

/// Stiffness of barriers by what they have to bear: loads, and what stops rods that meet in the step. One that is
/// pressed stays as it is, or it would throw rods off.
void TouchingRods::setStiffness(const State &state, const Configuration &start, const Planes &way, const Step &step) {
  const std::size_t rods = scene_.rods.size();
  const std::vector<double> before =
      state.rod_contact_stiffness.empty() ? std::vector<double>(rods, 0.0) : state.rod_contact_stiffness;
  std::vector<double> pressure(rods, 0), load(rods, 0);
  std::vector<std::map<int, double>> closing(rods); // of each edge, the fastest [m]
  for (const TouchingPair &p : pairs_.items) {
    const std::array<Vec3, 4> x = pointsOf(p, start);
    const NormalLaw law = lawOf(before, p);
    visit(p, x, law.reach(), [&](const Touching &t) {
      for (const int r : {p.rod, p.to_rod})
        pressure[std::size_t(r)] = std::max(pressure[std::size_t(r)], -law(t.gap).slope);
    });
    if (step.isStatic()) continue;
    const Closest near = closest(x[0], x[1], x[2], x[3]);
    auto at = [&](std::size_t k, double part) {
      return Vec3((1 - part) * way.vector(0, p.slot[k]) + part * way.vector(0, p.slot[k + 1]));
    };
    const double towards = -near.from.normalized().dot(at(0, near.part) - at(2, near.other_part));
    if (!(towards > near.distance - radiiOf(p) - law.reach())) continue;
    for (const auto &[r, edge] : {std::pair(p.rod, p.edge), std::pair(p.to_rod, p.to_edge)}) {
      double &fastest = closing[std::size_t(r)][edge];
      fastest = std::max(fastest, towards);
    }
  }
  for (std::size_t r = 0; r < rods; ++r) {
    const ContactSettings &contact = settings(int(r));
    if (!contact.touchesRods() || !contact.isBarrier() || contact.stiffness > 0) continue;
    constexpr double bearable = 1e4;
    if (!step.isStatic() && pressure[r] > 0 && pressure[r] <= bearable * before[r]) {
      stiffness_[r] = before[r];
      continue;
    }
    load[r] = loadScale(scene_, elements_, int(r), elements_.length(int(r)));
    const RodRange &rod = elements_.rods[r];
    for (const auto &[edge, fastest] : closing[r]) // what stops it
      load[r] += scene_.rods[r].material.linear_density * elements_.restLength()[rod.slot(edge)] * fastest /
                 (step.dt * step.dt);
    stiffness_[r] = barrierStiffness(scene_, elements_, load[r], pressure[r], step.isStatic(), int(r));
  }
  if (!step.isStatic() && state.rod_contact_stiffness.empty()) bearAsDrawn(start, load);
}

/// What is drawn touching is not thrown off: each rod is pressed by no more than its loads, and those that touch it by
/// no more than that.
void TouchingRods::bearAsDrawn(const Configuration &start, const std::vector<double> &load) {
  constexpr double least = 1e-3;
  std::vector<double> pressed(load.size(), 0), borne = stiffness_;
  for (const TouchingPair &p : pairs_.items)
    visit(p, pointsOf(p, start), lawOf(stiffness_, p).reach(), [&](const Touching &t) {
      for (const int r : {p.rod, p.to_rod}) pressed[std::size_t(r)] -= t.weight * lawOf(stiffness_, p)(t.gap).slope;
    });
  auto isFixed = [&](std::size_t r) { return !settings(int(r)).isBarrier() || settings(int(r)).stiffness > 0; };
  for (std::size_t r = 0; r < load.size(); ++r)
    if (pressed[r] > load[r] && !isFixed(r)) borne[r] *= std::max(load[r] / pressed[r], least);
  for (const TouchingPair &p : pairs_.items) {
    bool touches = false;
    visit(p, pointsOf(p, start), lawOf(stiffness_, p).reach(), [&](const Touching &) { touches = true; });
    const double both = std::min(borne[std::size_t(p.rod)], borne[std::size_t(p.to_rod)]);
    for (const int r : {p.rod, p.to_rod})
      if (touches && !isFixed(std::size_t(r))) stiffness_[std::size_t(r)] = std::min(stiffness_[std::size_t(r)], both);
  }
}

} // namespace tendril
