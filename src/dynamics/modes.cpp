#include "tendril/dynamics/modes.hpp"

#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/circulatory.hpp"
#include "tendril/solver/mass.hpp"

#include <slepceps.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <deque>
#include <optional>

namespace tendril {

/// Of what goes as exp(i omega t): 0 of free ones.
static std::complex<double> angularFrequency(const Modes &modes, int k) {
  if (modes.isFree(k)) return 0;
  return std::sqrt(std::complex(modes.eigenvalue[std::size_t(k)], modes.imaginary[std::size_t(k)]));
}

double Modes::frequency(int k) const { return angularFrequency(*this, k).real(); }

double Modes::growthRate(int k) const { return std::abs(angularFrequency(*this, k).imag()); }

namespace {

using OwnedEPS = Owned<EPS, EPSDestroy>;

constexpr double residual_tolerance = 1e-10; // of eigenvectors: eigenvalues are right to its square over their distance
constexpr double free_part = 1e-10, stretch_part = 300 * epsilon; // of the shift; of EA/(rho L^2)
constexpr double complex_part = 1e-6; // of an eigenvalue: about the root of its error, by which two that are one split

/// SLEPc, which has no use for the command line, until PETSc ends.
PetscErrorCode startSlepc() {
  PetscBool started;
  PetscFunctionBeginUser;
  PetscCall(SlepcInitialized(&started));
  if (!started) PetscCall(SlepcInitializeNoArguments());
  if (!started) PetscCall(PetscRegisterFinalize(SlepcFinalize));
  PetscFunctionReturn(0);
}

/// The modes of one island, of which nothing moves others.
class IslandModes {
public:
  /// \param work right-hand sides and solutions of the block, which its islands share
  IslandModes(NewtonSolver &block, const IncrementalPotential &potential, RodSet island, Metric metric,
              std::array<Planes, 2> &work)
      : block_(block), potential_(potential), island_(island), metric_(metric), right_(work[0]), solution_(work[1]) {
    if (circulation_.emplace(potential, std::vector{island}, block.rods()); circulation_->isNone())
      circulation_.reset();
  }

  PetscErrorCode find(int count, std::string *failure);
  /// From the lowest on.
  std::vector<std::complex<double>> eigenvalues() const;
  PetscErrorCode shape(int k, Rates *out);
  double zero() const; ///< \see Modes

  // What SLEPc calls.
  PetscErrorCode applyMetric(Vec x, Vec y);
  PetscErrorCode applyInverse(Vec x, Vec y);

private:
  struct Mode {
    double eigenvalue, imaginary;
    OwnedVec vector;
  };
  NewtonSolver &block_;
  const IncrementalPotential &potential_;
  RodSet island_;
  Metric metric_;
  Planes &right_, &solution_;
  double shift_ = 0;                       ///< s = -shift_, below all eigenvalues [1/s^2]
  std::optional<Circulatory> circulation_; ///< where K is not symmetric
  bool singular_ = false;                  ///< K - s M
  std::vector<Mode> found_;

  PetscErrorCode setUp(EPS eps, Mat stiffness, Mat mass, int count);
  PetscErrorCode factorShifted();
  PetscErrorCode balance(Mode &first, Mode &second);
  PetscErrorCode countBelow(double value, int *count) { return block_.factorWith(metric_, island_, -value, count); }
  PetscErrorCode chooseShift(int count);
  PetscErrorCode search(int count);
  PetscErrorCode isComplete(int count, int *missing);
};

PetscErrorCode metricCallback(Mat m, Vec x, Vec y) {
  IslandModes *modes;
  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(m, &modes));
  PetscCall(modes->applyMetric(x, y));
  PetscFunctionReturn(0);
}

/// In place of K, which SLEPc multiplies by only to ask whether modes that it leaves out are in the null space of
/// K - s M: none is.
PetscErrorCode stiffnessCallback(Mat, Vec x, Vec y) { return VecCopy(x, y); }

PetscErrorCode inverseCallback(PC pc, Vec x, Vec y) {
  IslandModes *modes;
  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &modes));
  PetscCall(modes->applyInverse(x, y));
  PetscFunctionReturn(0);
}

PetscErrorCode IslandModes::applyMetric(Vec x, Vec y) {
  PetscFunctionBeginUser;
  PetscCall(potential_.dofs().scatter(x, island_, solution_));
  block_.multiplyMetric(metric_, island_, solution_, right_);
  PetscCall(potential_.dofs().gather(right_, island_, y));
  PetscFunctionReturn(0);
}

