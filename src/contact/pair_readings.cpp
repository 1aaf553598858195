#include "tendril/contact/pair_readings.hpp"

#include "tendril/contact/touching_bodies.hpp"
#include "tendril/contact/touching_rods.hpp"

namespace tendril {
namespace {

PairReading readingOf(const TouchingPair &p, int side, int sample, const State &state) {
  PairReading reading{};
  for (const int k : {0, 1}) {
    const int of = k == 0 ? side : 1 - side;
    const std::size_t at = std::size_t(k);
    const bool body = p.isBody(of);
    reading.rod[at] = body ? -1 : p.rodOf(of);
    reading.edge[at] = body ? -1 : p.edgeOf(of);
    reading.body[at] = body ? p.body(of) : -1;
    reading.at[at] = NAN;
  }
  if (state.pairs.empty()) return reading;
  const auto key = std::tuple(p.edgeOf(side), p.rodOf(1 - side), p.edgeOf(1 - side), sample);
  for (const PairMemory &m : state.pairs[std::size_t(p.rodOf(side))])
    if (m.key() == key) reading.friction = m.friction;
  return reading;
}

void addOfRods(const Scene &scene, const Elements &elements, const State &state, const Configuration &c,
               std::vector<PairReading> &readings) {
  const TouchingRods rods(scene, elements);
  rods.cover(c, 0);
  const std::vector<double> &of_state = state.rod_contact_stiffness;
  const std::vector<double> &stiffness = of_state.empty() ? rods.stiffness() : of_state;
  for (const TouchingPair &p : rods.pairs().items) {
    const NormalLaw law = rods.lawOf(stiffness, p);
    const std::array<Vec3, 4> x = TouchingRods::pointsOf(p, c);
    rods.visit(p, x, law.reach(), [&](const Touching &t) {
      PairReading reading = readingOf(p, t.side, t.sample, state);
      if (t.taken_off) reading.friction.setZero(); // that of both is with the edge
      const std::size_t own = std::size_t(2 * t.side);
      reading.at = {t.part[own + 1], -t.part[std::size_t(t.other() + 1)]};
      reading.gap = t.gap;
      reading.place = c.positionAt(p.slot[0]) + (1 - reading.at[0]) * x[own] + reading.at[0] * x[own + 1];
      reading.normal = t.normal;
      reading.force = -t.weight * law(t.gap).slope * t.normal;
      readings.push_back(reading);
    });
  }
}

void addOfBodies(const Scene &scene, const Elements &elements, const State &state, const Configuration &c,
                 bool is_static, std::vector<PairReading> &readings) {
  const TouchingBodies bodies(scene, elements, is_static);
  bodies.cover(c, 0);
  bodies.visit(c, {0, int(scene.rods.size())}, [&](const TouchingPair &p, const TouchingSolid &t) {
    const int solid = p.body(t.solid());
    const Collider::Pose pose = bodies.poseOf(solid, c);
    const Vec3 steep = pose.rotation * bodies.solidOf(solid).at(t.local).gradient;
    PairReading reading = readingOf(p, t.side, t.sample, state);
    if (!p.isBody(t.side)) reading.at[0] = t.at;
    reading.gap = t.gap;
    reading.place = pose.fromLocal(t.local);
    reading.normal = steep.normalized();
    reading.force = -t.weight * bodies.lawOf(p)(t.gap).slope * steep;
    readings.push_back(reading);
  });
}

} // namespace

std::vector<PairReading> pairReadings(const Scene &scene, const Elements &elements, const State &state,
                                      const Configuration &c, bool is_static) {
  std::vector<PairReading> readings;
  if (scene.touchesRods()) addOfRods(scene, elements, state, c, readings);
  if (scene.touchesBodies()) addOfBodies(scene, elements, state, c, is_static, readings);
  return readings;
}

} // namespace tendril
