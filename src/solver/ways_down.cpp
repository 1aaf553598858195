/// Ways down from unstable equilibria: directions of negative curvature.
#include "tendril/solver/activity.hpp"
#include "tendril/solver/newton.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace tendril {

/// Directions of negative curvature of the rods with negative pivots, in work_->increment. With the Hessian K = E - G
/// split into the part E without compression and the effect G of compression, the largest eigenvalue of E^-1 G belongs
/// to the first buckling mode, the smoothest way out. Where compression is not the cause, or leaves motions without
/// stiffness, the shifted Hessian in place of E gives the lowest mode, beginning from the last shift.
class NewtonSolver::ModeSearch {
public:
  ModeSearch(NewtonSolver &solver, std::vector<char> &found, std::vector<char> &neutral);
  PetscErrorCode run();

private:
  enum class Way { buckling, shifted, shifted_anew };
  /// A motion v, A v and (A - K) v, with the Hessian K and a definite matrix A beside it.
  struct Probe {
    Planes motion, stiff, soft;
  };
  NewtonSolver &solver_;
  NewtonWork &work_;
  const DofMap &dofs_;
  std::vector<char> &found_, &neutral_;
  const std::vector<int> negative_;
  EdgeBlocks softening_;       ///< K at first, then E - K
  const double rounding_;      ///< of the energies that balance
  std::vector<double> before_; ///< -v'K v of the last iteration, per rod
  bool buckling_ = false;      ///< whether A is E
  bool definite_ = false;      ///< whether A is E, which holds every motion
  bool settled_ = false;       ///< what more iterations would not change
  bool done_ = false;

  PetscErrorCode factor(Way way, bool *possible);
  void soften(const Planes &v, Planes &y) const;
  PetscErrorCode iterate(int start);
  void improve(RodSet island, const Probe &w, Probe &x, Probe &p, int count) const;
  void judge(const Probe &w, int iteration);
  void keep(const Planes &motion);
};

/// Of the energies that balance, stiff edges leave 1e-7 by rounding; and what the forces are out of balance by, a
/// neutral motion is curved by.
NewtonSolver::ModeSearch::ModeSearch(NewtonSolver &solver, std::vector<char> &found, std::vector<char> &neutral)
    : solver_(solver), work_(*solver.work_), dofs_(solver.potential_->dofs()), found_(found), neutral_(neutral),
      negative_(work_.negative), softening_(solver.potential_->derivatives(solver.rods_).blocks),
      rounding_(std::clamp(10 * solver.report_.residual.force, 1e-7, 1e-5)) {
  found_.assign(work_.active.size(), false);
  neutral_.assign(work_.active.size(), false);
}

/// Factors A: what it is made of may turn out not to be definite.
PetscErrorCode NewtonSolver::ModeSearch::factor(Way way, bool *possible) {
  bool regular;
  PetscFunctionBeginUser;
  *possible = true;
  buckling_ = way == Way::buckling;
  solver_.potential_->assemble(solver_.rods_, buckling_ ? HessianKind::uncompressed : HessianKind::exact);
  if (buckling_) {
    PetscCall(solver_.refactor());
    PetscCall(solver_.readInertia(&regular));
    *possible = regular && solver_.report_.negative_pivots <= 0;
    if (!*possible) PetscFunctionReturn(0);
    softening_.subtractFrom(solver_.potential_->blocks());
  } else {
    solver_.fill(work_.indefinite, true);
    if (way == Way::shifted_anew) // the last shift, of an iterate far away, drowned the mode
      for (std::vector<double> *shift : {&work_.shift, &work_.last_shift}) solver_.fill(*shift, 0.0);
    PetscCall(solver_.shiftUntilPositive(false));
  }
  definite_ = buckling_ && solver_.report_.zero_pivots == 0;
  PetscFunctionReturn(0);
}

/// y = (A - K) v. With A v = b solved, v'K v = v'b - v'(A - K)v: the stiff part of A never enters, whose rounding would
/// hide a small curvature.
void NewtonSolver::ModeSearch::soften(const Planes &v, Planes &y) const {
  y.clear();
  for (int r = solver_.rods_.begin; r < solver_.rods_.end; ++r) {
    const RodRange &rod = dofs_.rods()[r];
    if (buckling_)
      softening_.multiply(rod, dofs_.joins(r), v, y);
    else
      addMetric(work_.metric, solver_.system_.edge_metric, rod, dofs_.joins(r), work_.shift[r], v, y);
    dofs_.fold(rod, y);
  }
  dofs_.foldJoined(solver_.rods_, y);
}