PetscErrorCode IslandModes::applyInverse(Vec x, Vec y) {
  PetscFunctionBeginUser;
  watch().beat();
  PetscCall(potential_.dofs().scatter(x, island_, right_));
  PetscCall(block_.solveLinear(right_, solution_));
  if (circulation_ && !circulation_->correct(solution_)) singular_ = true;
  PetscCall(potential_.dofs().gather(solution_, island_, y));
  PetscFunctionReturn(0);
}

/// Of about the size of the largest eigenvalue that is asked for, by the inertia: far below it, iterations are many and
/// digits of the upper ones are lost, far above it those of the lower ones. And below all eigenvalues.
PetscErrorCode IslandModes::chooseShift(int count) {
  constexpr int most = 60, most_down = 9; // beyond, as many motions cost nothing
  constexpr double factor = 16;
  PetscFunctionBeginUser;
  const double first = shift_ = block_.slowestBending(island_);
  int below;
  PetscCall(countBelow(shift_, &below));
  const bool goes_down = below >= count;
  for (int k = 0; k < most && below >= 0 && (below >= count) == goes_down; ++k) {
    const double next = goes_down ? shift_ / factor : shift_ * factor;
    PetscCall(countBelow(next, &below));
    if (!goes_down || below >= count) shift_ = next;
    if (goes_down && k == most_down) {
      shift_ = first;
      break;
    }
  }
  for (int k = 0; k < most; ++k) {
    PetscCall(countBelow(-shift_, &below));
    if (below == 0) break;
    shift_ *= factor;
  }
  PetscFunctionReturn(0);
}

/// K - s M, which applyInverse solves with.
PetscErrorCode IslandModes::factorShifted() {
  int negative;
  PetscFunctionBeginUser;
  PetscCall(countBelow(-shift_, &negative));
  if (circulation_)
    PetscCall(circulation_->update([this](const Planes &r, Planes &x) { return block_.solveLinear(r, x); }));
  PetscFunctionReturn(0);
}

PetscErrorCode IslandModes::setUp(EPS eps, Mat stiffness, Mat mass, int count) {
  ST st;
  KSP ksp;
  PC pc;
  PetscFunctionBeginUser;
  PetscCall(MatShellSetOperation(mass, MATOP_MULT, (void (*)(void))metricCallback));
  PetscCall(MatShellSetOperation(stiffness, MATOP_MULT, (void (*)(void))stiffnessCallback));
  PetscCall(EPSSetOperators(eps, stiffness, mass));
  PetscCall(EPSSetProblemType(eps, circulation_ ? EPS_GNHEP : EPS_GHEP));
  PetscCall(EPSGetST(eps, &st));
  PetscCall(STSetType(st, STSINVERT));
  PetscCall(STSetMatMode(st, ST_MATMODE_SHELL)); // the factor is ours, and no matrix is formed
  PetscCall(STSetShift(st, -shift_));
  PetscCall(STGetKSP(st, &ksp));
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, this));
  PetscCall(PCShellSetApply(pc, inverseCallback));
  PetscCall(EPSSetTarget(eps, -shift_));
  PetscCall(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  PetscCall(EPSSetDimensions(eps, count, PetscMin(potential_.dofs().unknowns(island_), 2 * count + 20), PETSC_DEFAULT));
  PetscCall(EPSSetTolerances(eps, residual_tolerance, 200));
  PetscFunctionReturn(0);
}

/// Of the vectors v and w of a pair of complex eigenvectors v +- i w, whose phase is free, makes those that are
/// orthogonal by the masses, the larger one first.
PetscErrorCode IslandModes::balance(Mode &first, Mode &second) {
  OwnedVec moved;
  PetscScalar vv, vw, ww;
  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(first.vector, moved.out()));
  PetscCall(applyMetric(first.vector, moved));
  PetscCall(VecDot(first.vector, moved, &vv));
  PetscCall(VecDot(second.vector, moved, &vw));
  PetscCall(applyMetric(second.vector, moved));
  PetscCall(VecDot(second.vector, moved, &ww));
  const double phase = 0.5 * std::atan2(2 * vw, vv - ww), size = 1 / std::sqrt(vv + ww);
  PetscCall(VecCopy(first.vector, moved)); // times exp(-i phase)
  PetscCall(VecScale(first.vector, size * std::cos(phase)));
  PetscCall(VecAXPY(first.vector, size * std::sin(phase), second.vector));
  PetscCall(VecScale(second.vector, size * std::cos(phase)));
  PetscCall(VecAXPY(second.vector, -size * std::sin(phase), moved));
  PetscFunctionReturn(0);
}

