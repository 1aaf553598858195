#include "tendril/solver/banded.hpp"

#include <petsc/private/matimpl.h>

#include <algorithm>
#include <limits>
#include <numeric>

namespace tendril {
namespace {

constexpr int half_band = band_width - 1;
/// Rows of a ring that meet its first: the unknowns of its last two slots.
constexpr int border = 2 * slot_size;

/// Numbers kept of a row: the inverse pivot, the couplings to the next ten, the diagonal before elimination. Padded for vector loads along a
/// row where the lanes are not rods.
template <class T> constexpr int width = sizeof(T) == sizeof(double) ? 16 : band_width + 1;
constexpr int diagonal_place = band_width;

template <class T> T *as(double *p) { return reinterpret_cast<T *>(p); }

/// Pivot of a row with its sign counted. What rounding has left of a diagonal is no pivot.
template <class T> T countedPivot(const T &d, const T &diagonal, T &negative, T &neutral) {
  using std::abs;
  const T scale = abs(diagonal);
  const auto lost = abs(d) <= T(16 * std::numeric_limits<double>::epsilon()) * scale;
  neutral += select(lost, T(1.0), T(0.0));
  negative += select(!lost && d < T(0.0), T(1.0), T(0.0));
  return select(lost, select(scale > T(0.0), T(1e-6) * scale, T(1.0)), d);
}

/// Eight couplings of one row.
typedef double Octet __attribute__((vector_size(64), aligned(8)));
Octet &octet(double *p) { return *reinterpret_cast<Octet *>(p); }

/// Subtracts from the rows below row j its share, r rows below: l[r] (row[r], row[r + 1], ...). The couplings of one rod lie in two registers and
/// are shifted there: shifted loads would wait for the stores before them.
template <int r = 1> inline void subtractBelow(double *row, const Octet &near, const Octet &far, const double *l) {
  if constexpr (r <= half_band) {
    double *below = row + r * width<double>;
    const Octet first = [&]<int... c>(std::integer_sequence<int, c...>) { return __builtin_shufflevector(near, far, std::min(c + r, 15)...); }(std::make_integer_sequence<int, 8>{});
    octet(below) -= l[r] * first;
    if constexpr (r < 3) {
      const Octet second = [&]<int... c>(std::integer_sequence<int, c...>) { return __builtin_shufflevector(far, Octet{}, (c + r)...); }(std::make_integer_sequence<int, 8>{});
      octet(below + 8) -= l[r] * second;
    }
    subtractBelow<r + 1>(row, near, far, l);
  }
}

/// Right-looking elimination: each row updates the ten below it, and for a ring the border.
/// \param far rows x border couplings beyond the band, or null
template <class T> void eliminate(T *band, T *far, int rows, T &negative, T &neutral) {
  constexpr int w = width<T>;
  const int first_border = rows - border;
  T u[band_width], l[band_width];
  for (int j = 0; j < rows; ++j) {
    T *row = band + std::size_t(j) * w;
    const T diagonal = row[diagonal_place];
    const T inverse = T(1.0) / countedPivot(row[0], diagonal, negative, neutral);
    for (int r = 1; r <= half_band; ++r) {
      u[r] = row[r];
      l[r] = u[r] * inverse;
    }
    if constexpr (std::is_same_v<T, double>) {
      const Octet near = octet(row), beyond = octet(row + 8);
      subtractBelow(row, near, Octet{beyond[0], beyond[1], beyond[2]}, l);
    } else
      for (int r = 1; r <= half_band; ++r)
        for (int c = 0; c <= half_band - r; ++c) row[r * w + c] -= l[r] * u[r + c];
    // Border rows beyond the band of row j: they meet the rows within it, and each other.
    for (int q = 0; far && q < border; ++q) {
      const int i = first_border + q;
      if (i - j <= half_band) continue;
      T *column = far + std::size_t(j) * border;
      const T lq = column[q] * inverse;
      for (int r = 1; r <= half_band && j + r < i; ++r) {
        const int k = j + r;
        if (i - k > half_band)
          far[std::size_t(k) * border + q] -= lq * u[r];
        else
          band[std::size_t(k) * w + (i - k)] -= lq * u[r];
      }
      for (int p = q; p < border; ++p) band[std::size_t(i) * w + (p - q)] -= lq * column[p];
      column[q] = lq;
    }
    row[0] = inverse;
    for (int r = 1; r <= half_band; ++r) row[r] = l[r];
  }
}

/// x = A^-1 x; ten rows before and behind the first and last of `band` and `x` are zero.
template <class T> void substitute(const T *band, const T *far, int rows, T *x) {
  constexpr int w = width<T>;
  const int first_border = rows - border;
  // The nearest neighbour last and alone: the rest of a sum does not wait for it.
  T last(0.0);
  for (int j = 0; j < rows; ++j) {
    const T *above = band + std::ptrdiff_t(j - half_band) * w;
    auto share = [&](int r) { return above[(half_band - r) * w + r] * x[j - r]; };
    const T even = (share(10) + share(8)) + (share(6) + (share(4) + share(2))), odd = (share(9) + share(7)) + (share(5) + share(3));
    T value = x[j] - (even + odd);
    if (far && j >= first_border)
      for (int k = 0; j - k > half_band; ++k) value -= far[std::size_t(k) * border + (j - first_border)] * x[k];
    last = value - above[(half_band - 1) * w + 1] * last;
    x[j] = last;
  }
  last = T(0.0);
  for (int j = rows - 1; j >= 0; --j) {
    const T *row = band + std::size_t(j) * w;
    auto share = [&](int r) { return row[r] * x[j + r]; };
    const T even = (share(10) + share(8)) + (share(6) + (share(4) + share(2))), odd = (share(9) + share(7)) + (share(5) + share(3));
    T value = x[j] * row[0] - (even + odd);
    for (int q = 0; far && q < border; ++q)
      if (first_border + q - j > half_band) value -= far[std::size_t(j) * border + q] * x[first_border + q];
    last = value - row[1] * last;
    x[j] = last;
  }
}

} // namespace

BandedFactor::BandedFactor(const DofMap &dofs, RodSet set, BandedRoom &room)
    : dofs_(dofs), rods_(set), order_(set.end - set.begin), fixed_(order_.size()), negative_(order_.size(), 0), neutral_(order_.size(), 0), room_(room) {
  const auto &rods = dofs.rods();
  auto shape = [&](int r) { return std::pair(rods[r].vertices, rods[r].closed); };
  std::iota(order_.begin(), order_.end(), set.begin);
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return shape(a) < shape(b); });
  for (int r = set.begin; r < set.end; ++r)
    for (int i = 0; i < rods[r].vertices; ++i)
      for (int a = 0; a < slot_size; ++a)
        if (dofs.unknown(rods[r].slot(i), a) < 0) fixed_[r - set.begin].push_back(slot_size * i + a);
  plan(nullptr); // no smaller set of rods needs more room
  std::size_t band = 0, far = 0, rows = 0;
  for (const Group &g : groups_) {
    const std::size_t n = std::size_t(slot_size) * rods[g.rod[0]].vertices + 2 * half_band;
    band = g.band + n * (g.packed ? width<Pack> * lanes : width<double>);
    far = std::max(far, g.far + n * border * (g.packed ? lanes : 1));
    rows = std::max(rows, n * (g.packed ? lanes : 1));
  }
  auto grow = [&](AlignedVector &v, std::size_t size) {
    if (v.size() < size) v.resize(size, 0.0);
    bytes_ += size * sizeof(double);
  };
  grow(room.band, band);
  grow(room.far, far);
  grow(room.rows, rows);
}

