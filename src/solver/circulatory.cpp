#include "tendril/solver/circulatory.hpp"

#include <algorithm>

namespace tendril {

Circulatory::Circulatory(const IncrementalPotential &potential, std::vector<RodSet> islands, RodSet rods)
    : potential_(potential), islands_(std::move(islands)) {
  const RodSet of{islands_.front().begin, islands_.back().end};
  auto isHere = [&](int rod) { return rod >= of.begin && rod < of.end; };
  for (const EdgeMoment &m : potential.scene().moments)
    if (isHere(m.rod)) sources_.push_back({.rod = m.rod, .couple = &m});
  for (const PlacedFollower &f : potential.elements().followers(of)) sources_.push_back({.rod = f.rod, .follower = &f});
  for (int r = of.begin; r < of.end; ++r)
    for (const EndCouple &end : potential.elements().end_couples[r])
      if (end.stretches && !end.moment.isZero(0)) sources_.push_back({.rod = r, .end = &end});
  for (const JoinedBody &b : potential.elements().bodies(of))
    if (potential.isDynamic() || potential.scene().hasCouples()) sources_.push_back({.rod = b.rod, .body = &b});
  std::stable_sort(sources_.begin(), sources_.end(), [](const Source &a, const Source &b) { return a.rod < b.rod; });
  int most = 0;
  for (const RodSet island : islands_) most = std::max(most, pairsOn(island));
  if (most > 0) right_ = potential.dofs().makePlanes(rods);
  solved_.assign(2 * most, right_);
}

int Circulatory::pairsOn(RodSet island) const {
  auto before = [](const Source &s, int rod) { return s.rod < rod; };
  const auto end = std::lower_bound(sources_.begin(), sources_.end(), island.end, before);
  int count = 0;
  for (auto s = std::lower_bound(sources_.begin(), sources_.end(), island.begin, before); s != end; ++s)
    count += s->pairs();
  return count;
}

double Circulatory::Column::dot(const Planes &x) const {
  if (of_vector) return edge.dot(x.vector(0, slot));
  return edge.dot(x.vector(0, slot + 1) - x.vector(0, slot)) + twist * x[3][slot];
}

void Circulatory::Column::addTo(Planes &x) const {
  if (of_vector) return x.setVector(0, slot, x.vector(0, slot) + edge);
  x.setVector(0, slot, x.vector(0, slot) - edge);
  x.setVector(0, slot + 1, x.vector(0, slot + 1) + edge);
  x[3][slot] += twist;
}

/// Two directions across the moment; their spins are what it turns into each other.
void Circulatory::addCouple(const Source &source, int slot, const Vec3 &moment) {
  const Frame f = potential_.iterate().frameAt(slot);
  const double size = moment.norm();
  const Vec3 along = size > 0 ? Vec3(moment / size) : f.tangent, across = along.unitOrthogonal();
  for (const Vec3 &d : {across, Vec3(along.cross(across))})
    if (source.body)
      columns_.push_back({source.rod, slot, d, 0, true});
    else
      columns_.push_back({source.rod, slot, d.cross(f.tangent) / f.length, d.dot(f.tangent), false});
  strength_.push_back({0.5 * size, -0.5 * size});
}

void Circulatory::addFollower(const PlacedFollower &follower) {
  const Frame f = potential_.iterate().frameAt(follower.edge);
  const Vec3 force = potential_.step().load_factor * follower.along(f);
  const double size = force.norm();
  const Vec3 along = size > 0 ? Vec3(force / size) : f.tangent, p = along.unitOrthogonal(), q = along.cross(p);
  auto addPair = [&](const Vec3 &moved, const Vec3 &spin, double strength) {
    columns_.push_back({follower.rod, follower.vertex, moved, 0, true});
    columns_.push_back({follower.rod, follower.edge, spin.cross(f.tangent) / f.length, spin.dot(f.tangent), false});
    strength_.push_back({strength, 0});
  };
  addPair(q, p, size);
  addPair(p, q, -size);
}

/// The pull depends on the directors, which the spin of the edge turns.
void Circulatory::addEndPull(int rod, const EndCouple &end) {
  const Frame f = potential_.iterate().frameAt(end.edge);
  const Vec3 spin = endPull(potential_.elements(), f, end, potential_.step().load_factor).by_spin;
  columns_.push_back({rod, end.edge, f.tangent, 0, false});
  columns_.push_back({rod, end.edge, spin.cross(f.tangent) / f.length, spin.dot(f.tangent), false});
  strength_.push_back({1, 0});
}

PetscErrorCode Circulatory::update(const Solve &solve) {
  PetscFunctionBeginUser;
  columns_.clear();
  strength_.clear();
  for (const Source &source : sources_)
    if (source.follower)
      addFollower(*source.follower);
    else if (source.end)
      addEndPull(source.rod, *source.end);
    else if (source.body)
      addCouple(source, source.body->rotation, -2 * potential_.circulation(*source.body));
    else {
      const EdgeMoment &m = *source.couple;
      const int slot = potential_.elements().rods[m.rod].slot(m.edge);
      addCouple(source, slot,
                potential_.step().load_factor * (m.moment - m.torque * potential_.iterate().frameAt(slot).tangent));
    }
  for (std::size_t k = 0; k < solved_.size(); ++k) {
    right_.clear();
    std::size_t first = 0;
    for (const RodSet island : islands_) {
      const std::size_t columns = 2 * std::size_t(pairsOn(island));
      if (k < columns) {
        const Column &column = columns_[first + k];
        column.addTo(right_);
        potential_.dofs().fold(potential_.dofs().rods()[column.rod], right_);
        potential_.dofs().foldJoined(island, right_);
      }
      first += columns;
    }
    PetscCall(solve(right_, solved_[k]));
  }
  PetscFunctionReturn(0);
}

bool Circulatory::correct(Planes &x) const {
  std::size_t first = 0;
  for (const RodSet island : islands_) {
    const int n = 2 * pairsOn(island);
    if (n == 0) continue;
    const Column *column = columns_.data() + first;
    Eigen::VectorXd right(n);
    Eigen::MatrixXd between(n, n); // columns' rows times the solved columns
    for (int i = 0; i < n; ++i) {
      right[i] = column[i].dot(x);
      for (int k = 0; k < n; ++k) between(i, k) = column[i].dot(solved_[k]);
    }
    // (1 + A G) c = A u'x with A = forward a b' + backward b a' pair by pair
    Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd turned(n);
    for (int j = 0; j < n; j += 2) {
      const auto [forward, backward] = strength_[(first + j) / 2];
      system.row(j) += forward * between.row(j + 1);
      system.row(j + 1) += backward * between.row(j);
      turned[j] = forward * right[j + 1];
      turned[j + 1] = backward * right[j];
    }
    const Eigen::VectorXd c = system.partialPivLu().solve(turned);
    if (!c.allFinite()) return false;
    for (int k = 0; k < n; ++k)
      for (int r = island.begin; r < island.end; ++r) {
        const RodRange &rod = potential_.dofs().rods()[r];
        for (int a = 0; a < slot_size; ++a)
          for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); ++s)
            x[a][s] -= c[k] * solved_[k][a][s];
        potential_.dofs().forBeside({r, r + 1},
                                    [&](int s) { x.setVector(0, s, x.vector(0, s) - c[k] * solved_[k].vector(0, s)); });
      }
    first += n;
  }
  return true;
}

} // namespace tendril
