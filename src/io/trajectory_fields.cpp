#include "tendril/io/trajectory_fields.hpp"

#include "tendril/io/contact_writer.hpp"

#include <numeric>

namespace tendril {

static constexpr Field table[] = {
    {"position", "m", On::vertices, 3, From::state, [](const Snapshot &s) { return s.state.position[0].data(); }},
    {"director", "1", On::edges, 3, From::state, [](const Snapshot &s) { return s.state.director[0].data(); }},
    {"velocity", "m/s", On::vertices, 3, From::state, [](const Snapshot &s) { return s.state.velocity[0].data(); }},
    {"twist_rate", "rad/s", On::edges, 1, From::state, [](const Snapshot &s) { return s.state.twist_rate.data(); }},
    {"axial_force", "N", On::edges, 1, From::state, [](const Snapshot &s) { return s.state.axial_force.data(); }},
    // Measure `angle`: 2 pi x whole turns of each cell's twist [rad].
    {"turns", "rad", On::cells, 1, From::state, [](const Snapshot &s) { return s.state.winding.data(); }},
    {"position_low", "m", On::vertices, 3, From::second_word,
     [](const Snapshot &s) { return s.state.position_low[0].data(); }},
    {"curvature", "1/m", On::vertices, 2, From::strains,
     [](const Snapshot &s) { return s.strains.curvature[0].data(); }},
    {"twist", "rad/m", On::vertices, 1, From::strains, [](const Snapshot &s) { return s.strains.twist.data(); }},
    {"strain_energy_density", "J/m", On::vertices, 1, From::strains,
     [](const Snapshot &s) { return s.strains.strain_energy_density.data(); }},
    {"force", "N", On::edges, 3, From::actions, [](const Snapshot &s) { return s.actions.force[0].data(); }},
    {"moment", "N m", On::vertices, 3, From::actions, [](const Snapshot &s) { return s.actions.moment[0].data(); }},
    {"reaction", "N", On::supports, 3, From::actions, [](const Snapshot &s) { return s.actions.reaction[0].data(); }},
    {"reaction_moment", "N m", On::supports, 3, From::actions,
     [](const Snapshot &s) { return s.actions.reaction_moment[0].data(); }},
    // Of pins the first three numbers, of rotations the last three.
    {"constraint_deviation", "m, rad", On::constraints, 6, From::actions,
     [](const Snapshot &s) { return s.constraint_deviation.data(); }},
    {"constraint_force", "N, N m", On::constraints, 6, From::actions,
     [](const Snapshot &s) { return s.constraint_force.data(); }},
    {"contact_force", "N", On::vertices, 3, From::contact, [](const Snapshot &s) { return s.contact_force[0].data(); }},
    // On the rods; moments about the positions of the obstacles.
    {"collider_force", "N", On::colliders, 3, From::contact,
     [](const Snapshot &s) { return s.collider_force[0].data(); }},
    {"collider_moment", "N m", On::colliders, 3, From::contact,
     [](const Snapshot &s) { return s.collider_moment[0].data(); }},
    // On bodies, where rods are tied to them exactly; the moment about the vertex.
    {"attachment_force", "N", On::attachments, 3, From::actions,
     [](const Snapshot &s) { return s.actions.attachment[0].data(); }},
    {"attachment_moment", "N m", On::attachments, 3, From::actions,
     [](const Snapshot &s) { return s.actions.attachment_moment[0].data(); }},
    // By how much the child is from the parent, and what acts on it: at the joint's point.
    {"joint_coordinate", "m, rad", On::joints, 1, From::actions,
     [](const Snapshot &s) { return s.joint_coordinate.data(); }},
    {"joint_distance", "m", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_distance[0].data(); }},
    {"joint_force", "N", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_force[0].data(); }},
    {"joint_moment", "N m", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_moment[0].data(); }},
    // Displacements are zero as drawn, rates theirs; the positions are of the points that a tendon runs through.
    {"tendon_displacement", "m", On::tendons, 1, From::tendons,
     [](const Snapshot &s) { return s.tendon_displacement.data(); }},
    {"tendon_length", "m", On::tendons, 1, From::tendons, [](const Snapshot &s) { return s.tendon_length.data(); }},
    {"tendon_rate", "m/s", On::tendons, 1, From::tendons, [](const Snapshot &s) { return s.tendon_rate.data(); }},
    {"tendon_tension", "N", On::tendons, 1, From::tendons, [](const Snapshot &s) { return s.tendon_tension.data(); }},
    {"tendon_position", "m", On::tendon_points, 3, From::tendons,
     [](const Snapshot &s) { return s.tendon_position[0].data(); }},
    // Behind each of these points, at the last before it: the same at all where nothing rubs.
    {"tendon_point_tension", "N", On::tendon_points, 1, From::tendons,
     [](const Snapshot &s) { return s.tendon_point_tension.data(); }},
    // Where obstacles stand, and quaternions w, x, y, z from their axes to the world's; where any moves.
    {"collider_position", "m", On::colliders, 3, From::motion,
     [](const Snapshot &s) { return s.collider_position[0].data(); }},
    {"collider_rotation", "1", On::colliders, 4, From::motion,
     [](const Snapshot &s) { return s.collider_rotation[0].data(); }},
    // Of the origins of bodies, but the last: it is about the centres of mass.
    {"body_position", "m", On::bodies, 3, From::bodies, [](const Snapshot &s) { return s.body.position[0].data(); }},
    {"body_rotation", "1", On::bodies, 4, From::bodies, [](const Snapshot &s) { return s.body.rotation[0].data(); }},
    {"body_velocity", "m/s", On::bodies, 3, From::bodies, [](const Snapshot &s) { return s.body.velocity[0].data(); }},
    {"body_angular_velocity", "rad/s", On::bodies, 3, From::bodies,
     [](const Snapshot &s) { return s.body.spin[0].data(); }},
    {"body_momentum", "kg m^2/s", On::bodies, 3, From::bodies,
     [](const Snapshot &s) { return s.body.momentum[0].data(); }},
};

