#include "tendril/state/commit.hpp"

#include <map>

namespace tendril {

Configuration::Configuration(int slots) : values_(planes, slots) {
  for (const int plane : {int(tangent), director + 1, int(length)}) std::fill_n(values_[plane], slots, 1.0);
}

void Configuration::setFrame(int slot, const Frame &f) {
  values_.setVector(tangent, slot, f.tangent);
  values_.setVector(director, slot, f.director);
  values_[length][slot] = f.length;
}

void Configuration::copySlots(const Configuration &from, int begin, int end) {
  for (int p = 0; p < planes; ++p) std::copy(from.values_[p] + begin, from.values_[p] + end, values_[p] + begin);
}

void Configuration::copyEnds(const Elements &elements, int r, const Configuration &from) {
  const RodRange &rod = elements.rods[r];
  copySlots(from, rod.first_slot - 1, rod.first_slot);
  copySlots(from, rod.vertexEnd() - 1, rod.vertexEnd());
  for (const LooseCell &cell : elements.loose[r])
    for (const int slot : {cell.slot, cell.frame0, cell.frame1}) copySlots(from, slot, slot + 1);
  for (const JoinedBody &b : elements.bodies({r, r + 1}))
    for (const int slot : {b.position, b.rotation}) copySlots(from, slot, slot + 1);
  for (const JoinedVertex &j : elements.joinedVertices({r, r + 1}))
    if (j.isOnBody()) copySlots(from, j.frame, j.frame + 1);
  for (const BodyPair &p : elements.pairs({r, r + 1})) copySlots(from, p.first, p.first + BodyPair::slots);
  for (const int k : elements.constraintsOf(r)) {
    const int slot = elements.constraint_slot[k];
    copySlots(from, slot, slot + 1);
  }
  for (const int k : elements.tendonsOf(r)) {
    const auto [begin, end] = elements.tendonSlots(k);
    copySlots(from, begin, end);
  }
  if (from.obstacle_time_.empty()) return;
  obstacle_time_.resize(from.obstacle_time_.size());
  obstacle_time_[r] = from.obstacle_time_[r];
}

void Configuration::copyRod(const Elements &elements, int r, const Configuration &from) {
  const RodRange &rod = elements.rods[r];
  copySlots(from, rod.first_slot, rod.vertexEnd() + 2);
  copyEnds(elements, r, from);
}

void Configuration::closeRing(const RodRange &rod) {
  if (!rod.closed) return;
  const int behind = rod.vertexEnd();
  for (const int i : {0, 1})
    setPosition(behind + i, positionAt(rod.slot(i)), values_.vector(position_low, rod.slot(i)));
  setFrame(behind, frameAt(rod.slot(0)));
  for (const Plane p : {strain, spin, axial_force}) values_[p][behind] = values_[p][rod.slot(0)];
}

State initialState(const Scene &scene, const Elements &elements) {
  State s;
  for (const Rod &rod : scene.rods) {
    s.position.insert(s.position.end(), rod.position.begin(), rod.position.end());
    double length = 0, along = 0;
    for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
    for (int i = 0; i < rod.edges(); ++i) {
      const Frame f = referenceFrame(rod, i);
      if (i > 0) along += 0.5 * f.length;
      s.director.push_back(rotateAbout<double>(f.director, f.tangent, 2 * pi * rod.initial_turns * along / length));
      along += 0.5 * f.length;
    }
    s.velocity.insert(s.velocity.end(), rod.position.size(), rod.initial_velocity);
  }
  s.position_low.assign(s.position.size(), Vec3::Zero());
  s.twist_rate.assign(s.director.size(), 0.0);
  s.axial_force.assign(s.director.size(), 0.0);
  s.winding.assign(elements.cell_slot.size(), 0.0);
  s.junction_axes.assign(elements.groups, {Vec3::UnitX(), Vec3::UnitY()});
  for (int b = 0; b < int(scene.bodies.size()); ++b) {
    const Body &body = scene.bodies[b];
    const MassProperties &all = elements.bodyMass(b);
    s.body_position.push_back(all.centre);
    s.body_position_low.push_back(Vec3::Zero());
    s.body_rate.push_back({body.velocity + body.angular_velocity.cross(all.centre - body.own.centre),
                           body.angular_velocity, all.inertia * body.angular_velocity});
  }
  s.joints.resize(scene.joints.size());
  s.tendon_memory.resize(std::size_t(scene.firstMemory(int(scene.tendons.size()))));
  const Configuration c = configurationOf(s, scene, elements, 0);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    if (rod.measure != Measure::angle || rod.initial_turns == 0) continue;
    double length = 0;
    for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n) {
      const double expected = 2 * pi * rod.initial_turns * elements.cellLength()[elements.cell_slot[n]] / length;
      s.winding[n] = 2 * pi * std::round((expected - c[Configuration::twist][elements.cell_slot[n]]) / (2 * pi));
    }
  }
  // What is one point has one velocity: that of all momenta together, or none where it is held.
  std::map<int, std::pair<Vec3, double>> momentum;
  const auto joined = elements.joinedVertices({0, int(elements.rods.size())});
  auto vertexOf = [&](const JoinedVertex &j) { return elements.rods[j.rod].first_vertex + j.vertex; };
  for (const JoinedVertex &j : joined) {
    if (j.isOnBody()) continue;
    auto &[sum, mass] = momentum.try_emplace(j.first_slot, Vec3::Zero(), 0.0).first->second;
    sum += elements.mass()[j.slot] * s.velocity[vertexOf(j)];
    mass += elements.mass()[j.slot];
  }
  for (const JoinedVertex &j : joined) {
    if (j.isOnBody()) continue;
    const auto &[sum, mass] = momentum.at(j.first_slot);
    s.velocity[vertexOf(j)] = mass > 0 ? Vec3(elements.freedom()[j.slot] * sum / mass) : Vec3(Vec3::Zero());
  }
  if (!scene.bodies.empty()) settleBodies(elements, {0, int(elements.rods.size())}, s);
  for (const Support &support : scene.supports)
    if (support.holdsPosition()) s.velocity[elements.rods[support.rod].first_vertex + support.vertex].setZero();
  return s;
}

