#include "tendril/solver/circulatory.hpp"

#include <algorithm>

namespace tendril {

Circulatory::Circulatory(const IncrementalPotential &potential, std::vector<RodSet> islands)
    : potential_(potential), islands_(std::move(islands)) {
  const RodSet rods{islands_.front().begin, islands_.back().end};
  for (const EdgeMoment &m : potential.scene().moments)
    if (m.rod >= rods.begin && m.rod < rods.end) couples_.push_back({m});
  for (const JoinedBody &b : potential.elements().bodies(rods))
    if (potential.isDynamic() || potential.scene().hasCouples()) couples_.push_back({{b.rod, -1, 0, Vec3::Zero()}, &b});
  std::stable_sort(couples_.begin(), couples_.end(), [](const Couple &a, const Couple &b) { return a.rod < b.rod; });
  int most = 0;
  for (const RodSet island : islands_) most = std::max(most, countOn(island));
  right_ = Planes(slot_size, most > 0 ? potential.dofs().slots(rods) : 0);
  right_.setOrigin(potential.dofs().rods()[rods.begin].first_slot);
  solved_.assign(2 * most, right_);
}

int Circulatory::countOn(RodSet island) const {
  auto before = [](const Couple &m, int rod) { return m.rod < rod; };
  return int(std::lower_bound(couples_.begin(), couples_.end(), island.end, before) -
             std::lower_bound(couples_.begin(), couples_.end(), island.begin, before));
}

double Circulatory::Column::dot(const Planes &x) const {
  if (of_body) return edge.dot(x.vector(0, slot));
  return edge.dot(x.vector(0, slot + 1) - x.vector(0, slot)) + twist * x[3][slot];
}

void Circulatory::Column::addTo(Planes &x) const {
  if (of_body) return x.setVector(0, slot, x.vector(0, slot) + edge);
  x.setVector(0, slot, x.vector(0, slot) - edge);
  x.setVector(0, slot + 1, x.vector(0, slot + 1) + edge);
  x[3][slot] += twist;
}

PetscErrorCode Circulatory::update(const Solve &solve) {
  PetscFunctionBeginUser;
  columns_.clear();
  strength_.clear();
  for (const Couple &couple : couples_) {
    const bool of_body = couple.body;
    const int slot = of_body ? couple.body->rotation : potential_.elements().rods[couple.rod].slot(couple.edge);
    const Frame f = potential_.iterate().frameAt(slot);
    const Vec3 moment = of_body ? Vec3(-2 * potential_.circulation(*couple.body))
                                : Vec3(potential_.step().load_factor * (couple.moment - couple.torque * f.tangent));
    const double size = moment.norm();
    // Two directions across the moment; their spins are what it turns into each other.
    const Vec3 along = size > 0 ? Vec3(moment / size) : f.tangent, across = along.unitOrthogonal();
    for (const Vec3 &d : {across, Vec3(along.cross(across))})
      columns_.push_back({couple.rod, slot, of_body ? d : Vec3(d.cross(f.tangent) / f.length),
                          of_body ? 0 : d.dot(f.tangent), of_body});
    strength_.push_back(0.5 * size);
  }
  for (std::size_t k = 0; k < solved_.size(); ++k) {
    right_.clear();
    std::size_t first = 0;
    for (const RodSet island : islands_) {
      const std::size_t columns = 2 * std::size_t(countOn(island));
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
    const int n = 2 * countOn(island);
    if (n == 0) continue;
    const Column *column = columns_.data() + first;
    Eigen::VectorXd right(n);
    Eigen::MatrixXd between(n, n); // columns' rows times the solved columns
    for (int i = 0; i < n; ++i) {
      right[i] = column[i].dot(x);
      for (int k = 0; k < n; ++k) between(i, k) = column[i].dot(solved_[k]);
    }
    // (1 + A G) c = A u'x with A = strength (a b' - b a') couple by couple
    Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd turned(n);
    for (int j = 0; j < n; j += 2) {
      const double strength = strength_[(first + j) / 2];
      system.row(j) += strength * between.row(j + 1);
      system.row(j + 1) -= strength * between.row(j);
      turned[j] = strength * right[j + 1];
      turned[j + 1] = -strength * right[j];
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
