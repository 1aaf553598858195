#include "tendril/contact/touching_bodies.hpp"

#include "tendril/contact/contact.hpp"
#include "tendril/energy/load.hpp"

#include <algorithm>

namespace tendril {

TouchingBodies::TouchingBodies(const Scene &scene, const Elements &elements, bool is_static)
    : scene_(scene), elements_(elements), solids_(scene.bodies.size()), static_(is_static),
      bounded_(scene.rods.size(), 0) {
  for (std::size_t b = 0; b < solids_.size(); ++b) {
    const Body &body = scene.bodies[b];
    if (!body.contact.touchesBodies()) continue;
    Solid &solid = solids_[b];
    solid.shape = tendril::solidOf(body);
    solid.samples = surfaceSamples(body, elements.bodyMass(int(b)).centre);
    for (const BodySample &s : solid.samples) solid.reach = std::max(solid.reach, s.arm.norm() + s.radius);
    solid.force = pressOn(scene, elements, int(b));
  }
  for (int r = 0; r < int(scene.rods.size()); ++r)
    load_.push_back(
        scene.rods[std::size_t(r)].contact.touchesBodies() ? loadScale(scene, elements, r, elements.length(r)) : 0);
  skins_.resize(scene.rods.size());
  for (std::size_t r = 0; r < skins_.size(); ++r)
    if (const Rod &rod = scene.rods[r]; rod.contact.on_surface && rod.contact.touchesBodies())
      skins_[r] = SkinSamples(rod, elements.rods[r]);
  leaveOut();
  bearAsDrawn();
}

double TouchingBodies::aboutEdge(int r, int edge, const Configuration &c) const {
  const SkinSamples &skin = skins_[std::size_t(r)];
  const RodRange &rod = elements_.rods[std::size_t(r)];
  const double *const length = c[Configuration::length];
  const int next = rod.closed || edge + 1 < rod.edges ? (edge + 1) % rod.edges : edge;
  return skin.arm() + skin.apart() * std::max(length[rod.slot(edge)], length[rod.slot(next)]);
}

double TouchingBodies::aboutAxis(int r, const Configuration &c) const {
  const SkinSamples &skin = skins_[std::size_t(r)];
  if (skin.empty()) return scene_.rods[std::size_t(r)].contact.radius;
  const RodRange &rod = elements_.rods[std::size_t(r)];
  double longest = 0;
  for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) longest = std::max(longest, c[Configuration::length][s]);
  return skin.arm() + skin.apart() * longest;
}

Collider::Pose TouchingBodies::poseOf(int b, const Configuration &c) const {
  const Body &body = scene_.bodies[std::size_t(b)];
  const JoinedBody &at = elements_.body(b);
  const Mat3 turned = c.rotationAt(at.rotation);
  return {turned * body.rotation, c.positionAt(at.position) + turned * (body.position - elements_.bodyMass(b).centre)};
}

TouchingBodies::Side TouchingBodies::sideOf(const TouchingPair &p, int side, const Collider::Pose &pose,
                                            const Configuration &c) const {
  const int slot = p.slot[std::size_t(2 * side)], next = p.slot[std::size_t(2 * side + 1)];
  Side out{};
  out.first = pose.toLocal(c.positionAt(slot));
  if (p.isBody(side)) {
    const std::vector<BodySample> &samples = samplesOf(p.body(side));
    out.samples = samples.data();
    out.count = int(samples.size());
    out.turned = pose.rotation.transpose() * c.rotationAt(next);
    return out;
  }
  if (const SkinSamples &skin = skins_[std::size_t(p.rodOf(side))]; !skin.empty()) {
    const std::span<const OnSkin> samples = skin.of(p.edgeOf(side));
    out.skin = samples.data();
    out.count = int(samples.size());
    out.c = &c;
    out.pose = pose;
    out.along = pose.rotation.transpose() * c.edges<double>(slot);
    return out;
  }
  const std::span<const SamplePoint> points = points_of_[std::size_t(p.number)];
  out.points = points.data();
  out.count = int(points.size());
  out.radius = settingsOf(p, side).radius;
  out.along = pose.rotation.transpose() * c.edges<double>(slot);
  return out;
}

