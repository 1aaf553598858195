#include "tendril/solver/residual.hpp"

#include "tendril/energy/load.hpp"

#include <limits>

namespace tendril {

using C = Configuration;

double edgeError(double reach, double edge) { return epsilon * (1 + epsilon * reach / edge); }

std::vector<RodScale> rodScales(const Scene &scene, const Elements &elements) {
  std::vector<RodScale> scales;
  for (std::size_t r = 0; r < elements.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    RodScale scale;
    scale.shortest_edge = HUGE_VAL;
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) {
      scale.length += elements.restLength()[s];
      scale.shortest_edge = std::min(scale.shortest_edge, elements.restLength()[s]);
      scale.longest_edge = std::max(scale.longest_edge, elements.restLength()[s]);
    }
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n)
      for (int k = 0; k < 3; ++k) scale.bending += elements.cells()[cell_stiffness + k][elements.cell_slot[n]];
    for (const int k : elements.constraintsOf(int(r)))
      (scene.constraints[k].isPin() ? scale.pinning : scale.turning) += scene.constraints[k].stiffness;
    scale.load = loadScale(scene, elements, int(r), scale.length);
    scales.push_back(scale);
  }
  for (const Constraint &c : scene.constraints)
    if (c.isTie()) scales[c.to_rod].pinning += c.stiffness;
  std::vector<int> rods_of(scene.bodies.size(), 0);
  auto each = [&](auto visit) {
    for (const Attachment &a : scene.attachments) visit(a.rod, a.body);
    for (const Constraint &c : scene.constraints)
      if (c.isToBody()) visit(c.rod, c.to_body);
  };
  each([&](int, int body) { ++rods_of[body]; });
  each([&](int rod, int body) { scales[rod].load += bodyLoad(scene, elements, body) / rods_of[body]; });
  return scales;
}

double forceScale(const Scene &scene, const Elements &elements, const Step &step, const State &start,
                  const RodScale &scale, int r) {
  if (scale.load > 0) return scale.load;
  const Material &m = scene.rods[r].material;
  const RodRange &rod = elements.rods[r];
  double softest = 1e-4 * m.axial_stiffness * scale.length * scale.length;
  if (!m.isCable())
    for (const double k : {m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness})
      if (k > 0) softest = std::min(softest, k);
  const double deforming = softest / (scale.length * scale.length);
  if (step.isStatic()) return deforming;
  double momentum = 0;
  for (int i = 0; i < rod.vertices; ++i)
    momentum += elements.mass()[rod.slot(i)] * start.velocity[rod.first_vertex + i].norm();
  return momentum > 0 ? std::min(deforming, momentum / step.dt) : deforming;
}

Residual residualOf(const Elements &elements, const Material &m, const Step &step, const AxialLaw &axial,
                    const Configuration &iterate, const Planes &out_of_balance, const RodScale &scale, double reach,
                    double steepness, int index) {
  const RodRange &rod = elements.rods[index];
  using std::abs;
  Pack forces(0.0), moments(0.0), tension(0.0), error(0.0);
  for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
    forces += read<Pack>(elements.freedom() + s) * readVector<Pack>(out_of_balance, 0, s).squaredNorm();
    const Pack g = read<Pack>(out_of_balance[3] + s);
    moments += g * g;
  }
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Pack::mask_type live = firstLanes(rod.edgeEnd() - s);
    const Pack force = read<Pack>(iterate[C::axial_force] + s),
               strain = read<Pack>(iterate[C::strain] + s) - read<Pack>(axial.rest() + s);
    tension = max(tension, select(live, Pack(abs(force)), Pack(0.0)));
    error = max(error, select(live, Pack(abs(strain - force / read<Pack>(axial.stiffness() + s))), Pack(0.0)));
  }
  double moment = reduce(moments);
  for (const JoinedEdge &j : elements.joinedEdges({index, index + 1}))
    moment += out_of_balance.vector(0, j.frame).squaredNorm();
  const double force = reduce(forces);
  // Edges carry errors of epsilon in their strains and directions, which the stiffnesses turn into forces and moments.
  const double strain_noise = edgeError(reach, scale.shortest_edge), count = std::sqrt(double(rod.vertices));
  const double bending = steepness *
                             std::max({m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness}) /
                             scale.shortest_edge +
                         scale.turning;
  const double unit = scale.force, stretching = step.mixed ? hmax(tension) : hmax(tension) + m.axial_stiffness;
  Residual result;
  result.force = std::sqrt(force) / unit;
  result.moment = std::sqrt(moment) / (unit * scale.length);
  result.compatibility = step.mixed ? hmax(error) : 0;
  // Inertia turns an error of position or twist into a force or a moment, which counts in short steps.
  const double inertia = step.isStatic() ? 0 : scale.longest_edge / (step.dt * step.dt),
               heavy = m.linear_density * scale.shortest_edge * inertia + scale.pinning * scale.shortest_edge,
               spinning = m.linear_rotational_inertia * inertia;
  result.force_floor =
      4 * count * strain_noise * (stretching + heavy + (m.isCable() ? 0 : bending / scale.shortest_edge)) / unit;
  if (!m.isCable()) result.moment_floor = 4 * count * strain_noise * (bending + spinning) / (unit * scale.length);
  result.compatibility_floor = 16 * strain_noise;
  return result;
}

double bodyLoad(const Scene &scene, const Elements &elements, int b) {
  const Body &body = scene.bodies[b];
  const MassProperties &all = elements.bodyMass(b);
  const double size = std::sqrt(all.inertia.trace() / all.mass);
  return (body.gravity ? all.mass * scene.gravity.norm() : 0) + body.force.norm() + body.torque.norm() / size;
}

void includeBody(const Elements &elements, const JoinedBody &body, const Step &step, const Configuration &start,
                 const Configuration &iterate, const Planes &out_of_balance, double unit, double load,
                 Residual *residual) {
  const MassProperties &all = elements.bodyMass(body.body);
  const double size = elements.bodySize(body.body);
  const double force = out_of_balance.vector(0, body.position).norm(),
               moment = out_of_balance.vector(0, body.rotation).norm(), by = load > 0 ? load : unit;
  residual->force = std::max(residual->force, force / by);
  residual->moment = std::max(residual->moment, moment / (by * size));
  if (step.isStatic()) return;
  const Vec3 moved = iterate.displacementAt(body.position, start);
  const double heavy = all.mass * (moved.norm() + 1e-16 * iterate.positionAt(body.position).norm()),
               turning = all.inertia.trace() * std::max(1.0, iterate.positionAt(body.rotation).norm()),
               rate = 16 * epsilon / (step.dt * step.dt);
  residual->force_floor = std::max(residual->force_floor, rate * heavy / by);
  residual->moment_floor = std::max(residual->moment_floor, rate * turning / (by * size));
}

void Residual::include(const Residual &other) {
  for (double Residual::*part : residual_parts)
    if (other.*part > this->*part || std::isnan(other.*part)) this->*part = other.*part;
}

} // namespace tendril
