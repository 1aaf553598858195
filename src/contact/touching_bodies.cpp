#include "tendril/contact/touching_bodies.hpp"

#include "tendril/contact/contact.hpp"
#include "tendril/energy/load.hpp"

#include <algorithm>

namespace tendril {

static double distanceAt(const Shape &shape, const Vec3 &x) {
  const double *const point[3] = {&x[0], &x[1], &x[2]};
  double distance;
  shape.distances(point, 1, &distance);
  return distance;
}

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

double TouchingBodies::aboutAxis(int r, const Configuration &c) const {
  const SkinSamples &skin = skins_[std::size_t(r)];
  if (skin.empty()) return scene_.rods[std::size_t(r)].contact.radius;
  const RodRange &rod = elements_.rods[std::size_t(r)];
  double longest = 0;
  for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) longest = std::max(longest, c[Configuration::length][s]);
  return skin.arm() + skin.apart() * longest;
}

/// A rod that is tied to a body begins in it or at its surface.
void TouchingBodies::leaveOut() {
  auto leave = [&](int r, int vertex, int b) {
    const Rod &rod = scene_.rods[std::size_t(r)];
    const Body &body = scene_.bodies[std::size_t(b)];
    if (!rod.contact.touchesBodies() || !solids_[std::size_t(b)].shape) return;
    const RodRange &range = elements_.rods[std::size_t(r)];
    const double radius = rod.contact.radius, width = rod.contact.isBarrier() ? rod.contact.distance : 0,
                 least = std::max(pi * radius, radius + width);
    auto hasLeft = [&](int v, double arc) {
      const Vec3 x = body.rotation.transpose() * (rod.position[std::size_t(v)] - body.position);
      return arc >= least && solidOf(b).at(x).value > radius + width;
    };
    std::vector<int> &out = tied_[{r, b}];
    for (const int step : {1, -1}) {
      double arc = 0;
      for (int v = vertex, n = 0; n < range.edges && !hasLeft(v, arc); ++n) {
        int edge = step > 0 ? v : v - 1, next = v + step;
        if (range.closed) {
          edge = (edge + range.edges) % range.edges;
          next = (next + range.vertices) % range.vertices;
        } else if (edge < 0 || edge >= range.edges)
          break;
        out.push_back(edge);
        arc += elements_.restLength()[range.slot(edge)];
        v = next;
      }
    }
  };
  for (const Attachment &a : scene_.attachments) leave(a.rod, a.vertex, a.body);
  for (const Constraint &c : scene_.constraints)
    if (c.isToBody() && c.isPin()) leave(c.rod, c.at, c.to_body);
  for (const Joint &j : scene_.joints)
    if (j.parent >= 0) jointed_.push_back(std::minmax(j.child, j.parent));
}

bool TouchingBodies::mayTouch(int r, int edge, int b) const {
  const ContactSettings &rod = scene_.rods[std::size_t(r)].contact, &body = scene_.bodies[std::size_t(b)].contact;
  if (!rod.touchesBodies() || !solids_[std::size_t(b)].shape || rod.isApartFrom(body)) return false;
  const auto tied = tied_.find({r, b});
  return tied == tied_.end() || std::find(tied->second.begin(), tied->second.end(), edge) == tied->second.end();
}

bool TouchingBodies::mayTouch(int a, int b) const {
  return solids_[std::size_t(a)].shape && solids_[std::size_t(b)].shape &&
         !scene_.bodies[std::size_t(a)].contact.isApartFrom(scene_.bodies[std::size_t(b)].contact) &&
         std::find(jointed_.begin(), jointed_.end(), std::pair<int, int>(std::minmax(a, b))) == jointed_.end();
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
  const double about = samples.skin ? aboutAxis(p.rodOf(side), *samples.c) : samples.radius,
               size = samples.samples ? solids_[std::size_t(p.body(side))].reach : 0.5 * samples.along.norm() + about;
  return distanceAt(solidOf(p.body(1 - side)), middle) > size + reach;
}