Frame supportFrame(const Support &support, double motion_time) {
  const Mat3 r = support.motion.rotationAt(motion_time);
  return {r * support.frame.tangent, r * support.frame.director, 1.0};
}

void setSupports(const Scene &scene, const Elements &elements, double motion_time, Configuration &c) {
  for (std::size_t s = 0; s < scene.supports.size(); ++s)
    if (elements.support_slot[s] >= 0)
      c.setFrame(elements.support_slot[s], supportFrame(scene.supports[s], motion_time));
  setTargets(scene, elements, motion_time, c);
  if (scene.collidersMove()) c.setObstacleTimes(int(elements.rods.size()), motion_time);
}

void setTarget(const Constraint &constraint, int slot, double motion_time, Configuration &c) {
  if (constraint.isPin())
    c.setPosition(slot, constraint.pointAt(motion_time), Vec3::Zero());
  else
    c.setFrame(slot, constraint.frameAt(motion_time));
}

void setTargets(const Scene &scene, const Elements &elements, double motion_time, Configuration &c) {
  for (std::size_t k = 0; k < scene.constraints.size(); ++k)
    if (scene.constraints[k].isToWorld()) // others have a vertex or a body for their target: see setRod
      setTarget(scene.constraints[k], elements.constraint_slot[k], motion_time, c);
  for (std::size_t k = 0; k < scene.joints.size(); ++k)
    setTarget(scene.joints[k], elements.pairOf(int(k)), motion_time, c);
  for (std::size_t k = 0; k < scene.tendons.size(); ++k)
    setTarget(scene.tendons[k], elements.tendon_slot[k], motion_time, c);
}

void setTarget(const Tendon &tendon, int slot, double motion_time, Configuration &c) {
  c.setPosition(slot, {tendon.actuator.inputAt(motion_time), 0, 0}, Vec3::Zero());
  for (const Waypoint &p : tendon.points)
    if (p.isTold()) c.setPosition(++slot, p.point + p.motion.displacementAt(motion_time), Vec3::Zero());
}

