#include "tendril/solver/banded.hpp"

#include "tendril/solver/elimination.hpp"
#include "tendril/solver/factor_type.hpp"
#include "tendril/solver/reduced_elimination.hpp"
#include "tendril/solver/substitution.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace tendril {
namespace {

template <class T> T *as(double *p) { return reinterpret_cast<T *>(p); }
template <class T> const T *as(const double *p) { return reinterpret_cast<const T *>(p); }

/// Calls visit with the shape of a rod without twists.
template <class Visit> auto withShape(const RodRange &rod, const Visit &visit) {
  switch (rod.flat) {
  case 0:
    return visit(ReducedShape<true, 0>());
  case 1:
    return visit(ReducedShape<true, 1>());
  case 2:
    return visit(ReducedShape<true, 2>());
  default:
    return rod.bends ? visit(ReducedShape<true>()) : visit(ReducedShape<false>());
  }
}

/// Numbers that the factor of an edge takes.
template <class T> std::size_t perEdge(const RodRange &rod, bool reduced) {
  return reduced ? withShape(rod, [](auto shape) { return std::size_t(shape.record); }) : Record<T>::of(rod);
}

} // namespace

void addMetric(const Planes &metric, const double *edges, const RodRange &rod, const Joins &joins, double scale,
               const Planes &v, Planes &y) {
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) y[a][s] += scale * metric[a][s] * v[a][s];
  for (int a = 0; edges && a < 3; ++a)
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) {
      const double force = scale * edges[s] * (v[a][s + 1] - v[a][s]);
      y[a][s] -= force;
      y[a][s + 1] += force;
    }
  auto add = [&](int s) {
    for (int a = 0; a < 3; ++a) y[a][s] += scale * metric[a][s] * v[a][s];
  };
  for (const JoinedEdge &j : joins.edges) add(j.frame);
  for (const JoinedBody &b : joins.bodies) {
    add(b.position);
    add(b.rotation);
  }
}

BandedFactor::BandedFactor(const DofMap &dofs, RodSet set, BandedWorkspace &workspace)
    : dofs_(dofs), rods_(set), order_(set.end - set.begin), held_(order_.size()), negative_(order_.size(), 0),
      zero_(order_.size(), 0), workspace_(workspace) {
  const auto &rods = dofs.rods();
  std::size_t rows = 0;
  for (int r = set.begin; r < set.end; ++r) {
    for (int i = 0; i < rods[r].vertices; ++i) held_[r - set.begin].push_back(dofs.isHeld(rods[r].first_vertex + i));
    rows = std::max(rows, std::size_t(slot_size) * rods[r].vertices);
  }
  std::iota(order_.begin(), order_.end(), set.begin);
  // Slots, too: planes of blocks are so far apart.
  auto shape = [&](int r) {
    return std::tuple(rods[r].vertices, rods[r].slots, rods[r].closed, rods[r].twist, rods[r].bends, rods[r].flat);
  };
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) {
    if (shape(a) != shape(b)) return shape(a) < shape(b);
    return held_[a - set.begin] < held_[b - set.begin];
  });
  auto grow = [&](AlignedVector &v, std::size_t size) {
    if (v.size() < size) v.resize(size, 0.0);
    bytes_ += size * sizeof(double);
  };
  grow(workspace.factors, plan(nullptr, true)); // nothing else needs more
  grow(workspace.rows, rows * lanes);
}

bool BandedFactor::sameShape(int a, int b) const {
  const RodRange &one = dofs_.rods()[a], &other = dofs_.rods()[b];
  return one.vertices == other.vertices && one.slots == other.slots && one.closed == other.closed &&
         one.twist == other.twist && one.bends == other.bends && one.flat == other.flat &&
         held_[a - rods_.begin] == held_[b - rods_.begin];
}

/// Groups of the active rods of each shape: whole packs; of the rest, a pack when that is cheaper than one after the
/// other. Returns how many numbers their factors take.
/// \param joins as EdgeBlocks::joins
std::size_t BandedFactor::plan(const char *active, bool joins) {
  constexpr int worth_a_pack = 3;
  groups_.clear();
  std::size_t size = 0;
  auto close = [&](Group group, bool packed) {
    const RodRange &rod = dofs_.rods()[group.rod[0]];
    group.packed = packed;
    group.reduced = !rod.twist && !rod.closed && !joins;
    group.factor = size;
    size += packed ? lanes * (vertex_record + rod.edges * perEdge<Pack>(rod, group.reduced))
                   : vertex_record + rod.edges * perEdge<double>(rod, group.reduced);
    size = (size + lanes - 1) / lanes * lanes; // packs begin where they can be read at once
    groups_.push_back(group);
  };
  Group open{};
  auto flush = [&] {
    if (open.count >= worth_a_pack) {
      for (int l = open.count; l < lanes; ++l) open.rod[l] = open.rod[0];
      close(open, true);
    } else
      for (int l = 0; l < open.count; ++l) {
        Group one{};
        one.rod[0] = open.rod[l];
        one.count = 1;
        close(one, false);
      }
    open.count = 0;
  };
  for (const int r : order_) {
    if (active && !active[r]) continue;
    if (open.count == lanes || (open.count > 0 && !sameShape(open.rod[0], r))) flush();
    open.rod[open.count++] = r;
  }
  flush();
  return size;
}

