/// bench_kernels: what the pieces of a Newton iteration cost, and what this machine could do at best.
///
/// Energy and derivatives of a bending and twisting cell, for both measures, one cell at a time (double) and several in
/// the lanes of a pack, with their operations counted; the machine's multiply-add rate and copy bandwidth; the
/// factorisation and solution of one rod's Hessian by the solver that tendril uses, and LAPACK's band solver at the
/// same size as the yardstick. An option of Google Benchmark chooses among them; those of PETSc
/// (-pc_factor_mat_solver_type mumps) act on the solver.
///
/// Sample runs:
///   bench_kernels
///   bench_kernels --benchmark_filter=derivatives
///   bench_kernels --benchmark_repetitions=5 --benchmark_out=kernels.json --benchmark_out_format=json
#include "bench.hpp"

#include "tendril/layout/launch.hpp"
#include "tendril/solver/events.hpp"

#include <benchmark/benchmark.h>
#include <petsc/private/petscimpl.h>

#include <memory>

namespace tendril::bench {
namespace {

/// A number that counts what is done with it, as the kernels are written; signs, comparisons and selections are not
/// counted.
struct Counted {
  double value = 0;
  static inline long simple = 0;    ///< additions, subtractions, multiplications
  static inline long divisions = 0; ///< and square roots
  static inline long functions = 0; ///< arc tangents

  Counted() = default;
  Counted(double v) : value(v) {}
  static Counted after(long &counter, double v) {
    ++counter;
    return {v};
  }
  Counted operator-() const { return {-value}; }
  friend Counted operator+(Counted a, Counted b) { return after(simple, a.value + b.value); }
  friend Counted operator-(Counted a, Counted b) { return after(simple, a.value - b.value); }
  friend Counted operator*(Counted a, Counted b) { return after(simple, a.value * b.value); }
  friend Counted operator/(Counted a, Counted b) { return after(divisions, a.value / b.value); }
  friend Counted &operator+=(Counted &a, Counted b) { return a = a + b; }
  friend Counted &operator-=(Counted &a, Counted b) { return a = a - b; }
  friend Counted &operator*=(Counted &a, Counted b) { return a = a * b; }
  friend Counted &operator/=(Counted &a, Counted b) { return a = a / b; }
  friend bool operator<(Counted a, Counted b) { return a.value < b.value; }
  friend bool operator>(Counted a, Counted b) { return a.value > b.value; }
};
Counted sqrt(Counted a) { return Counted::after(Counted::divisions, std::sqrt(a.value)); }
Counted atan(Counted a) { return Counted::after(Counted::functions, std::atan(a.value)); }
Counted atan2(Counted a, Counted b) { return Counted::after(Counted::functions, std::atan2(a.value, b.value)); }
Counted select(bool condition, Counted a, Counted b) { return condition ? a : b; }

} // namespace
} // namespace tendril::bench

template <> struct Eigen::NumTraits<tendril::bench::Counted> : Eigen::NumTraits<double> {
  using Real = tendril::bench::Counted;
  using NonInteger = tendril::bench::Counted;
  using Nested = tendril::bench::Counted;
};

