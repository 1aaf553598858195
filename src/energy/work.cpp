#include "tendril/energy/work.hpp"

#include "tendril/energy/derived.hpp"
#include "tendril/energy/tendon.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

/// Potential of the weight of a rod and of centrifugal forces at load factor 1 [J].
double weightPotential(const Scene &scene, const Elements &elements, const Configuration &c, int r) {
  const Mat3 spin = scene.rotation.matrix();
  const RodRange &rod = elements.rods[r];
  const Vec3 gravity = scene.rods[r].gravity ? scene.gravity : Vec3(Vec3::Zero());
  double sum = 0;
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) {
    const Vec3 x = c.positionAt(s), away = x - scene.rotation.centre;
    sum -= elements.mass()[s] * (gravity.dot(x) + 0.5 * away.dot(spin * away));
  }
  return sum;
}

HolderActions staticActions(const Scene &scene, const Elements &elements, const State &state,
                            const std::vector<Holder> &moving) {
  const RodActions actions = rodActions(scene, elements, state, state.time, state.time, false);
  HolderActions out;
  const Configuration c = configurationOf(state, scene, elements, state.time);
  for (const Holder &h : moving)
    if (h.tendon) {
      const TendonPath path(scene, elements, h.index);
      const TendonReading of = readTendon(scene, elements, h.index, state, c, false);
      const Vec3 force = h.place == 0 ? Vec3(-of.tension, 0, 0)
                                      : Vec3(of.factor() * path.byTold(c, of.tensions())[std::size_t(h.place - 1)]);
      out.insert(out.end(), {force, Vec3::Zero()});
    } else if (h.joint) {
      const JointReading &of = actions.joint[h.index];
      if (h.drives)
        out.insert(out.end(), {Vec3(of.drive, 0, 0), Vec3::Zero()});
      else {
        std::array<Vec3, 2> action{of.force, of.moment};
        for (int k = 0; k < int(scene.tendons.size()); ++k) {
          const TendonPath path(scene, elements, k);
          for (const Tendon::Pull &pull : path.tendon().joints) {
            if (pull.joint != h.index) continue;
            const TendonReading with = readTendon(scene, elements, k, state, c, false);
            const std::array<Vec3, 2> by = path.byParent(pull, c, with.tensions());
            for (const std::size_t n : {0u, 1u}) action[n] += with.factor() * by[n];
          }
        }
        out.insert(out.end(), {action[0], action[1]});
      }
    } else if (h.support)
      out.insert(out.end(), {actions.reaction[h.index], actions.reaction_moment[h.index]});
    else
      out.insert(out.end(), {actions.constraint[h.index].force, actions.constraint[h.index].moment});
  return out;
}

} // namespace

double coupleWork(const Vec3 &moment, double torque, const Vec3 &from, const Vec3 &to, double spin) {
  const Vec3 axis = from.cross(to);
  const double sine = axis.norm(), turning = sine > 0 ? std::atan2(sine, from.dot(to)) / sine : 1;
  const Vec3 mean = (from + to).normalized();
  return (torque + moment.dot(mean)) * spin + turning * moment.dot(axis);
}

void addWorkOfLoads(const Scene &scene, const Elements &elements, const Configuration &start, const Configuration &end,
                    double factor_start, double factor_end, ExactSum &sum) {
  const double mean = 0.5 * (factor_start + factor_end);
  for (const NodalForce &f : scene.forces)
    sum.add(mean * f.force.dot(end.displacementAt(elements.rods[f.rod].slot(f.vertex), start)));
  for (const PlacedFollower &f : elements.followers({0, int(scene.rods.size())}))
    sum.add(0.5 * mean *
            (f.along(start.frameAt(f.edge)) + f.along(end.frameAt(f.edge))).dot(end.displacementAt(f.vertex, start)));
  for (const EdgeMoment &m : scene.moments) {
    const int slot = elements.rods[m.rod].slot(m.edge);
    const Frame before = start.frameAt(slot), after = end.frameAt(slot);
    const double principal = halfAngleBetween(before, after).angle(),
                 spun = end[Configuration::spin][slot] - start[Configuration::spin][slot];
    sum.add(mean * coupleWork(m.moment, m.torque, before.tangent, after.tangent,
                              principal + 2 * pi * std::round((spun - principal) / (2 * pi))));
  }
  if (!scene.moments
           .empty()) // an end couple turns the half edge beyond the last cell, too, and what it does there is stored
    for (const auto &couples : elements.end_couples)
      for (const EndCouple &couple : couples) {
        const Frame before = start.frameAt(couple.edge), after = end.frameAt(couple.edge);
        for (int k = 0; k < 3; ++k)
          sum.add(endEnergy(elements, end, couple, factor_end)[k] -
                  endEnergy(elements, start, couple, factor_start)[k]);
        sum.add(-0.5 *
                (endPull(elements, before, couple, factor_start).force +
                 endPull(elements, after, couple, factor_end).force) *
                (after.length - before.length));
      }
  for (const Body &body : scene.bodies) {
    const JoinedBody &b = elements.body(int(&body - scene.bodies.data()));
    if (body.force.isZero(0) && body.torque.isZero(0)) continue;
    const Vec3 arm = body.own.centre - elements.bodyMass(b.body).centre,
               turned = (end.rotationAt(b.rotation) - start.rotationAt(b.rotation)) * arm;
    sum.add(mean *
            (body.force.dot(end.displacementAt(b.position, start) + turned) + body.torque.dot(turnOf(b, start, end))));
  }
  for (int k = 0; k < int(scene.tendons.size()); ++k) {
    const Actuator &actuator = scene.tendons[std::size_t(k)].actuator;
    if (actuator.kind != Actuator::Kind::force && actuator.kind != Actuator::Kind::mckibben) continue;
    const TendonPath path(scene, elements, k);
    sum.add(workBetween(actuator, path.displacement(start), path.displacement(end),
                        0.5 * (path.input(start) + path.input(end))));
  }
  if (factor_end == factor_start) return;
  for (const Body &body : scene.bodies) {
    const JoinedBody &b = elements.body(int(&body - scene.bodies.data()));
    if (!body.gravity) continue;
    const Vec3 both = start.positionAt(b.position) + end.positionAt(b.position);
    sum.add(-0.5 * (factor_end - factor_start) * elements.bodyMass(b.body).mass * scene.gravity.dot(both));
  }
  for (int r = 0; r < int(scene.rods.size()); ++r)
    sum.add(0.5 * (factor_end - factor_start) *
            (weightPotential(scene, elements, start, r) + weightPotential(scene, elements, end, r)));
}