void BandedFactor::factor(const BandedSystem &system) {
  plan(system.active->data(), system.blocks->joins());
  for (const Group &group : groups_)
    if (group.packed)
      factorGroup<Pack>(group, system);
    else
      factorGroup<double>(group, system);
}

template <class T> void BandedFactor::factorGroup(const Group &group, const BandedSystem &system) {
  const RodRange &first = dofs_.rods()[group.rod[0]];
  std::array<const double *, lanes> source{}, mass{}, spin{}, edge{};
  std::array<double, lanes> shift{};
  bool shifted = false;
  for (int l = 0; l < (group.packed ? lanes : 1); ++l) {
    const RodRange &rod = dofs_.rods()[group.rod[l]];
    source[l] = system.blocks->entry(rod, 0);
    mass[l] = (*system.metric)[0] + rod.first_slot;
    spin[l] = (*system.metric)[3] + rod.first_slot;
    edge[l] = system.edge_metric ? system.edge_metric + rod.first_slot : nullptr;
    shift[l] = (*system.shift)[group.rod[l]];
    shifted = shifted || shift[l] != 0;
  }
  const bool cable = !first.twist;
  const Missing missing(first);
  auto value = [&](std::size_t at, auto added) {
    if constexpr (std::is_same_v<T, Pack>)
      return Pack([&](auto lane) { return source[lane][at] + added(lane); });
    else
      return source[0][at] + added(0);
  };
  auto couplesPositions = [](int plane) {
    return plane == EdgeBlocks::vertex(0, 1) || plane == EdgeBlocks::vertex(0, 2) || plane == EdgeBlocks::vertex(1, 2);
  };
  auto plain = [&](int plane, int i) {
    if (couplesPositions(plane)) return T(0.0);
    return value(std::size_t(plane) * first.slots + i, [](int) { return 0.0; });
  };
  // A shift adds to the diagonal of positions, edges and twists; the twist of a cable is no unknown.
  auto rare = [&](int plane, int i) {
    if (missing.any() && !group.reduced && missing.has(plane)) return T(missing[plane]);
    const std::size_t at = std::size_t(plane) * first.slots + i;
    if (plane == EdgeBlocks::own(3, 3)) return value(at, [&](int l) { return cable ? 1.0 : shift[l] * spin[l][i]; });
    if (plane == EdgeBlocks::vertex(0, 0) || plane == EdgeBlocks::vertex(1, 1) || plane == EdgeBlocks::vertex(2, 2))
      return value(at, [&](int l) { return shift[l] * mass[l][i]; });
    if (plane == EdgeBlocks::own(0, 0) || plane == EdgeBlocks::own(1, 1) || plane == EdgeBlocks::own(2, 2))
      return value(at, [&](int l) { return edge[l] && i < first.edges ? shift[l] * edge[l][i] : 0.0; });
    return value(at, [](int) { return 0.0; });
  };
  const bool joins = system.blocks->joins();
  T negative, zero;
  if (first.closed || joins || shifted || system.coupled_positions || (cable && !group.reduced))
    eliminate<true>(group, rare, joins, &negative, &zero);
  else
    eliminate<false>(group, plain, joins, &negative, &zero);
  for (int l = 0; l < group.count; ++l)
    if constexpr (std::is_same_v<T, Pack>) {
      negative_[group.rod[l] - rods_.begin] = int(negative[l]);
      zero_[group.rod[l] - rods_.begin] = int(zero[l]);
    } else {
      negative_[group.rod[l] - rods_.begin] = int(negative);
      zero_[group.rod[l] - rods_.begin] = int(zero);
    }
}

/// \tparam any also rings, and rods whose positions have entries with edges
template <bool any, class T, class Read>
void BandedFactor::eliminate(const Group &group, const Read &read, bool joins, T *negative, T *zero) {
  const RodRange &rod = dofs_.rods()[group.rod[0]];
  const std::vector<char> &held = held_[group.rod[0] - rods_.begin];
  T *const vertex = as<T>(&workspace_.factors[group.factor]), *const records = vertex + vertex_record;
  if (group.reduced)
    return withShape(rod, [&](auto shape) {
      eliminateReduced<decltype(shape)>(rod.edges, held, read, vertex, records, *negative, *zero);
    });
  auto run = [&]<Border border, bool joined>() {
    Elimination<T, border, joined, Read> elimination({0, rod.edges}, held, read, records);
    elimination.run(vertex);
    *negative = elimination.negative;
    *zero = elimination.zero;
  };
  if constexpr (any) {
    if (rod.closed)
      return joins ? run.template operator()<Border::ring, true>() : run.template operator()<Border::ring, false>();
    if (joins) return run.template operator()<Border::none, true>();
  }
  run.template operator()<Border::none, false>();
}