const std::span<const Field> fields{table};

bool isUsual(From source) {
  return source == From::state || source == From::motion || source == From::bodies || source == From::tendons;
}

Eigen::Vector4d quaternionOf(const Mat3 &rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

BodyMotion motionOfBodies(const Scene &scene, const Elements &elements, const State &state) {
  BodyMotion motion;
  const int count = int(scene.bodies.size());
  for (int b = 0; b < count; ++b) {
    const Body &body = scene.bodies[b];
    const BodyRate &rate = state.body_rate[b];
    const Mat3 turn = rotationOf(state, elements.groups - count + b);
    const Vec3 arm = turn * (body.position - elements.bodyMass(b).centre);
    motion.position.push_back(state.body_position[b] + (arm + state.body_position_low[b]));
    motion.rotation.push_back(quaternionOf(turn * body.rotation));
    motion.velocity.push_back(rate.translation + rate.spin.cross(arm));
    motion.spin.push_back(rate.spin);
    motion.momentum.push_back(rate.momentum);
  }
  for (const Body &body : scene.held_bodies) {
    const Mat3 turn = body.motion.rotationAt(state.time);
    motion.position.push_back(body.position + body.motion.displacementAt(state.time));
    motion.rotation.push_back(quaternionOf(turn * body.rotation));
    motion.velocity.push_back(body.motion.velocityAt(state.time));
    motion.spin.push_back(body.motion.angularVelocityAt(state.time));
    const Vec3 spin = turn.transpose() * motion.spin.back();
    motion.momentum.push_back(turn * (body.own.inertia * spin));
  }
  return motion;
}

std::array<int, std::size(places)> sizes(const Scene &scene, const Elements &e) {
  return {e.vertices(),
          e.edges(),
          int(e.cell_slot.size()),
          int(e.support_slot.size()),
          int(e.constraint_slot.size()),
          int(scene.colliders.size()),
          int(scene.bodies.size() + scene.held_bodies.size()),
          int(scene.attachments.size()),
          int(scene.joints.size()),
          int(scene.tendons.size()),
          std::accumulate(scene.tendons.begin(), scene.tendons.end(), 0,
                          [](int sum, const Tendon &t) { return sum + t.drawnPoints(); })};
}

} // namespace tendril