/// Groups of the wanted rods of each shape: whole packs; of the rest, a pack when that is cheaper than one after the other.
void BandedFactor::plan(const char *wanted) {
  constexpr int worth_a_pack = 3;
  const auto &rods = dofs_.rods();
  groups_.clear();
  std::size_t band = 0, far = 0;
  auto close = [&](Group group, bool packed) {
    const RodRange &rod = rods[group.rod[0]];
    const std::size_t n = std::size_t(slot_size) * rod.vertices + 2 * half_band;
    group.packed = packed;
    group.band = band;
    group.far = far;
    band += n * (packed ? width<Pack> * lanes : width<double>);
    if (rod.closed) far += n * border * (packed ? lanes : 1);
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
    if (wanted && !wanted[r]) continue;
    const RodRange &rod = rods[r];
    if (open.count == lanes || (open.count > 0 && (rods[open.rod[0]].vertices != rod.vertices || rods[open.rod[0]].closed != rod.closed))) flush();
    open.rod[open.count++] = r;
  }
  flush();
}

void BandedFactor::factor(const BandedSystem &system) {
  plan(system.wanted->data());
  for (const Group &group : groups_)
    if (group.packed)
      factorGroup<Pack>(group, system);
    else
      factorGroup<double>(group, system);
}

template <class T> void BandedFactor::factorGroup(const Group &group, const BandedSystem &system) {
  constexpr int w = width<T>, tile = 16;
  const RodRange &first = dofs_.rods()[group.rod[0]];
  const int n = first.vertices, rows = slot_size * n;
  T *band = as<T>(&room_.band[group.band]) + half_band * w;
  T *far = first.closed ? as<T>(&room_.far[group.far]) : nullptr;
  std::fill(band - half_band * w, band, T(0.0));
  std::fill(band + std::size_t(rows) * w, band + std::size_t(rows + half_band) * w, T(0.0));
  std::array<const double *, lanes> source{};
  for (int l = 0; l < (group.packed ? lanes : 1); ++l) source[l] = system.band->entry(dofs_.rods()[group.rod[l]], 0, 0);
  auto entry = [&](int a, int k, int i) {
    const std::size_t at = std::size_t(a * band_width + k) * first.slots + i;
    if constexpr (std::is_same_v<T, Pack>)
      return Pack([&](auto lane) { return source[lane][at]; });
    else
      return source[0][at];
  };
  for (int begin = 0; begin < n; begin += tile)
    for (int a = 0; a < slot_size; ++a)
      for (int k = 0; k < band_width; ++k)
        for (int i = begin; i < std::min(begin + tile, n); ++i) band[std::size_t(slot_size * i + a) * w + k] = entry(a, k, i);
  if (far) { // couplings of the last two slots to the first: beyond the band unless the ring is very small
    std::fill(far, far + std::size_t(rows) * border, T(0.0));
    for (int i = n - 2; i < n; ++i)
      for (int a = 0; a < slot_size; ++a)
        for (int k = std::max(0, rows - slot_size * i - a); k < band_width; ++k) {
          const int p = slot_size * i + a, q = p + k - rows;
          T &own = band[std::size_t(p) * w + k];
          if (p - q > half_band)
            far[std::size_t(q) * border + (p - (rows - border))] += own;
          else
            band[std::size_t(q) * w + (p - q)] += own;
          own = T(0.0);
        }
  }
  for (int l = 0; l < group.count; ++l) {
    const int r = group.rod[l];
    const RodRange &rod = dofs_.rods()[r];
    auto set = [&](T &value, double v) {
      if constexpr (std::is_same_v<T, Pack>)
        value[l] = v;
      else
        value = v;
    };
    if ((*system.shift)[r] != 0)
      for (int row = 0; row < rows; ++row) {
        T &d = band[std::size_t(row) * w];
        const double shift = (*system.shift)[r] * (*system.metric)[row % slot_size][rod.slot(row / slot_size)];
        if constexpr (std::is_same_v<T, Pack>)
          d[l] = d[l] + shift;
        else
          d += shift;
      }
    for (const int row : fixed_[r - rods_.begin]) {
      set(band[std::size_t(row) * w], 1);
      for (int k = 1; k <= half_band; ++k) {
        set(band[std::size_t(row) * w + k], 0);
        if (row >= k) set(band[std::size_t(row - k) * w + k], 0);
      }
      if (!far) continue;
      for (int q = 0; q < border; ++q) {
        set(far[std::size_t(row) * border + q], 0);
        if (row == rows - border + q)
          for (int j = 0; j < rows; ++j) set(far[std::size_t(j) * border + q], 0);
      }
    }
  }
  for (int row = 0; row < rows; ++row) band[std::size_t(row) * w + diagonal_place] = band[std::size_t(row) * w];
  T negative(0.0), neutral(0.0);
  eliminate(band, far, rows, negative, neutral);
  for (int l = 0; l < group.count; ++l)
    if constexpr (std::is_same_v<T, Pack>) {
      negative_[group.rod[l] - rods_.begin] = int(negative[l]);
      neutral_[group.rod[l] - rods_.begin] = int(neutral[l]);
    } else {
      negative_[group.rod[l] - rods_.begin] = int(negative);
      neutral_[group.rod[l] - rods_.begin] = int(neutral);
    }
}