/// Neither of rods nor of bodies beside one that it may have a pair with is far from where all were looked for.
bool TouchingBodies::isInRoom(const Configuration &from, const Configuration &to, double part, int r) const {
  auto moved = [&](int slot) {
    return Vec3(from.displacementAt(slot, start_) + part * to.displacementAt(slot, from)).norm();
  };
  const RodRange &rod = elements_.rods[std::size_t(r)];
  for (int i = 0; i < rod.vertices && scene_.rods[std::size_t(r)].contact.touchesBodies(); ++i)
    if (!(moved(rod.slot(i)) <= rod_room_[std::size_t(r)])) return false;
  for (const JoinedBody &b : elements_.bodies({r, r + 1})) {
    const Solid &solid = solids_[std::size_t(b.body)];
    if (!solid.shape) continue;
    const Mat3 before = from.rotationAt(b.rotation),
               turned = before + part * (to.rotationAt(b.rotation) - before) - start_.rotationAt(b.rotation);
    if (!(moved(b.position) + turned.norm() * solid.reach <= body_room_[std::size_t(b.body)])) return false;
  }
  return true;
}

void TouchingBodies::makeRoom(const Configuration &start, const Planes *way, double room) const {
  start_ = start;
  rod_room_.assign(scene_.rods.size(), 0);
  body_room_.assign(scene_.bodies.size(), 0);
  for (std::size_t r = 0; r < scene_.rods.size(); ++r) {
    const RodRange &rod = elements_.rods[r];
    double most = 0;
    for (int i = 0; i < rod.vertices && way; ++i) most = std::max(most, way->vector(0, rod.slot(i)).norm());
    rod_room_[r] = most + room * std::max(scene_.rods[r].contact.radius, std::min(most, elements_.length(int(r))));
  }
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    const JoinedBody &body = elements_.body(int(b));
    const double reach = solids_[b].reach, turn = way ? way->vector(0, body.rotation).norm() : 0,
                 most = way ? way->vector(0, body.position).norm() + 1.5 * turn * reach : 0; // of matrices' norms
    body_room_[b] = most + room * std::max(0.02 * reach, std::min(most, 2 * reach));
  }
}

void TouchingBodies::find(const Configuration &start, const Planes &way, const Step &step, double room) {
  static_ = step.isStatic();
  makeRoom(start, &way, room);
  take();
  std::fill(bounded_.begin(), bounded_.end(), 0);
}

void TouchingBodies::addRooms(int r, std::vector<Box> &rooms) const {
  const ContactSettings &contact = scene_.rods[std::size_t(r)].contact;
  const RodRange &rod = elements_.rods[std::size_t(r)];
  const double away = aboutAxis(r, start_) + NormalLaw(contact, contact.stiffness).reach() +
                      skins_[std::size_t(r)].gain() * rod_room_[std::size_t(r)];
  Box room;
  for (int i = 0; i < rod.vertices; ++i) room.include(start_.positionAt(rod.slot(i)));
  if (contact.touchesBodies()) rooms.push_back(room.widened(away));
  for (const JoinedBody &b : elements_.bodies({r, r + 1}))
    if (const Solid &solid = solids_[std::size_t(b.body)]; solid.shape)
      rooms.push_back(Box{start_.positionAt(b.position), start_.positionAt(b.position)}.widened(
          solid.reach + scene_.bodies[std::size_t(b.body)].contact.distance + body_room_[std::size_t(b.body)]));
}

void TouchingBodies::cover(const Configuration &c, int r) const {
  if (!start_.empty() && isInRoom(c, c, 0, r)) return;
  makeRoom(c, nullptr, 1);
  take();
}