/// The combination of up to three probes with the largest quotient of v'(A - K)v and v'Av, island by island: a step of
/// locally optimal conjugate gradients (Knyazev 2001) from `x` along `w`, and what the last step moved by, `p`. `x` has
/// v'Av = 1 then.
void NewtonSolver::ModeSearch::improve(RodSet island, const Probe &w, Probe &x, Probe &p, int count) const {
  const std::array<const Probe *, 3> basis{&w, &x, &p};
  Eigen::MatrixXd stiff(3, 3), soft(3, 3);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j <= i; ++j) {
      stiff(i, j) = stiff(j, i) = dofs_.dot(island, basis[i]->motion, basis[j]->stiff);
      soft(i, j) = soft(j, i) = dofs_.dot(island, basis[i]->motion, basis[j]->soft);
    }
  Eigen::Vector3d share = Eigen::Vector3d::Zero();
  for (bool independent = false; count > 0 && !independent;
       --count) { // what is almost a combination of the others is left out
    const Eigen::VectorXd scale = stiff.diagonal().head(count).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd a = scale.asDiagonal() * stiff.topLeftCorner(count, count) * scale.asDiagonal();
    independent = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues()[0] > 1e-10;
    if (!independent) continue;
    const Eigen::MatrixXd b = scale.asDiagonal() * soft.topLeftCorner(count, count) * scale.asDiagonal();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(b, a);
    share.head(count) = scale.cwiseProduct(ritz.eigenvectors().col(count - 1));
  }
  auto combine = [&](Planes Probe::*part) {
    for (int r = island.begin; r < island.end; ++r) {
      const RodRange &rod = dofs_.rods()[r];
      for (int a = 0; a < slot_size; ++a) {
        const double *along = (w.*part)[a];
        double *here = (x.*part)[a], *last = (p.*part)[a];
        auto combined = [&](int s) {
          last[s] = share[0] * along[s] + share[2] * last[s];
          here[s] = share[1] * here[s] + last[s];
        };
        for (int s = rod.first_slot; s < rod.vertexEnd() + 2; ++s) combined(s);
        if (a < 3) dofs_.forBeside({r, r + 1}, combined);
      }
    }
  };
  for (Planes Probe::*part : {&Probe::motion, &Probe::stiff, &Probe::soft}) combine(part);
}

/// Tells of every rod whether the motion goes down, costs nothing, or is still to be improved.
void NewtonSolver::ModeSearch::judge(const Probe &w, int iteration) {
  constexpr int enough = 5; // iterations for a mode that is not close to another
  done_ = settled_ = true;
  bool told = true; // of every rod, whether there is a way down
  for (const RodSet island : solver_.islands_) {
    const int r = island.begin;
    if (negative_[r] == 0) continue;
    const double stiffness = dofs_.dot(island, w.motion, w.stiff), softness = dofs_.dot(island, w.motion, w.soft);
    double noise = rounding_ * std::abs(stiffness);
    for (int each = r; each < island.end; ++each) noise += solver_.hessianNoise(each, w.motion);
    const double change = softness - stiffness - before_[r];
    before_[r] = softness - stiffness;
    fill(found_, island, iteration >= enough && softness - stiffness > noise);
    // Compression that makes up for no mode's stiffness leaves a definite Hessian: its negative pivots are rounding.
    fill(neutral_, island, std::abs(softness - stiffness) <= noise || (definite_ && !(softness > 0.5 * stiffness)));
    settled_ = settled_ && (found_[r] || (iteration >= enough && std::abs(change) < 1e-3 * noise));
    done_ = done_ && found_[r];
    told = told && (found_[r] || neutral_[r]);
  }
  done_ = done_ || (settled_ && told);
}

/// Takes a motion over for the direction to go.
void NewtonSolver::ModeSearch::keep(const Planes &motion) {
  for (int r = solver_.rods_.begin; r < solver_.rods_.end; ++r) {
    const RodRange &rod = dofs_.rods()[r];
    for (int a = 0; a < slot_size; ++a)
      std::copy(motion[a] + rod.first_slot, motion[a] + rod.vertexEnd() + 2, work_.increment[a] + rod.first_slot);
    dofs_.forBeside({r, r + 1}, [&](int s) { work_.increment.setVector(0, s, motion.vector(0, s)); });
  }
}

/// \param start which of the two that beginMode has: the first by inverse iteration, whose modes are smooth
PetscErrorCode NewtonSolver::ModeSearch::iterate(int start) {
  constexpr int most = 100;
  PetscFunctionBeginUser;
  const Planes workspace = dofs_.makePlanes(solver_.rods_);
  Probe w{workspace, workspace, workspace}, x = w, p = w;
  solver_.beginMode(start);
  soften(work_.increment, x.soft);
  before_.assign(neutral_.size(), HUGE_VAL);
  settled_ = false;
  for (int k = 0; k < most && !settled_; ++k) {
    for (std::size_t n = 0; n < solver_.islands_.size() && k > 0; ++n)
      if (negative_[solver_.islands_[n].begin] > 0)
        improve(solver_.islands_[n], w, x, p, start == 0 ? 1 : std::min(k, 3));
    watch().beat();
    w.stiff = x.soft;
    PetscCall(solver_.solveLinear(w.stiff, w.motion));
    soften(w.motion, w.soft);
    judge(w, k);
  }
  keep(w.motion);
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::ModeSearch::run() {
  PetscFunctionBeginUser;
  for (const Way way : {Way::buckling, Way::shifted, Way::shifted_anew}) {
    if (done_) break;
    bool possible;
    PetscCall(factor(way, &possible));
    if (!possible) continue;
    settled_ = false;
    for (int start = 0; start < 2 && !done_ && (start == 0 || settled_ || definite_); ++start)
      PetscCall(iterate(start));
    done_ = done_ || definite_ || (settled_ && !buckling_);
  }
  PetscFunctionReturn(0);
}

/// See ModeSearch. `neutral`: rods whose mode costs no energy, to rounding, and that nothing goes down from: a turn of
/// the whole rod about an axis, say.
PetscErrorCode NewtonSolver::findBucklingModes(std::vector<char> *found, std::vector<char> *neutral) {
  PetscFunctionBeginUser;
  PetscCall(ModeSearch(*this, *found, *neutral).run());
  potential_->assemble(rods_, potential_->step().hessian);
  PetscFunctionReturn(0);
}

} // namespace tendril