/// Adds so many of the lowest modes beside those that are known.
PetscErrorCode IslandModes::search(int count) {
  OwnedEPS eps;
  OwnedMat stiffness, mass;
  PetscFunctionBeginUser;
  const PetscInt n = potential_.dofs().unknowns(island_);
  PetscCall(factorShifted());
  for (OwnedMat *m : {&stiffness, &mass}) PetscCall(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, this, m->out()));
  PetscCall(EPSCreate(PETSC_COMM_SELF, eps.out()));
  PetscCall(setUp(eps, stiffness, mass, count));
  std::vector<Vec> known;
  for (const Mode &m : found_) known.push_back(m.vector);
  if (!known.empty()) PetscCall(EPSSetDeflationSpace(eps, PetscInt(known.size()), known.data()));
  PetscCall(EPSSolve(eps));
  PetscInt converged;
  PetscCall(EPSGetConverged(eps, &converged));
  if (singular_) PetscFunctionReturn(0);
  for (PetscInt k = 0; k < converged; ++k) {
    Mode mode, partner;
    for (Mode *m : {&mode, &partner}) PetscCall(MatCreateVecs(mass, m->vector.out(), nullptr));
    PetscCall(EPSGetEigenpair(eps, k, &mode.eigenvalue, &mode.imaginary, mode.vector, partner.vector));
    const bool pair = mode.imaginary != 0 && ++k < converged;
    if (std::abs(mode.imaginary) <= complex_part * (std::abs(mode.eigenvalue) + shift_)) mode.imaginary = 0;
    partner.eigenvalue = mode.eigenvalue;
    partner.imaginary = -mode.imaginary;
    if (mode.imaginary != 0) PetscCall(balance(mode, partner));
    found_.push_back(std::move(mode));
    if (pair) found_.push_back(std::move(partner));
  }
  std::stable_sort(found_.begin(), found_.end(),
                   [](const Mode &a, const Mode &b) { return a.eigenvalue < b.eigenvalue; });
  PetscFunctionReturn(0);
}

