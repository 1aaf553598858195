#include "tendril/dynamics/incremental_potential.hpp"

#include "tendril/energy/edge.hpp"

#include <algorithm>
#include <limits>

namespace tendril {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Loads on each rod [N]: its weight and the forces and couples on it.
std::vector<double> loads(const Scene &scene, const std::vector<double> &length) {
  std::vector<double> load;
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    double s = rod.gravity ? rod.material.linear_density * length[r] * scene.gravity.norm() : 0;
    for (const NodalForce &f : scene.forces)
      if (f.rod == int(r)) s += f.force.norm();
    for (const EdgeMoment &c : scene.moments)
      if (c.rod == int(r)) s += (std::abs(c.torque) + c.moment.norm()) / length[r];
    load.push_back(s);
  }
  return load;
}

} // namespace

IncrementalPotential::IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic)
    : retraction(elements, dofs), scene_(scene), dofs_(dofs), elements_(elements), terms_(makeTerms(scene, elements, axial_, dynamic)) {
  rows_.gradient.resize(dofs.rows());
  rows_.equilibrium.resize(dofs.rows());
  rows_.band.resize(std::size_t(dofs.rows()) * DofMap::band);
  for (const RodRange &rod : elements.rods) {
    double sum = 0;
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) sum += elements.rest_length[i];
    length_.push_back(sum);
  }
  load_ = loads(scene, length_);
}

void IncrementalPotential::beginStep(const State &start, const Step &step) {
  start_ = start;
  step_ = step;
  iterate_ = configurationOf(start, scene_, elements_, start.time);
  axial_.beginStep(scene_, elements_, iterate_, step_);
  start_frame_.assign(iterate_.frame.begin(), iterate_.frame.begin() + dofs_.edges());
  for (auto &term : terms_) term->beginStep(start_, iterate_, step_);
  turnSupports();
  setForceScales();
  retraction.setInverseTimeSquared(step.isStatic() ? 0 : 1 / (step.dt * step.dt));
  current_ = false;
}

/// The force that measures each rod's residual: its loads. A rod without any is measured by the force that deforms it,
/// the smallest of EI/L^2, GJ/L^2 and 1e-4 EA, or, where that is smaller, by the force that would stop it within the step.
void IncrementalPotential::setForceScales() {
  force_scale_ = load_;
  for (std::size_t r = 0; r < load_.size(); ++r) {
    if (load_[r] > 0) continue;
    const Material &m = scene_.rods[r].material;
    const RodRange &rod = elements_.rods[r];
    double softest = 1e-4 * m.axial_stiffness * length_[r] * length_[r];
    if (!m.isCable())
      for (const double k : {m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness})
        if (k > 0) softest = std::min(softest, k);
    force_scale_[r] = softest / (length_[r] * length_[r]);
    if (step_.isStatic()) continue;
    double momentum = 0;
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) momentum += elements_.mass[v] * start_.velocity[v].norm();
    if (momentum > 0) force_scale_[r] = std::min(force_scale_[r], momentum / step_.dt);
  }
}

/// Supports' frames to the end of the step; whole turns of the twist angles follow.
void IncrementalPotential::turnSupports() {
  beyond_barrier_ = false;
  std::vector<double> turned(elements_.frames - dofs_.edges(), 0.0);
  bool any = false;
  for (std::size_t s = 0; s < scene_.supports.size(); ++s) {
    const int frame = elements_.support_frame[s];
    if (frame < 0 || !scene_.supports[s].motion.moves()) continue;
    const Motion &motion = scene_.supports[s].motion;
    // In parts of less than half a radian, so that whole turns within the step are counted.
    const int parts = 1 + int(2 * (motion.rotationVectorAt(step_.time) - motion.rotationVectorAt(start_.time)).norm());
    for (int k = 1; k <= parts; ++k) {
      const double time = k == parts ? step_.time : start_.time + (step_.time - start_.time) * k / parts;
      const Frame now = supportFrame(scene_.supports[s], time);
      turned[frame - dofs_.edges()] += halfAngleBetween(iterate_.frame[frame], now).angle();
      iterate_.frame[frame] = now;
    }
    any = true;
  }
  if (!any) return;
  const CellArrays &cells = elements_.cells;
  auto turning = [&](int frame) { return frame < dofs_.edges() ? 0.0 : turned[frame - dofs_.edges()]; };
  for (int c = 0; c < cells.size(); ++c) {
    const double expected = iterate_.twist[c] + turning(cells.frame1[c]) - turning(cells.frame0[c]);
    const double principal = halfAngleBetween(iterate_.frame[cells.frame0[c]], iterate_.frame[cells.frame1[c]]).angle();
    iterate_.turns[c] = 2 * pi * std::round((expected - principal) / (2 * pi));
    iterate_.twist[c] = principal + iterate_.turns[c];
  }
  for (std::size_t r = 0; r < elements_.rods.size(); ++r)
    if (elements_.measure[r] == Measure::tan)
      for (int c = elements_.rod_cells[r]; c < elements_.rod_cells[r + 1]; ++c) beyond_barrier_ = beyond_barrier_ || iterate_.turns[c] != 0;
}