std::vector<Holder> movingHolders(const Scene &scene) {
  std::vector<Holder> moving;
  for (const Support &s : scene.supports)
    if (s.motion.moves()) moving.push_back({s.rod, &s.motion, int(&s - scene.supports.data()), &s});
  for (const Constraint &c : scene.constraints)
    if (c.motion.moves()) moving.push_back({c.rod, &c.motion, int(&c - scene.constraints.data()), nullptr, &c});
  for (const Joint &j : scene.joints)
    for (const bool drives : {false, true})
      if (const Motion &motion = drives ? j.target_motion : j.motion; motion.moves())
        moving.push_back({j.rod, &motion, int(&j - scene.joints.data()), nullptr, nullptr, nullptr, &j, drives});
  for (const Tendon &t : scene.tendons) {
    const int index = int(&t - scene.tendons.data());
    auto add = [&](const Motion &motion, int place) {
      if (motion.moves())
        moving.push_back({t.rod, &motion, index, nullptr, nullptr, nullptr, nullptr, false, &t, place});
    };
    if (t.actuator.kind == Actuator::Kind::displacement) add(t.actuator.input_motion, 0);
    int place = 0;
    for (const Waypoint &p : t.points)
      if (p.isTold()) add(p.motion, ++place);
  }
  return moving;
}

std::vector<Holder> movingObstacles(const Scene &scene) {
  std::vector<Holder> moving;
  if (!scene.collidersMove()) return moving;
  std::vector<char> holds(scene.rods.size(), false); // a body that touches
  for (const Body &b : scene.bodies)
    if (b.contact.on) holds[b.rod] = true;
  for (int r = 0; r < int(scene.rods.size()); ++r)
    for (const Collider &c : scene.colliders)
      if ((scene.touches(r) || holds[r]) && c.motion.moves())
        moving.push_back({r, &c.motion, int(&c - scene.colliders.data()), nullptr, nullptr, &c});
  return moving;
}

double workOf(const Holder &holder, const std::array<Vec3, 2> &action, const Elements &elements,
              const Configuration &start, const Configuration &end, double from, double to) {
  const Motion &motion = *holder.motion;
  const Vec3 moved = holder.support ? end.displacementAt(elements.rods[holder.rod].slot(holder.support->vertex), start)
                                    : Vec3(motion.displacementAt(to) - motion.displacementAt(from));
  return action[0].dot(moved) + action[1].dot(motion.turnBetween(from, to));
}

void addStaticWork(const Scene &scene, const Elements &elements, const State &before, const State &after,
                   const Configuration &start, const Configuration &end, WorkSums &work) {
  addWorkOfLoads(scene, elements, start, end, before.time, after.time, work.loads);
  const std::vector<Holder> moving = movingHolders(scene);
  if (moving.empty()) return;
  const HolderActions first = staticActions(scene, elements, before, moving),
                      last = staticActions(scene, elements, after, moving);
  auto mean = [&](std::size_t k) { return Vec3(0.5 * (first[k] + last[k])); };
  for (std::size_t k = 0; k < moving.size(); ++k)
    work.supports.add(workOf(moving[k], {mean(2 * k), mean(2 * k + 1)}, elements, start, end, before.time, after.time));
}

void addStaticWork(const Scene &scene, const Elements &elements, const State &before, const State &after,
                   WorkSums &work) {
  addStaticWork(scene, elements, before, after, configurationOf(before, scene, elements, before.time),
                configurationOf(after, scene, elements, after.time), work);
}

void addCarriedEnergy(const Scene &scene, const Elements &elements, const State &state, ExactSum &sum) {
  struct Carried {
    Vec3 about, velocity, spin;
  };
  std::vector<Carried> moving;
  for (const Collider &c : scene.colliders)
    if (c.motion.moves())
      moving.push_back(
          {c.poseAt(state.time).position, c.motion.velocityAt(state.time), c.motion.angularVelocityAt(state.time)});
  if (moving.empty()) return;
  for (const RodRange &rod : elements.rods) {
    double carried = 0;
    for (int i = 0; i < rod.vertices; ++i) {
      const Vec3 &x = state.position[rod.first_vertex + i], &v = state.velocity[rod.first_vertex + i];
      double least = v.squaredNorm();
      for (const Carried &c : moving)
        least = std::min(least, (v - c.velocity - c.spin.cross(x - c.about)).squaredNorm());
      carried += 0.5 * elements.mass()[rod.slot(i)] * (v.squaredNorm() - least);
    }
    sum.add(carried);
  }
}

} // namespace tendril