/// How many eigenvalues up to the last that is asked for are not among those found, by the inertia just above it.
PetscErrorCode IslandModes::isComplete(int count, int *missing) {
  PetscFunctionBeginUser;
  *missing = std::max(0, count - int(found_.size()));
  if (*missing > 0 || circulation_) PetscFunctionReturn(0);
  const double last = found_[std::size_t(count) - 1].eigenvalue;
  const bool is_free = std::abs(last) <= zero(); // it may be one of many, told apart by rounding
  for (const double gap : {1e-8, 1e-7, 1e-6}) {  // beside an eigenvalue the count is rounding
    const double above = is_free ? 1e8 * gap * zero() : last + gap * (last + shift_);
    int below;
    PetscCall(countBelow(above, &below));
    const auto known = std::count_if(found_.begin(), found_.end(), [&](const Mode &m) { return m.eigenvalue < above; });
    *missing = below - int(known);
    if (below >= 0 && *missing >= 0) break;
    *missing = 1;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode IslandModes::find(int count, std::string *failure) {
  constexpr int most_rounds = 8;
  PetscFunctionBeginUser;
  const int rank = metric_ == Metric::mass ? massRank(potential_, island_) : int(potential_.dofs().unknowns(island_));
  count = std::min(count, rank);
  if (count == 0) PetscFunctionReturn(0);
  PetscCall(chooseShift(count));
  int missing = count;
  for (int round = 0; round < most_rounds && missing > 0; ++round) {
    PetscCall(search(std::min(missing + 1, rank - int(found_.size())))); // one more: it may be as low as the last
    PetscCall(isComplete(count, &missing));
  }
  if (missing > 0)
    *failure = "of " + std::to_string(count) + " modes " + std::to_string(missing) + " could not be found" +
               (circulation_ ? ""
                             : ": the inertia of the factored matrix counts more eigenvalues below the last than "
                               "there are modes") +
               "; ask for another number of -modes, or take other -rod_edges";
  const std::size_t asked = std::size_t(count);
  const bool splits = asked < found_.size() && found_[asked - 1].imaginary > 0; // what flutters is two modes
  found_.resize(std::min(found_.size(), asked + (splits ? 1 : 0)));
  PetscFunctionReturn(0);
}

/// What Newton leaves of the balance of forces, and rounding of stiff edges, whose directions are off by an epsilon.
double IslandModes::zero() const {
  double stretch = 0;
  for (int r = island_.begin; r < island_.end; ++r) {
    const Material &m = potential_.scene().rods[std::size_t(r)].material;
    const double length = potential_.length(r);
    if (!m.isCable()) stretch = std::max(stretch, m.axial_stiffness / (m.linear_density * length * length));
  }
  return std::max(free_part * shift_, stretch_part * stretch);
}

std::vector<std::complex<double>> IslandModes::eigenvalues() const {
  std::vector<std::complex<double>> values;
  for (const Mode &m : found_) values.emplace_back(m.eigenvalue, m.imaginary);
  return values;
}

PetscErrorCode IslandModes::shape(int k, Rates *out) {
  const Elements &e = potential_.elements();
  PetscFunctionBeginUser;
  PetscCall(potential_.dofs().scatter(found_[std::size_t(k)].vector, island_, solution_));
  block_.multiplyMetric(metric_, island_, solution_, right_);
  out->vertex.assign(std::size_t(e.vertices()), Vec3::Zero());
  out->edge.assign(std::size_t(e.edges()), 0.0);
  out->body.assign(std::size_t(e.bodyCount()), BodyRate());
  double largest = 0, most_twisted = 0, length = 0;
  auto note = [&](const Vec3 &moved) {
    for (const double d : moved)
      if (std::abs(d) > std::abs(largest) * (1 + 1e-6)) largest = d;
    return moved;
  };
  for (int r = island_.begin; r < island_.end; ++r) {
    const RodRange &rod = e.rods[std::size_t(r)];
    for (int i = 0; i < rod.vertices; ++i)
      out->vertex[std::size_t(rod.first_vertex + i)] = note(solution_.vector(0, rod.slot(i)));
    for (int i = 0; i < rod.edges; ++i) {
      const double twist = out->edge[std::size_t(rod.first_edge + i)] = solution_[3][rod.slot(i)];
      if (std::abs(twist) > std::abs(most_twisted) * (1 + 1e-6)) most_twisted = twist;
    }
    length += e.length(r);
    for (const JoinedBody &b : e.bodies({r, r + 1}))
      out->body[std::size_t(b.body)] = {note(solution_.vector(0, b.position)), solution_.vector(0, b.rotation),
                                        Vec3::Zero()};
  }
  if (std::abs(largest) < 1e-6 * length * std::abs(most_twisted)) largest = most_twisted; // it only twists
  const bool flutters = found_[std::size_t(k)].imaginary != 0;                            // scaled with its partner
  const double size =
      flutters ? 1 : std::copysign(1 / std::sqrt(potential_.dofs().dot(island_, right_, solution_)), largest);
  for (Vec3 &v : out->vertex) v *= size;
  for (double &t : out->edge) t *= size;
  for (BodyRate &b : out->body) b = BodyRate().add(size, b);
  PetscFunctionReturn(0);
}

} // namespace

PetscErrorCode modesAtIterate(StepSolver &solver, Metric metric, int count, Modes *modes, std::string *failure) {
  PetscFunctionBeginUser;
  PetscCall(startSlepc());
  *modes = {};
  std::vector<IslandModes> islands;
  struct Place {
    std::complex<double> eigenvalue;
    std::size_t island;
    int number;
  };
  std::vector<Place> all;
  std::deque<std::array<Planes, 2>> work;
  for (NewtonSolver &block : solver.blocks()) {
    const Planes planes = solver.potential().dofs().makePlanes(block.rods());
    work.push_back({planes, planes});
    for (const RodSet island : block.islands()) {
      IslandModes &one = islands.emplace_back(block, solver.potential(), island, metric, work.back());
      PetscCall(one.find(count, failure));
      if (!failure->empty()) PetscFunctionReturn(0);
      const std::vector<std::complex<double>> values = one.eigenvalues();
      for (std::size_t k = 0; k < values.size(); ++k) all.push_back({values[k], islands.size() - 1, int(k)});
    }
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Place &a, const Place &b) { return a.eigenvalue.real() < b.eigenvalue.real(); });
  if (all.size() > std::size_t(count))
    all.resize(std::size_t(count) + (all[std::size_t(count) - 1].eigenvalue.imag() > 0));
  for (const Place &p : all) {
    modes->eigenvalue.push_back(p.eigenvalue.real());
    modes->imaginary.push_back(p.eigenvalue.imag());
    modes->zero.push_back(islands[p.island].zero());
    PetscCall(islands[p.island].shape(p.number, &modes->shape.emplace_back()));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode findModes(StepSolver &solver, const State &state, Step step, int count, Modes *modes,
                         std::string *failure) {
  PetscFunctionBeginUser;
  const Doing here([](std::ostream &out) { out << "natural frequencies are found"; });
  step.time = step.load_factor = state.time;
  step.small_motions = true;
  NewtonReport report;
  {
    const SharpTolerance sharp(solver);
    PetscCall(solver.solve(state, step, &report, Seek::equilibrium));
  }
  if (!report.converged) PetscCall(solver.begin(state, step)); // rounding leaves no better one
  PetscCall(modesAtIterate(solver, Metric::mass, count, modes, failure));
  PetscFunctionReturn(0);
}

} // namespace tendril