bool IncrementalPotential::remainingMotion(std::vector<double> &increment) const {
  increment.assign(dofs_.rows(), 0.0);
  bool any = false;
  for (const Support &s : scene_.supports) {
    if (!s.holdsPosition() || !s.motion.moves()) continue;
    const RodRange &rod = elements_.rods[s.rod];
    const int v = rod.first_vertex + s.vertex;
    const Vec3 target = scene_.rods[s.rod].position[s.vertex] + s.motion.displacementAt(step_.time);
    const Vec3 d = target - iterate_.position[v];
    if (d.norm() <= 4 * epsilon * target.norm()) continue;
    any = true;
    for (int a = 0; a < 3; ++a) increment[elements_.vertex_row[v] + a] = d[a];
    if (rod.closed && s.vertex <= 1)
      for (int a = 0; a < 3; ++a) increment[rod.first_row + rod.rows + rod.stride * s.vertex + a] = d[a];
  }
  return any;
}

void IncrementalPotential::energies(const Configuration &configuration, std::vector<double> &energy) const {
  energy.resize(elements_.rods.size());
  for (std::size_t r = 0; r < elements_.rods.size(); ++r) {
    double sum = 0;
    for (const auto &term : terms_) sum += term->energy(configuration, int(r));
    energy[r] = std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
  }
}

double IncrementalPotential::energy(const Configuration &configuration) const {
  std::vector<double> energy;
  energies(configuration, energy);
  double sum = 0;
  for (const double e : energy) sum += e;
  return sum;
}

/// How much stiffer than at rest the steepest cell of a rod is: near 180 degrees of fold or twist the measure `tan` grows without bound, with the
/// square of its slope 1/cos^2 of half the angle, and so does what rounding leaves in forces.
double IncrementalPotential::steepnessOf(const Configuration &c, int r) const {
  if (elements_.measure[r] != Measure::tan) return 1;
  double flattest = 1;
  for (int n = elements_.rod_cells[r]; n < elements_.rod_cells[r + 1]; ++n) {
    const double turning = 0.5 * (1 + c.frame[elements_.cells.frame0[n]].tangent.dot(c.frame[elements_.cells.frame1[n]].tangent)); // cos^2 of half
    flattest = std::min({flattest, turning, 0.5 * (1 + std::cos(c.twist[n]))});
  }
  return 1 / std::max(flattest * flattest, epsilon);
}

/// Coordinates carry an error of epsilon x reach, which is a strain of delta = epsilon reach / h in an edge of length h and an angle as large in
/// a cell: each costs (force + stiffness delta) delta of energy. On top of it comes the rounding of the sums.
double IncrementalPotential::energyNoise(const Configuration &configuration) const {
  double noise = 0;
  for (std::size_t r = 0; r < elements_.rods.size(); ++r) {
    const RodRange &rod = elements_.rods[r];
    double reach = 0;
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) reach = std::max(reach, configuration.position[v].cwiseAbs().maxCoeff());
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const double delta = epsilon * reach * elements_.inverse_rest_length[i];
      const double force = axial_.stiffness[i] * std::abs(configuration.strain[i] - axial_.rest[i]);
      noise += (force + axial_.stiffness[i] * delta) * delta * elements_.rest_length[i];
    }
    double bending = 0, delta = 0;
    const double steepness = steepnessOf(configuration, int(r));
    for (int c = elements_.rod_cells[r]; c < elements_.rod_cells[r + 1]; ++c) {
      delta = std::max(delta, 4 * epsilon * reach / elements_.cells.length[c]); // edge, length, tangent and binormal each round
      bending += elements_.cells.stiffness[0][c] + elements_.cells.stiffness[1][c] + elements_.cells.stiffness[2][c];
    }
    for (const auto &term : terms_) {
      const double energy = std::abs(term->energy(configuration, int(r)));
      noise += 64 * epsilon * energy + delta * (std::sqrt(2 * energy * bending * steepness) + bending * steepness * delta);
    }
  }
  return noise;
}