namespace tendril::bench {
namespace {

template <class T> constexpr int lanes = 1;
template <> constexpr int lanes<Pack> = int(Pack::size());

enum class Kernel { energy, derivatives };

/// Arguments of a kernel, a different cell in each lane and each call.
template <class T> struct Cell {
  FrameOf<T> f0, f1;
  CellOf<T> constants;
};

/// T from a function of the lane.
template <class T, class Function> T fill(Function function) {
  if constexpr (lanes<T> == 1)
    return T(function(0));
  else
    return T([&](auto lane) { return function(int(lane)); });
}

/// Some cell of a bent and twisted rod: edges turn by up to 30 degrees, and twist by as much.
Cell<double> plainCell(int k) {
  const double turning = 0.25 + 0.25 * std::sin(1.3 * k), twist = 0.5 * std::sin(2.1 * k), roll = 0.7 * k;
  Cell<double> c;
  c.f0 = {Vec3::UnitX(), Vec3(0, std::cos(roll), std::sin(roll)), 1 + 0.1 * std::sin(0.9 * k)};
  c.f1.tangent = Vec3(std::cos(turning), std::sin(turning), 0);
  c.f1.director =
      rotateAbout<double>(transport<double>(c.f0.director, c.f0.tangent, c.f1.tangent), c.f1.tangent, twist);
  c.f1.length = 1 + 0.1 * std::cos(1.1 * k);
  c.constants = {{1, 1.5, 0.7}, {0.1, -0.1, 0.05}, 0, {0.5, 0.5}, {1, 1}, 0, 1};
  return c;
}

template <class T> Cell<T> cellOf(int first) {
  Cell<T> out;
  const auto copy = [&](auto member) { return fill<T>([&](int lane) { return member(plainCell(first + lane)); }); };
  for (int k = 0; k < 3; ++k) {
    out.f0.tangent[k] = copy([=](const Cell<double> &c) { return c.f0.tangent[k]; });
    out.f0.director[k] = copy([=](const Cell<double> &c) { return c.f0.director[k]; });
    out.f1.tangent[k] = copy([=](const Cell<double> &c) { return c.f1.tangent[k]; });
    out.f1.director[k] = copy([=](const Cell<double> &c) { return c.f1.director[k]; });
    out.constants.stiffness[k] = copy([=](const Cell<double> &c) { return c.constants.stiffness[k]; });
    out.constants.rest[k] = copy([=](const Cell<double> &c) { return c.constants.rest[k]; });
  }
  for (int k = 0; k < 2; ++k) {
    out.constants.weight[k] = copy([=](const Cell<double> &c) { return c.constants.weight[k]; });
    out.constants.free[k] = copy([=](const Cell<double> &c) { return c.constants.free[k]; });
  }
  out.f0.length = copy([](const Cell<double> &c) { return c.f0.length; });
  out.f1.length = copy([](const Cell<double> &c) { return c.f1.length; });
  out.constants.base = copy([](const Cell<double> &c) { return c.constants.base; });
  out.constants.winding = T(0.0);
  out.constants.sign = T(1.0);
  return out;
}

template <Kernel kernel, Measure measure, class T>
void call(const Cell<T> &cell, T &energy, CellDerivatives<T> &derivatives) {
  if constexpr (kernel == Kernel::energy)
    energy = cellEnergy<measure>(cell.f0, cell.f1, cell.constants);
  else
    cellDerivatives<measure>(cell.f0, cell.f1, cell.constants, derivatives);
}

template <Kernel kernel, Measure measure, class T> void cellKernel(benchmark::State &run) {
  constexpr int cells = 64; // arguments stay in the first-level cache
  std::vector<Cell<T>> cell;
  for (int k = 0; k < cells; k += lanes<T>) cell.push_back(cellOf<T>(k));
  T energy(0.0);
  CellDerivatives<T> derivatives;
  for (auto _ : run)
    for (const Cell<T> &c : cell) {
      call<kernel, measure, T>(c, energy, derivatives);
      benchmark::DoNotOptimize(&energy);
      benchmark::DoNotOptimize(&derivatives);
      benchmark::ClobberMemory();
    }
  Counted::simple = Counted::divisions = Counted::functions = 0;
  Counted counted_energy;
  CellDerivatives<Counted> counted_derivatives;
  call<kernel, measure, Counted>(cellOf<Counted>(1), counted_energy, counted_derivatives);
  const double done = double(run.iterations()) * cells;
  run.SetItemsProcessed(std::int64_t(done));
  run.counters["per_cell"] = benchmark::Counter(done, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  run.counters["flops"] = double(Counted::simple + Counted::divisions);
  run.counters["divisions"] = double(Counted::divisions);
  run.counters["functions"] = double(Counted::functions);
  run.counters["rate"] =
      benchmark::Counter(done * double(Counted::simple + Counted::divisions), benchmark::Counter::kIsRate);
  const std::size_t written = kernel == Kernel::energy ? sizeof(double) : sizeof(CellDerivatives<double>);
  run.counters["bytes"] = double(sizeof(Cell<double>) + written);
}

/// Multiply-adds that depend on nothing but their own accumulator; enough accumulators to hide the latency of two
/// units.
void multiplyAdd(benchmark::State &run) {
  constexpr int accumulators = 16, rounds = 64;
  std::array<Pack, accumulators> sum;
  sum.fill(Pack(1.0));
  Pack factor(0.5), term(0.25);
  benchmark::DoNotOptimize(factor);
  benchmark::DoNotOptimize(term);
  for (auto _ : run) {
    for (int r = 0; r < rounds; ++r)
      for (Pack &s : sum) s = s * factor + term; // contracted to one instruction
    benchmark::DoNotOptimize(sum);
  }
  run.counters["rate"] = benchmark::Counter(double(run.iterations()) * 2.0 * accumulators * rounds * lanes<Pack>,
                                            benchmark::Counter::kIsRate);
}

/// Bytes read and bytes written per second, from arrays larger than any cache.
void copyBandwidth(benchmark::State &run) {
  const std::size_t size = std::size_t(1) << 24; // 128 MB each
  std::vector<double> from(size, 1.0), to(size, 0.0);
  for (auto _ : run) {
    std::copy(from.begin(), from.end(), to.begin());
    benchmark::ClobberMemory();
  }
  run.SetBytesProcessed(std::int64_t(double(run.iterations()) * 2.0 * double(size) * sizeof(double)));
}

benchmark::Counter perEdge(const benchmark::State &run) {
  return {double(run.iterations()) * double(run.range(0)), benchmark::Counter::kIsRate | benchmark::Counter::kInvert};
}

void lapack(benchmark::State &run) {
  LapackBand band(int(run.range(0)));
  for (auto _ : run) {
    const double seconds = band.factorAndSolve();
    if (seconds < 0) {
      run.SkipWithError("dpbtrf failed");
      break;
    }
    run.SetIterationTime(seconds);
  }
  run.counters["per_edge"] = perEdge(run);
}

/// The Hessian of one straight rod at the beginning of a step, in the solver of the options.
class Factorisation {
public:
  PetscErrorCode setUp(int edges) {
    LoopSettings settings;
    settings.dt = 5e-3;
    PetscFunctionBeginUser;
    PetscCall(simulation_.setUp(cantilevers(1, edges), settings));
    PetscCall(
        simulation_.solver.rehearse(simulation_.state, TimeLoop::stepOf(settings, simulation_.state, settings.dt)));
    PetscCall(SNESGetKSP(simulation_.solver.snes(), &ksp_));
    PetscCall(KSPGetOperators(ksp_, nullptr, &matrix_));
    PetscCall(MatCreateVecs(matrix_, x_.out(), b_.out()));
    PetscCall(VecSet(b_, 1));
    PetscFunctionReturn(0);
  }
  PetscErrorCode factor() {
    PC pc;
    PetscFunctionBeginUser;
    PetscCall(PetscObjectStateIncrease((PetscObject)matrix_)); // as if its values were new
    PetscCall(KSPSetOperators(ksp_, matrix_, matrix_));
    PetscCall(KSPGetPC(ksp_, &pc));
    PetscCall(PCSetUp(pc));
    PetscFunctionReturn(0);
  }
  PetscErrorCode solve() {
    PetscFunctionBeginUser;
    PetscCall(KSPSolve(ksp_, b_, x_));
    PetscFunctionReturn(0);
  }

private:
  Simulation simulation_;
  KSP ksp_ = nullptr;
  Mat matrix_ = nullptr;
  OwnedVec x_, b_;
};

template <bool with_factor> void solver(benchmark::State &run) {
  Factorisation f;
  PetscErrorCode error = f.setUp(int(run.range(0)));
  for (auto _ : run) {
    if (with_factor && !error) error = f.factor();
    if (!error) error = f.solve();
    if (error) {
      run.SkipWithError("PETSc failed");
      break;
    }
  }
  run.counters["per_edge"] = perEdge(run);
}

template <Kernel kernel> void registerKernels(const std::string &name) {
  benchmark::RegisterBenchmark((name + "/tan/double").c_str(), cellKernel<kernel, Measure::tan, double>)->UseRealTime();
  benchmark::RegisterBenchmark((name + "/tan/pack").c_str(), cellKernel<kernel, Measure::tan, Pack>)->UseRealTime();
  benchmark::RegisterBenchmark((name + "/angle/double").c_str(), cellKernel<kernel, Measure::angle, double>)
      ->UseRealTime();
  benchmark::RegisterBenchmark((name + "/angle/pack").c_str(), cellKernel<kernel, Measure::angle, Pack>)->UseRealTime();
}

void registerAll() {
  registerKernels<Kernel::energy>("energy");
  registerKernels<Kernel::derivatives>("derivatives");
  benchmark::RegisterBenchmark("machine/multiply_add", multiplyAdd)->UseRealTime();
  benchmark::RegisterBenchmark("machine/copy", copyBandwidth)->UseRealTime()->Unit(benchmark::kMillisecond);
  const std::vector<std::int64_t> edges{100, 400, 1600, 100000};
  for (const std::int64_t n : edges)
    benchmark::RegisterBenchmark("lapack/factor_and_solve", lapack)
        ->Arg(n)
        ->UseManualTime()
        ->Unit(benchmark::kMicrosecond);
  for (const std::int64_t n : edges)
    benchmark::RegisterBenchmark("solver/factor_and_solve", solver<true>)
        ->Arg(n)
        ->UseRealTime()
        ->Unit(benchmark::kMicrosecond);
  for (const std::int64_t n : edges)
    benchmark::RegisterBenchmark("solver/solve", solver<false>)->Arg(n)->UseRealTime()->Unit(benchmark::kMicrosecond);
}

} // namespace
} // namespace tendril::bench

int main(int argc, char **argv) {
  benchmark::Initialize(&argc, argv); // takes its own options out
  tendril::prepareMpi();
  if (PetscInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  if (tendril::registerEvents() || tendril::registerSolvers()) return 1;
  tendril::bench::registerAll();
  benchmark::AddCustomContext("pack_lanes", std::to_string(tendril::Pack::size()));
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return PetscFinalize() ? 1 : 0;
}