bool TouchingBodies::isAway(const TouchingPair &p, int side, const Side &samples, double reach) const {
  const Vec3 middle = samples.samples ? samples.first : Vec3(samples.first + 0.5 * samples.along);
  const double about = samples.skin ? aboutEdge(p.rodOf(side), p.edgeOf(side), *samples.c) : samples.radius,
               size = samples.samples ? solids_[std::size_t(p.body(side))].reach : 0.5 * samples.along.norm() + about;
  return distanceAt(solidOf(p.body(1 - side)), middle) > size + reach;
}

/// As of obstacles (RodContacts).
std::span<const SamplePoint> TouchingBodies::pointsFor(int r, int b) const {
  std::vector<SamplePoint> &found = points_[{r, b}];
  if (!found.empty()) return found;
  const ContactSettings &contact = scene_.rods[std::size_t(r)].contact;
  const RodRange &rod = elements_.rods[std::size_t(r)];
  double longest = 0;
  for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) longest = std::max(longest, elements_.restLength()[s]);
  return found = samplePoints(contact.quadrature, longest, sampleSpacing(solidOf(b), contact));
}

/// Of an edge and a body as wide as that of the rod, with what presses on either; of two bodies as wide as both in the
/// mean, and as stiff as the stiffer one.
NormalLaw TouchingBodies::makeLaw(const TouchingPair &p) const {
  const auto borne = borne_.find(p.things());
  const double part = borne == borne_.end() ? 1 : borne->second;
  if (p.isOfBodies()) {
    ContactSettings both = settingsOf(p, 0);
    both.distance = 0.5 * (both.distance + settingsOf(p, 1).distance);
    const double force = std::max(solids_[std::size_t(p.body(0))].force, solids_[std::size_t(p.body(1))].force);
    return {both, part * force};
  }
  const int edge = p.isBody(0) ? 1 : 0, r = p.rodOf(edge);
  const ContactSettings &contact = settingsOf(p, edge);
  if (!contact.isBarrier() || contact.stiffness > 0) return {contact, contact.stiffness};
  const double force = load_[std::size_t(r)] + solids_[std::size_t(p.body(1 - edge))].force;
  return {contact, part * barrierStiffness(scene_, elements_, force, 0, static_, r, contact.on_surface)};
}

/// What is drawn touching is not thrown off: two that touch press on each other by no more than the lesser load.
void TouchingBodies::bearAsDrawn() {
  constexpr double least = 1e-3;
  makeRoom(configurationOf(initialState(scene_, elements_), scene_, elements_, 0), nullptr, 0);
  take();
  std::map<std::pair<int, int>, double> pressed, load;
  for (const TouchingPair &p : pairs_.items) {
    const auto key = p.things();
    double least_load = HUGE_VAL;
    bool fixed = !p.isOfBodies();
    for (const int side : {0, 1}) {
      const double given = settingsOf(p, side).stiffness;
      if (p.isBody(side)) {
        least_load = std::min(least_load, loadOn(scene_, elements_, p.body(side)));
        if (p.isOfBodies()) fixed = fixed || given > 0;
      } else {
        least_load = std::min(least_load, load_[std::size_t(p.rodOf(side))]);
        fixed = given > 0;
      }
    }
    if (fixed) continue;
    load[key] = least_load;
    visit(p, start_, lawOf(p).reach(),
          [&](const TouchingSolid &t) { pressed[key] -= t.weight * lawOf(p)(t.gap).slope; });
  }
  for (const auto &[key, sum] : pressed)
    if (sum > load[key] && std::isfinite(sum)) borne_[key] = std::max(load[key] / sum, least);
}