const Rows &IncrementalPotential::derivatives() {
  if (current_) return rows_;
  std::fill(rows_.gradient.begin(), rows_.gradient.end(), 0.0);
  std::fill(rows_.band.begin(), rows_.band.end(), 0.0);
  // Stretch is the first term and adds to both residuals; what the others add is the same for both.
  std::fill(rows_.equilibrium.begin(), rows_.equilibrium.end(), 0.0);
  for (std::size_t r = 0; r < elements_.rods.size(); ++r) terms_[0]->addDerivatives(iterate_, int(r), rows_, step_.hessian);
  for (std::size_t k = 0; k < rows_.gradient.size(); ++k) rows_.equilibrium[k] -= rows_.gradient[k];
  for (std::size_t t = 1; t < terms_.size(); ++t)
    for (std::size_t r = 0; r < elements_.rods.size(); ++r) terms_[t]->addDerivatives(iterate_, int(r), rows_, step_.hessian);
  for (std::size_t k = 0; k < rows_.gradient.size(); ++k) rows_.equilibrium[k] += rows_.gradient[k];
  current_ = true;
  return rows_;
}

const std::vector<double> &IncrementalPotential::bandWithoutCompression() {
  uncompressed_.gradient.assign(rows_.gradient.size(), 0.0);
  uncompressed_.equilibrium.assign(rows_.gradient.size(), 0.0);
  uncompressed_.band.assign(rows_.band.size(), 0.0);
  for (const auto &term : terms_)
    for (std::size_t r = 0; r < elements_.rods.size(); ++r) term->addDerivatives(iterate_, int(r), uncompressed_, step_.hessian == HessianKind::exact ? HessianKind::uncompressed : step_.hessian);
  return uncompressed_.band;
}

void IncrementalPotential::resetAxialForces() {
  for (std::size_t i = 0; i < iterate_.axial_force.size(); ++i) iterate_.axial_force[i] = axial_.stiffness[i] * (iterate_.strain[i] - axial_.rest[i]);
  current_ = false;
}

bool IncrementalPotential::tryMove(const std::vector<double> &increment, double scale, Configuration &trial) {
  trial.position.resize(iterate_.position.size());
  trial.frame = iterate_.frame;
  trial.strain.resize(iterate_.strain.size());
  trial.spin.resize(iterate_.spin.size());
  trial.turns = iterate_.turns;
  trial.twist = iterate_.twist;
  trial.axial_force.resize(iterate_.axial_force.size());
  for (std::size_t r = 0; r < elements_.rods.size(); ++r) {
    if (!retraction.apply(iterate_, increment, scale, int(r), trial)) return false;
    const RodRange &rod = elements_.rods[r];
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const Frame &f = iterate_.frame[i];
      const double inverse = elements_.inverse_rest_length[i];
      if (!step_.mixed) {
        trial.axial_force[i] = axial_.stiffness[i] * (trial.strain[i] - axial_.rest[i]);
        continue;
      }
      // dS = k (B d + c): the force the linearised strain asks for.
      const int row = elements_.edge_row[i];
      const Vec3 de = Eigen::Map<const Vec3>(&increment[row + rod.stride]) - Eigen::Map<const Vec3>(&increment[row]);
      const double change = f.length * f.tangent.dot(de) - (retraction.continues ? 0.5 * de.squaredNorm() : 0.0);
      const double strain = iterate_.strain[i] + change * inverse * inverse;
      trial.axial_force[i] = iterate_.axial_force[i] + scale * (axial_.stiffness[i] * (strain - axial_.rest[i]) - iterate_.axial_force[i]);
    }
  }
  return true;
}

void IncrementalPotential::accept(Configuration &trial) {
  std::swap(iterate_, trial);
  for (auto &term : terms_) term->moveIterate(iterate_);
  current_ = false;
}

void IncrementalPotential::coordinates(std::vector<double> &x) const {
  x.assign(dofs_.rows(), 0.0);
  for (const RodRange &rod : elements_.rods)
    for (int v = 0; v < rod.vertices; ++v) {
      const int row = dofs_.vertexRow(rod, v);
      const Vec3 d = iterate_.position[rod.first_vertex + v] - start_.position[rod.first_vertex + v];
      for (int a = 0; a < 3; ++a) x[row + a] = d[a];
      if (rod.stride == 4 && v < rod.edges) x[row + 3] = iterate_.spin[rod.first_edge + v];
    }
}