/// All edges are looked at for every body that may be near: what bodies there are is few.
void TouchingBodies::take() const {
  pairs_ = {};
  const Configuration &c = start_;
  auto add = [&](int rod, int edge, std::array<int, 2> slot, int to_rod, int to_edge, std::array<int, 2> to_slot) {
    if (rod < to_rod) {
      std::swap(rod, to_rod);
      std::swap(edge, to_edge);
      std::swap(slot, to_slot);
    }
    pairs_.items.push_back({rod, edge, to_rod, to_edge, {slot[0], slot[1], to_slot[0], to_slot[1]}});
  };
  for (int b = 0; b < int(solids_.size()); ++b) {
    const Solid &solid = solids_[std::size_t(b)];
    if (!solid.shape) continue;
    const JoinedBody &body = elements_.body(b);
    const Collider::Pose pose = poseOf(b, c);
    const Vec3 centre = c.positionAt(body.position);
    const double room = body_room_[std::size_t(b)];
    auto isNear = [&](const Vec3 &x, double size) {
      if ((x - centre).norm() > solid.reach + size + room) return false;
      return distanceAt(*solid.shape, pose.toLocal(x)) <= size + room;
    };
    for (int r = 0; r < int(scene_.rods.size()); ++r) {
      const ContactSettings &contact = scene_.rods[std::size_t(r)].contact;
      if (!contact.touchesBodies()) continue;
      const RodRange &rod = elements_.rods[std::size_t(r)];
      const double away = aboutAxis(r, c) + NormalLaw(contact, contact.stiffness).reach() +
                          skins_[std::size_t(r)].gain() * rod_room_[std::size_t(r)];
      for (int i = 0; i < rod.edges; ++i) {
        const Vec3 along = c.edges<double>(rod.slot(i));
        if (isNear(c.positionAt(rod.slot(i)) + 0.5 * along, 0.5 * along.norm() + away) && mayTouch(r, i, b))
          add(r, i, {rod.slot(i), rod.slot((i + 1) % rod.vertices)}, body.rod, TouchingPair::ofBody(b),
              {body.position, body.rotation});
      }
    }
    for (int other = 0; other < b; ++other) {
      if (!mayTouch(b, other)) continue;
      const JoinedBody &to = elements_.body(other);
      const double width =
          0.5 * (scene_.bodies[std::size_t(b)].contact.distance + scene_.bodies[std::size_t(other)].contact.distance);
      if (isNear(c.positionAt(to.position), solids_[std::size_t(other)].reach + width + body_room_[std::size_t(other)]))
        add(body.rod, TouchingPair::ofBody(b), {body.position, body.rotation}, to.rod, TouchingPair::ofBody(other),
            {to.position, to.rotation});
    }
  }
  pairs_.sort(scene_.rods.size());
  laws_.clear();
  points_of_.clear();
  next_.clear();
  before_.clear();
  std::map<std::array<int, 3>, int> by_edge; // of a rod, with a body
  of_rod_.assign(scene_.rods.size(), {});
  for (TouchingPair &p : pairs_.items) {
    p.number = int(laws_.size());
    laws_.push_back(makeLaw(p));
    const int edge = p.isBody(0) ? 1 : 0;
    next_.push_back(-1);
    before_.push_back(-1);
    if (!p.isOfBodies()) by_edge[{p.rodOf(edge), p.edgeOf(edge), p.body(1 - edge)}] = p.number;
    points_of_.push_back(p.isOfBodies() ? std::span<const SamplePoint>() : pointsFor(p.rodOf(edge), p.body(1 - edge)));
    of_rod_[std::size_t(p.rod)].push_back(p.number);
    if (p.to_rod != p.rod) of_rod_[std::size_t(p.to_rod)].push_back(p.number);
  }
  for (const auto &[key, number] : by_edge) {
    const auto [r, edge, body] = key;
    if (skins_[std::size_t(r)].empty()) continue;
    const auto found = by_edge.find({r, (edge + 1) % elements_.rods[std::size_t(r)].vertices, body});
    if (found == by_edge.end()) continue;
    next_[std::size_t(number)] = found->second;
    before_[std::size_t(found->second)] = number;
  }
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
  return {contact, part * barrierStiffness(scene_, elements_, force, 0, static_, r)};
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