void BandedFactor::solve(const PetscScalar *b, PetscScalar *x) {
  std::size_t solved = 0;
  for (const Group &group : groups_) solved += group.count;
  if (solved < order_.size()) {
    if (x == b) {
      workspace_.copy.assign(b, b + dofs_.unknowns(rods_));
      b = workspace_.copy.data();
    }
    std::fill_n(x, dofs_.unknowns(rods_), 0.0);
  }
  for (const Group &group : groups_)
    if (group.packed)
      solveGroup<Pack>(group, b, x);
    else
      solveGroup<double>(group, b, x);
}

/// Of the right-hand sides in the workspace's rows makes solutions.
template <class T> void BandedFactor::substitute(const Group &group) {
  const RodRange &rod = dofs_.rods()[group.rod[0]];
  const std::vector<char> &held = held_[group.rod[0] - rods_.begin];
  const T *const vertex = as<T>(&workspace_.factors[group.factor]), *const records = vertex + vertex_record;
  T *const values = as<T>(workspace_.rows.data());
  if (group.reduced)
    withShape(rod, [&](auto shape) { substituteReduced<decltype(shape)>(rod.edges, held, vertex, records, values); });
  else if (rod.closed)
    substituteAll<T, true>(rod, held, records, vertex, values);
  else
    substituteAll<T, false>(rod, held, records, vertex, values);
}

template <class T> void BandedFactor::solveGroup(const Group &group, const PetscScalar *b, PetscScalar *x) {
  constexpr int step = sizeof(T) / sizeof(double);
  const RodRange &first = dofs_.rods()[group.rod[0]];
  const std::vector<char> &held = held_[group.rod[0] - rods_.begin];
  double *const values = workspace_.rows.data();
  const int coordinates = group.reduced && first.flat >= 0 ? 2 : 3; // reduced kernels want those that count first
  // Calls visit(value, unknown) for the unknowns and rest(value) for what is held or does not exist.
  auto eachValue = [&](auto visit, auto rest) {
    for (int l = 0; l < group.count; ++l) {
      const int r = group.rod[l];
      PetscInt u = dofs_.firstUnknown({r, r + 1}) - dofs_.firstUnknown(rods_);
      double *v = values + l;
      for (int i = 0; i < first.vertices; ++i) {
        for (int a = 0; a < coordinates; ++a)
          if (held[i] || (coordinates == 3 && a == first.flat))
            rest(v[a * step]);
          else
            visit(v[a * step], u++);
        if (first.twist && i < first.edges)
          visit(v[3 * step], u++);
        else
          rest(v[3 * step]);
        v += slot_size * step;
      }
    }
  };
  eachValue([&](double &value, PetscInt u) { value = b[u]; }, [](double &value) { value = 0; });
  substitute<T>(group);
  eachValue([&](const double &value, PetscInt u) { x[u] = value; }, [](double &) {});
}

namespace {

PetscErrorCode multiply(Mat a, Vec x, Vec y) {
  BandedSystem *system;
  PetscFunctionBegin;
  PetscCall(MatShellGetContext(a, &system));
  const DofMap &dofs = *system->dofs;
  Planes in = dofs.makePlanes(), out = dofs.makePlanes();
  PetscCall(dofs.scatter(x, system->rods, in));
  for (int r = system->rods.begin; r < system->rods.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    system->blocks->multiply(rod, dofs.joins(r), in, out);
    addMetric(*system->metric, system->edge_metric, rod, dofs.joins(r), (*system->shift)[r], in, out);
    dofs.fold(rod, out);
  }
  dofs.foldJoined(system->rods, out);
  PetscCall(dofs.gather(out, system->rods, y));
  PetscFunctionReturn(0);
}

} // namespace

PetscErrorCode createBandedMatrix(BandedSystem *system, Mat *matrix) {
  PetscFunctionBeginUser;
  const PetscInt n = system->dofs->unknowns(system->rods);
  PetscCall(MatCreateShell(PETSC_COMM_SELF, n, n, PETSC_DETERMINE, PETSC_DETERMINE, system, matrix));
  PetscCall(MatShellSetOperation(*matrix, MATOP_MULT, (void (*)(void))multiply));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

const BandedFactor *bandedFactorOf(Mat factored) { return FactorType<BandedFactor>::of(factored); }

PetscErrorCode registerBanded() { return FactorType<BandedFactor>::add(); }

PetscErrorCode BandedFactor::view(PetscViewer viewer) const {
  PetscFunctionBegin;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  %d rods, each by itself, up to %d of one shape at once\n",
                                   rods_.end - rods_.begin, int(lanes)));
  PetscFunctionReturn(0);
}

} // namespace tendril