void setTarget(const Joint &joint, const BodyPair &pair, double motion_time, Configuration &c) {
  c.setPosition(pair.target(), {joint.targetAt(motion_time), 0, 0}, Vec3::Zero());
  if (joint.parent >= 0) return;
  const Mat3 axes = joint.motion.rotationAt(motion_time) * joint.axes;
  c.setPosition(pair.parent(0), joint.point + joint.motion.displacementAt(motion_time), Vec3::Zero());
  c.setFrame(pair.parent(0), {axes.col(0), axes.col(1), 1});
}

Mat3 rotationOf(const State &state, int group) {
  const auto &[x, y] = state.junction_axes[group];
  Mat3 turned;
  turned << x, y, x.cross(y);
  return turned;
}

Frame joinedFrame(const State &state, const Elements &elements, const JoinedEdge &j) {
  const Mat3 turned = rotationOf(state, j.group);
  const Frame &drawn = elements.frameAsDrawn(j);
  return {turned * drawn.tangent, turned * drawn.director, 1};
}

/// Positions, directors and axial forces of a rod, plane by plane, as a state has them.
static void setOwn(const State &state, const RodRange &rod, Configuration &c) {
  using C = Configuration;
  for (int a = 0; a < 3; ++a) {
    double *high = c[C::Plane(C::position + a)] + rod.first_slot,
           *low = c[C::Plane(C::position_low + a)] + rod.first_slot;
    for (int i = 0; i < rod.vertices; ++i) {
      high[i] = state.position[rod.first_vertex + i][a];
      low[i] = state.position_low[rod.first_vertex + i][a];
    }
  }
  c.closeRing(rod);
  for (int a = 0; a < 3; ++a) {
    double *director = c[C::Plane(C::director + a)] + rod.first_slot;
    for (int i = 0; i < rod.edges; ++i) director[i] = state.director[rod.first_edge + i][a];
  }
  for (int i = 0; i < rod.edges; ++i) {
    c[C::axial_force][rod.slot(i)] = state.axial_force[rod.first_edge + i];
    c[C::spin][rod.slot(i)] = 0;
  }
}

/// Tangents, lengths and strains of edges, by their vertices.
static void measureEdges(const Elements &elements, int r, Configuration &c) {
  using C = Configuration;
  using std::sqrt;
  const RodRange &rod = elements.rods[r];
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Pack::mask_type live = firstLanes(rod.edgeEnd() - s);
    const Vector3<Pack> e = c.edges<Pack>(s);
    const Pack l = sqrt(e.squaredNorm()), length = select(live, l, read<Pack>(c[C::length] + s));
    for (int a = 0; a < 3; ++a) {
      double *t = c[C::Plane(C::tangent + a)] + s;
      write(t, select(live, Pack(e[a] / l), read<Pack>(t)));
    }
    write(c[C::length] + s, length);
    write(c[C::strain] + s,
          axialStrain<Pack>(elements.energy[r], length, read<Pack>(elements.inverseRestLength() + s)));
  }
  c.closeRing(rod);
}

/// Bodies beside a rod, and what is tied to bodies.
static void setBodies(const State &state, const Elements &elements, int r, Configuration &c) {
  auto setTurned = [&](int slot, int group) {
    const Mat3 turned = rotationOf(state, group);
    c.setFrame(slot, {turned.col(0), turned.col(1), 1});
    c.setPosition(slot, Vec3::Zero(), Vec3::Zero());
  };
  for (const JoinedBody &b : elements.bodies({r, r + 1})) {
    c.setPosition(b.position, state.body_position[b.body], state.body_position_low[b.body]);
    setTurned(b.rotation, b.group);
  }
  for (const JoinedVertex &j : elements.joinedVertices({r, r + 1}))
    if (j.isOnBody()) {
      setTurned(j.frame, elements.body(j.body).group);
      if (j.isVertex()) continue;
      Vec3 high = state.body_position[j.body], low = state.body_position_low[j.body];
      const Vec3 arm = rotationOf(state, elements.body(j.body).group) * elements.armAsDrawn(j);
      for (int a = 0; a < 3; ++a) addTwoWords(high[a], low[a], arm[a]);
      c.setPosition(j.slot, high, low);
    }
}