double TouchingBodies::widthOf(const TouchingPair &p) const {
  if (p.isOfBodies()) return 0.5 * (settingsOf(p, 0).distance + settingsOf(p, 1).distance);
  const ContactSettings &rod = settingsOf(p, p.isBody(0) ? 1 : 0);
  return rod.isBarrier() ? rod.distance : -wallOf(p);
}

double TouchingBodies::wallOf(const TouchingPair &p) const {
  if (p.isOfBodies()) return -0.5 * widthOf(p);
  const int edge = p.isBody(0) ? 1 : 0;
  return settingsOf(p, edge).wall(solidOf(p.body(1 - edge)));
}

double TouchingBodies::smallestGap(const Configuration &c, int r) const {
  double least = HUGE_VAL;
  for (const TouchingPair &p : pairs_.of({r, r + 1}))
    visit(p, c, least, [&](const TouchingSolid &t) { least = std::min(least, t.gap); });
  return least;
}

double TouchingBodies::freeFraction(const Configuration &from, const Configuration &to, int r) const {
  double free = 1;
  if (!isInRoom(from, to, 1, r)) {
    ++bounded_[std::size_t(r)];
    free = largestPart([&](double part) { return isInRoom(from, to, part, r); });
  }
  for (const TouchingPair &p : pairs_.of({r, r + 1})) {
    const double wall = wallOf(p), width = widthOf(p);
    for (const int side : {0, 1}) {
      if (!p.isBody(1 - side)) continue;
      const int body = p.body(1 - side);
      const Side before = sideOf(p, side, poseOf(body, from), from), after = sideOf(p, side, poseOf(body, to), to);
      double longest = 0;
      if (before.skin)
        longest = HUGE_VAL; // few are: their ways are looked at
      else if (before.points)
        longest = std::max((after.first - before.first).norm(),
                           (after.first + after.along - before.first - before.along).norm());
      else
        longest = (after.first - before.first).norm() +
                  (after.turned - before.turned).norm() * solids_[std::size_t(p.body(side))].reach;
      if (isAway(p, side, before, longest + 0.2 * width)) continue;
      for (int k = 0; k < before.count; ++k) {
        const Vec3 x = before.at(k), way = after.at(k) - x;
        const double gap = distanceAt(solidOf(body), x) - before.radiusAt(k);
        if (gap - wall > way.norm() + 0.2 * width) continue;
        free = std::min(free, freeWay(solidOf(body), x, way, before.radiusAt(k), gap, wall, width));
      }
    }
  }
  return free;
}

std::vector<BodyMeeting> TouchingBodies::tightest(const Configuration &c) const {
  makeRoom(c, nullptr, 0);
  take();
  std::map<std::pair<int, int>, BodyMeeting> least;
  for (const TouchingPair &p : pairs_.items)
    visit(p, c, lawOf(p).reach(), [&](const TouchingSolid &t) {
      BodyMeeting &m = least[p.things()];
      if (t.gap >= m.gap) return;
      m = {-1, -1, p.body(t.solid()), t.gap, 0, wallOf(p), widthOf(p)};
      if (p.isBody(t.side)) {
        m.other = p.body(t.side);
        return;
      }
      m.rod = p.rodOf(t.side);
      const RodRange &rod = elements_.rods[std::size_t(m.rod)];
      for (int i = 0; i < p.edgeOf(t.side); ++i) m.arc += elements_.restLength()[rod.slot(i)];
      m.arc += t.at * elements_.restLength()[rod.slot(p.edgeOf(t.side))];
    });
  std::vector<BodyMeeting> found;
  for (const auto &[things, m] : least) found.push_back(m);
  std::stable_sort(found.begin(), found.end(),
                   [](const BodyMeeting &a, const BodyMeeting &b) { return a.gap < b.gap; });
  return found;
}

std::vector<BodyMeeting> tightestAmongBodies(const Scene &scene, const Elements &elements, const Configuration &c) {
  if (!scene.touchesBodies()) return {};
  return TouchingBodies(scene, elements).tightest(c);
}

} // namespace tendril