void IncrementalPotential::moveTo(const std::vector<double> &x) {
  std::vector<double> increment;
  coordinates(increment);
  const auto &unknown = dofs_.unknownOfRow();
  for (std::size_t k = 0; k < increment.size(); ++k) increment[k] = unknown[k] >= 0 ? x[k] - increment[k] : 0.0;
  for (const RodRange &rod : elements_.rods)
    if (rod.closed) std::copy_n(&increment[rod.first_row], rod.stride + 3, &increment[rod.first_row + rod.rows]);
  if (std::all_of(increment.begin(), increment.end(), [](double v) { return v == 0; })) return;
  const RetractionKind kind = std::exchange(retraction.kind, RetractionKind::additive);
  Configuration trial;
  if (tryMove(increment, 1.0, trial)) accept(trial);
  retraction.kind = kind;
}

IncrementalPotential::Residual IncrementalPotential::residual() {
  const Rows &rows = derivatives();
  const auto &unknown = dofs_.unknownOfRow();
  Residual result;
  for (std::size_t r = 0; r < elements_.rods.size(); ++r) {
    const RodRange &rod = elements_.rods[r];
    const Material &m = scene_.rods[r].material;
    double force = 0, moment = 0, reach = 0, tension = 0, shortest = length_[r];
    for (int v = 0; v < rod.vertices; ++v) {
      const int row = dofs_.vertexRow(rod, v);
      for (int a = 0; a < 3; ++a) {
        if (unknown[row + a] < 0) continue;
        double g = rows.equilibrium[row + a];
        if (rod.closed && v <= 1) g += rows.equilibrium[row + rod.rows + a];
        force += g * g;
      }
      reach = std::max(reach, iterate_.position[rod.first_vertex + v].cwiseAbs().maxCoeff());
    }
    for (int i = 0; i < rod.edges; ++i) {
      const int e = rod.first_edge + i, row = elements_.edge_row[e];
      if (rod.stride == 4) {
        double g = rows.equilibrium[row + 3];
        if (rod.closed && i == 0) g += rows.equilibrium[row + rod.rows + 3];
        moment += g * g;
      }
      tension = std::max(tension, std::abs(iterate_.axial_force[e]));
      shortest = std::min(shortest, elements_.rest_length[e]);
      const double strain = iterate_.strain[e] - axial_.rest[e];
      if (step_.mixed) result.compatibility = std::max(result.compatibility, std::abs(strain - iterate_.axial_force[e] / axial_.stiffness[e]));
    }
    // Coordinates carry an error of epsilon x reach: strains of epsilon reach/h, which the stiffnesses turn into forces and moments.
    const double strain_noise = epsilon * reach / shortest, count = std::sqrt(double(rod.vertices));
    const double bending = steepnessOf(iterate_, int(r)) * std::max({m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness}) / shortest;
    const double scale = force_scale_[r], stretching = step_.mixed ? tension : tension + m.axial_stiffness;
    result.force = std::max(result.force, std::sqrt(force) / scale);
    result.moment = std::max(result.moment, std::sqrt(moment) / (scale * length_[r]));
    result.force_floor = std::max(result.force_floor, 4 * count * strain_noise * (stretching + (m.isCable() ? 0 : bending / shortest)) / scale);
    if (!m.isCable()) result.moment_floor = std::max(result.moment_floor, 4 * count * strain_noise * bending / (scale * length_[r]));
    result.compatibility_floor = std::max(result.compatibility_floor, 16 * strain_noise);
  }
  return result;
}

void IncrementalPotential::commit(State &state) const {
  state.time = step_.time;
  ++state.step;
  state.position = iterate_.position;
  state.axial_force = iterate_.axial_force;
  state.turns = iterate_.turns;
  for (int i = 0; i < dofs_.edges(); ++i) {
    state.director[i] = orthonormalised(iterate_.frame[i].director, iterate_.frame[i].tangent);
    if (step_.isStatic()) continue;
    const double principal = twistIncrement(start_frame_[i], iterate_.frame[i]);
    state.twist_rate[i] = (principal + 2 * pi * std::round((iterate_.spin[i] - principal) / (2 * pi))) / step_.dt;
  }
  if (!step_.isStatic())
    for (std::size_t v = 0; v < state.position.size(); ++v) state.velocity[v] = (iterate_.position[v] - start_.position[v]) / step_.dt;
}

} // namespace tendril
