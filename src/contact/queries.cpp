/// What obstacles do to rods, for output and messages.
#include "tendril/contact/friction.hpp"
#include "tendril/contact/neighbours.hpp"
#include "tendril/contact/segments.hpp"

#include <algorithm>

namespace tendril {

bool carriesSurface(const Rod &rod) {
  const ContactSettings &contact = rod.contact;
  return contact.on && !rod.material.isCable() &&
         (contact.on_surface || (contact.slides() && contact.friction_at_surface));
}

double barrierStiffness(const Scene &scene, const Elements &elements, double force, double pressure, bool is_static,
                        int r, bool on_surface) {
  const Rod &rod = scene.rods[r];
  const double length = elements.length(r);
  // The strip is as wide as that of a tube within the barrier of a plane.
  const double strip = on_surface ? std::max(1.0, pi * std::sqrt(rod.contact.radius / (2 * rod.contact.distance))) : 1;
  double wanted = std::max(strip * force / (20 * rod.contact.radius), 0.1 * pressure);
  if (rod.gravity) wanted = std::max(wanted, 10 * strip * rod.material.linear_density * scene.gravity.norm());
  // What bends it by its own length: where nothing pulls, and in statics, where supports press it as its bending asks.
  const auto [k1, k2] = rod.material.flexural_stiffness;
  const double cube = length * length * length;
  if (wanted == 0)
    wanted = std::max({k1, k2, 1e-4 * rod.material.axial_stiffness * length * length}) / cube;
  else if (is_static)
    wanted = std::max(wanted, std::sqrt(k1 * k2) / cube);
  return std::pow(4.0, std::ceil(std::log2(wanted) / 2));
}

ContactPoint contactPoint(const Scene &scene, const RodContacts &rod, const Samples &samples, int k) {
  const Distance d = scene.colliders[samples.collider].shape->at(samples.at(k));
  const GapLaw law = rod.law()(samples.distance[k]);
  const double weight = rod.weight(samples, k);
  const Mat3 &q = samples.pose.rotation;
  ContactPoint point;
  point.rod = rod.pointOf(samples, k);
  point.normal = q * d.gradient;
  point.force = -weight * law.slope * point.normal;
  point.stiffness = weight * law.curvature * point.normal * point.normal.transpose();
  point.curvature = weight * law.slope * (q * d.hessian * q.transpose());
  return point;
}

std::vector<ContactReading> contactReadings(const Scene &scene, const Elements &elements, const State &state,
                                            const Configuration &c) {
  std::vector<ContactReading> readings;
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    if (!scene.touches(r)) continue;
    RodContacts rod(scene, elements, r);
    if (!state.contact_stiffness.empty()) rod.setStiffness(state.contact_stiffness[r]);
    rod.look(c, true);
    const std::vector<ContactMemory> *memory = state.contacts.empty() ? nullptr : &state.contacts[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const ContactPoint point = contactPoint(scene, rod, samples, k);
      const int slot = samples.slot[k], edge = slot - elements.rods[r].first_slot;
      const ContactMemory *found = memory ? find(*memory, edge, samples.collider, samples.point[k]) : nullptr;
      const Vec3 friction = found ? found->friction : Vec3(Vec3::Zero());
      readings.push_back({r, samples.collider, edge, point.rod, samples.distance[k], placeOf(point.rod, c),
                          point.normal.normalized(), point.force, friction});
    });
  }
  return readings;
}

std::vector<Vec3> contactForces(const Elements &elements, const std::vector<ContactReading> &readings) {
  std::vector<Vec3> force(elements.vertices(), Vec3::Zero());
  for (const ContactReading &reading : readings) {
    const RodRange &rod = elements.rods[reading.rod];
    const Vec3 both = reading.force + reading.friction;
    for (int k = 0; k < reading.point.edges; ++k) {
      const auto &[slot, next, weight, carried] = reading.point.by[k];
      const int edge = slot - rod.first_slot;
      force[rod.first_vertex + edge % rod.vertices] += weight * (1 - carried.at) * both;
      force[rod.first_vertex + (edge + 1) % rod.vertices] += weight * carried.at * both;
    }
  }
  return force;
}

void colliderActions(const Scene &scene, const std::vector<ContactReading> &readings, double time,
                     std::vector<Vec3> *force, std::vector<Vec3> *moment) {
  force->assign(scene.colliders.size(), Vec3::Zero());
  moment->assign(scene.colliders.size(), Vec3::Zero());
  for (const ContactReading &c : readings) {
    const Rod &rod = scene.rods[c.rod];
    const Vec3 from = c.place - scene.colliders[c.collider].poseAt(time).position,
               at = carriesSurface(rod) ? Vec3(from - rod.contact.padding() * c.normal) : from;
    (*force)[c.collider] += c.force + c.friction;
    (*moment)[c.collider] += from.cross(c.force) + at.cross(c.friction);
  }
}

std::vector<Meeting> overlapsOfRods(const Scene &scene, const Elements &elements, const Configuration &c,
                                    double within) {
  std::vector<Meeting> found;
  if (!scene.touchesRods()) return found;
  const Neighbours neighbours(scene, elements);
  Room room(elements.slots, scene.rods.size());
  for (const int slot : elements.vertex_slot) room.start.setVector(0, slot, c.positionAt(slot));
  for (const TouchingPair &p : neighbours.find(room)) {
    const ContactSettings &a = scene.rods[std::size_t(p.rod)].contact, &b = scene.rods[std::size_t(p.to_rod)].contact;
    const Closest near =
        closest(c.positionAt(p.slot[0]), c.positionAt(p.slot[1]), c.positionAt(p.slot[2]), c.positionAt(p.slot[3]));
    if (near.distance > wallBetween(a, b) + within) continue;
    auto arc = [&](int rod, int edge, double part) {
      return neighbours.arc(rod, edge) + part * elements.restLength()[elements.rods[std::size_t(rod)].slot(edge)];
    };
    found.push_back({p.rod, p.to_rod, near.distance - a.radius - b.radius, arc(p.rod, p.edge, near.part),
                     arc(p.to_rod, p.to_edge, near.other_part)});
  }
  std::stable_sort(found.begin(), found.end(), [](const Meeting &a, const Meeting &b) { return a.gap < b.gap; });
  return found;
}

std::vector<Touch> tightest(const Scene &scene, const Elements &elements, const Configuration &c) {
  std::vector<Touch> found;
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    if (!scene.touches(r)) continue;
    RodContacts rod(scene, elements, r);
    rod.look(c, true);
    std::vector<Touch> of_rod(scene.colliders.size());
    rod.visitNear(c, nullptr, [&](const Samples &samples) {
      for (int k = 0; k < samples.count; ++k) {
        Touch &worst = of_rod[samples.collider];
        if (samples.distance[k] >= worst.gap) continue;
        const double at = rod.pointOf(samples, k).by[0].point.at;
        double arc = 0;
        for (int s = elements.rods[r].first_slot; s < samples.slot[k]; ++s) arc += elements.restLength()[s];
        worst = {r, samples.collider, samples.distance[k], arc + at * elements.restLength()[samples.slot[k]]};
      }
    });
    std::copy_if(of_rod.begin(), of_rod.end(), std::back_inserter(found), [](const Touch &t) { return t.rod >= 0; });
  }
  std::stable_sort(found.begin(), found.end(), [](const Touch &a, const Touch &b) { return a.gap < b.gap; });
  return found;
}

} // namespace tendril