[[gnu::flatten]] void setRod(const State &state, const Elements &elements, int r, Configuration &c) {
  using C = Configuration;
  for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n)
    c[C::winding][elements.cell_slot[n]] = state.winding[n];
  setOwn(state, elements.rods[r], c);
  measureEdges(elements, r, c);
  setBodies(state, elements, r, c);
  for (const JoinedEdge &j : elements.joinedEdges({r, r + 1})) {
    c.setFrame(j.frame, joinedFrame(state, elements, j));
    c.setPosition(j.frame, Vec3::Zero(), Vec3::Zero());
    c[C::spin][j.frame] = 0;
  }
  for (const BodyPair &p : elements.pairs({r, r + 1})) {
    if (p.joint < 0) continue;
    for (int k = 0; k < BodyPair::forces; ++k) c[C::axial_force][p.first + k] = state.joints[p.joint].force[k];
    c[C::winding][p.target()] = state.joints[p.joint].coordinate;
  }
  for (const Tie &t : elements.ties({r, r + 1}))
    if (!t.isToBody()) c.setPosition(t.copy, state.position[t.vertex], state.position_low[t.vertex]);
  forCells(elements, r, [&]<class T>(const LooseCell &cell, int count) {
    const auto frames = cellFrames<T>(c, cell, count);
    write(c[C::twist] + cell.slot,
          T(halfAngleBetween(frames[0], frames[1]).angle() + read<T>(c[C::winding] + cell.slot)));
  });
}

void carryFrames(const StageRule &rule, const Elements &elements, int r, const Configuration &from,
                 Configuration &reference) {
  const RodRange &rod = elements.rods[r];
  reference.copyRod(elements, r, from);
  auto moved = [&](const Combination &by, int i) {
    const int v = rod.first_vertex + (i == rod.vertices ? 0 : i);
    return Vec3(elements.freedom()[elements.vertex_slot[v]] * by.atVertex(v));
  };
  Vec3 here = moved(rule.guess, 0);
  for (int i = 0; rod.twist && i < rod.edges; ++i) {
    const Frame f = from.frameAt(rod.slot(i));
    const Vec3 next = moved(rule.guess, i + 1), edge = f.tangent * f.length + (next - here);
    const Vec3 tangent = edge.normalized();
    here = next;
    if (!(f.tangent.dot(tangent) > 0.1)) continue;
    Vec3 director = orthonormalised(transport<double>(f.director, f.tangent, tangent), tangent);
    if (!rule.halfway.empty()) {
      const Vec3 middle = (f.tangent * f.length + (moved(rule.halfway, i + 1) - moved(rule.halfway, i))).normalized();
      if (middle.dot(f.tangent) > 0.1 && middle.dot(tangent) > 0.1) {
        const Vec3 by_way = transport<double>(transport<double>(f.director, f.tangent, middle), middle, tangent);
        const double triangle =
            halfAngleBetween<double>({tangent, director, 1.0}, {tangent, orthonormalised(by_way, tangent), 1.0})
                .angle();
        director = rotateAbout<double>(director, tangent, 4.0 / 3 * triangle);
      }
    }
    reference.setFrame(rod.slot(i), {tangent, director, f.length});
  }
}

StageRule backwardEuler(const State &start, double dt) {
  StageRule rule;
  rule.dt = rule.damping_dt = dt;
  rule.acceleration.add(-1, start);
  rule.guess.add(dt, start);
  rule.lengths = RetractionKind::continued;
  rule.carries_frames = rule.wants_accelerations = false;
  return rule;
}

Configuration configurationOf(const State &state, const Scene &scene, const Elements &elements, double motion_time) {
  Configuration c(elements.slots);
  setSupports(scene, elements, motion_time, c);
  for (std::size_t r = 0; r < elements.rods.size(); ++r) setRod(state, elements, int(r), c);
  return c;
}

} // namespace tendril
