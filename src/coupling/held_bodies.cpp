#include "tendril/coupling/held_bodies.hpp"

#include "tendril/energy/tendon.hpp"

namespace tendril {

std::vector<Held> whatHolds(const Scene &scene, const Elements &elements) {
  std::vector<Held> held(scene.bodies.size());
  auto hold = [&](int body, double stiffness, double turning, double arm) {
    held[std::size_t(body)].stiffness += stiffness;
    held[std::size_t(body)].turning += turning + stiffness * arm * arm;
  };
  for (const JoinedVertex &j : elements.joinedVertices({0, int(elements.rods.size())})) {
    if (!j.isOnBody()) continue;
    const double arm = elements.armAsDrawn(j).norm();
    if (!j.isVertex()) {
      hold(j.body, scene.constraints[std::size_t(j.attachment)].stiffness, 0, arm);
      continue;
    }
    const Rod &rod = scene.rods[std::size_t(j.rod)];
    const auto [k1, k2] = rod.material.flexural_stiffness;
    for (const int edge : {rod.edgeBefore(j.vertex), rod.edgeAfter(j.vertex)})
      if (edge >= 0) {
        const double length = rod.edge(edge).norm();
        hold(j.body, rod.material.axial_stiffness / length, 4 * std::max(k1, k2) / length, arm);
      }
  }
  for (const Constraint &c : scene.constraints)
    if (c.isToBody() && !c.isPin()) hold(c.to_body, 0, c.stiffness, 0);
  for (int k = 0; k < int(scene.tendons.size()); ++k) {
    const TendonPath path(scene, elements, k);
    const double stiffness = stiffnessAsDrawn(scene.tendons[std::size_t(k)]);
    for (const Carrier &c : path.carriers())
      if (c.isBody()) hold(c.body(), stiffness, 0, elements.bodySize(c.body()));
  }
  for (int b = 0; b < int(held.size()); ++b) { // loads over sizes
    const Body &body = scene.bodies[std::size_t(b)];
    const double size = elements.bodySize(b), weight = body.gravity ? body.own.mass * scene.gravity.norm() : 0;
    hold(b, (weight + body.force.norm() + body.torque.norm() / size) / size, 0, size);
  }

  return held;
}

} // namespace tendril