void BandedFactor::solve(const PetscScalar *b, PetscScalar *x) {
  std::size_t solved = 0;
  for (const Group &group : groups_) solved += group.count;
  if (solved < order_.size()) {
    if (x == b) {
      room_.copy.assign(b, b + dofs_.unknowns(rods_));
      b = room_.copy.data();
    }
    std::fill_n(x, dofs_.unknowns(rods_), 0.0);
  }
  for (const Group &group : groups_)
    if (group.packed)
      solveGroup<Pack>(group, b, x);
    else
      solveGroup<double>(group, b, x);
}

template <class T> void BandedFactor::solveGroup(const Group &group, const PetscScalar *b, PetscScalar *x) {
  constexpr int step = sizeof(T) / sizeof(double);
  const RodRange &first = dofs_.rods()[group.rod[0]];
  const int rows = slot_size * first.vertices;
  const T *band = as<T>(&room_.band[group.band]) + half_band * width<T>;
  const T *far = first.closed ? as<T>(&room_.far[group.far]) : nullptr;
  double *values = room_.rows.data() + half_band * step;
  std::fill(values - half_band * step, values, 0.0);
  std::fill(values + std::size_t(rows) * step, values + std::size_t(rows + half_band) * step, 0.0);
  auto eachUnknown = [&](auto visit) {
    for (int l = 0; l < group.count; ++l) {
      const int r = group.rod[l];
      PetscInt u = dofs_.firstUnknown({r, r + 1}) - dofs_.firstUnknown(rods_);
      const std::vector<int> &fixed = fixed_[r - rods_.begin];
      for (std::size_t f = 0, row = 0; row < std::size_t(rows); ++row)
        if (f < fixed.size() && fixed[f] == int(row)) {
          values[row * step + l] = 0;
          ++f;
        } else
          visit(values[row * step + l], u++);
    }
  };
  eachUnknown([&](double &value, PetscInt u) { value = b[u]; });
  substitute<T>(band, far, rows, as<T>(values));
  eachUnknown([&](const double &value, PetscInt u) { x[u] = value; });
}

namespace {

constexpr const char *name = "banded";

BandedFactor *factorOf(Mat f) { return static_cast<BandedFactor *>(f->data); }

PetscErrorCode numeric(Mat f, Mat a, const MatFactorInfo *) {
  BandedSystem *system;
  PetscFunctionBegin;
  PetscCall(MatShellGetContext(a, &system));
  factorOf(f)->factor(*system);
  f->assembled = PETSC_TRUE;
  PetscFunctionReturn(0);
}

PetscErrorCode solveVec(Mat f, Vec b, Vec x) {
  const PetscScalar *right;
  PetscScalar *out;
  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(b, &right));
  PetscCall(VecGetArrayWrite(x, &out));
  factorOf(f)->solve(right, out);
  PetscCall(VecRestoreArrayWrite(x, &out));
  PetscCall(VecRestoreArrayRead(b, &right));
  PetscFunctionReturn(0);
}

PetscErrorCode inertia(Mat f, PetscInt *negative, PetscInt *zero, PetscInt *positive) {
  PetscInt minus = 0, none = 0;
  PetscFunctionBegin;
  for (int r = factorOf(f)->rods().begin; r < factorOf(f)->rods().end; ++r) {
    minus += factorOf(f)->negativePivots(r);
    none += factorOf(f)->neutralPivots(r);
  }
  if (negative) *negative = minus;
  if (zero) *zero = none;
  if (positive) *positive = f->rmap->n - minus - none;
  PetscFunctionReturn(0);
}

PetscErrorCode getInfo(Mat f, MatInfoType, MatInfo *info) {
  PetscFunctionBegin;
  *info = {};
  info->nz_used = info->nz_allocated = double(f->rmap->n) * band_width;
  info->memory = double(factorOf(f)->bytes());
  PetscFunctionReturn(0);
}

PetscErrorCode symbolic(Mat f, Mat, IS, const MatFactorInfo *) {
  PetscFunctionBegin;
  f->ops->choleskyfactornumeric = numeric;
  f->ops->solve = solveVec;
  f->ops->getinertia = inertia;
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(Mat f) {
  PetscFunctionBegin;
  delete factorOf(f);
  f->data = nullptr;
  PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", nullptr));
  PetscFunctionReturn(0);
}

PetscErrorCode solverType(Mat, MatSolverType *type) {
  PetscFunctionBegin;
  *type = name;
  PetscFunctionReturn(0);
}

PetscErrorCode create(Mat a, MatFactorType, Mat *out) {
  Mat f;
  BandedSystem *system;
  PetscFunctionBegin;
  PetscCall(MatShellGetContext(a, &system));
  PetscCall(MatCreate(PetscObjectComm((PetscObject)a), &f));
  PetscCall(MatSetSizes(f, a->rmap->n, a->cmap->n, a->rmap->N, a->cmap->N));
  PetscCall(PetscStrallocpy(name, &((PetscObject)f)->type_name));
  PetscCall(MatSetUp(f));
  f->data = new BandedFactor(*system->dofs, system->rods, *system->room);
  f->ops->choleskyfactorsymbolic = symbolic;
  f->ops->getinfo = getInfo;
  f->ops->destroy = destroy;
  PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", solverType));
  f->factortype = MAT_FACTOR_CHOLESKY;
  f->assembled = f->preallocated = PETSC_TRUE;
  PetscCall(PetscFree(f->solvertype));
  PetscCall(PetscStrallocpy(name, &f->solvertype));
  f->canuseordering = PETSC_FALSE;
  PetscCall(PetscStrallocpy(MATORDERINGEXTERNAL, (char **)&f->preferredordering[MAT_FACTOR_CHOLESKY]));
  *out = f;
  PetscFunctionReturn(0);
}

PetscErrorCode multiply(Mat a, Vec x, Vec y) {
  BandedSystem *system;
  PetscFunctionBegin;
  PetscCall(MatShellGetContext(a, &system));
  const DofMap &dofs = *system->dofs;
  Planes in = dofs.makePlanes(), out = dofs.makePlanes();
  PetscCall(dofs.scatter(x, system->rods, in));
  for (int r = system->rods.begin; r < system->rods.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    system->band->multiply(rod, in, out);
    dofs.fold(rod, out);
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int k = 0; k < slot_size; ++k) out[k][s] += (*system->shift)[r] * (*system->metric)[k][s] * in[k][s];
  }
  PetscCall(dofs.gather(out, system->rods, y));
  PetscFunctionReturn(0);
}

} // namespace

PetscErrorCode createBandedMatrix(BandedSystem *system, Mat *matrix) {
  PetscFunctionBeginUser;
  const PetscInt n = system->dofs->unknowns(system->rods);
  PetscCall(MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, system, matrix));
  PetscCall(MatShellSetOperation(*matrix, MATOP_MULT, (void (*)(void))multiply));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

const BandedFactor *bandedFactorOf(Mat factored) { return factored->ops->choleskyfactornumeric == numeric ? factorOf(factored) : nullptr; }

PetscErrorCode registerBanded() {
  PetscFunctionBeginUser;
  PetscCall(MatSolverTypeRegister(name, MATSHELL, MAT_FACTOR_CHOLESKY, create));
  PetscFunctionReturn(0);
}

} // namespace tendril
