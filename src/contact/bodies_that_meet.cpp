/// Which edges and bodies may touch each other in a step.
#include "tendril/contact/touching_bodies.hpp"

#include <algorithm>

namespace tendril {

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

/// Adds a pair, of which the later rod has the first side.
void TouchingBodies::addPair(int rod, int edge, std::array<int, 2> slot, int to_rod, int to_edge,
                             std::array<int, 2> to_slot) const {
  if (rod < to_rod) {
    std::swap(rod, to_rod);
    std::swap(edge, to_edge);
    std::swap(slot, to_slot);
  }
  pairs_.items.push_back({rod, edge, to_rod, to_edge, {slot[0], slot[1], to_slot[0], to_slot[1]}});
}

/// Adds what a body may touch: edges, and the bodies before it.
void TouchingBodies::takePairsOf(int b) const {
  const Configuration &c = start_;
  const Solid &solid = solids_[std::size_t(b)];
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
        addPair(r, i, {rod.slot(i), rod.slot((i + 1) % rod.vertices)}, body.rod, TouchingPair::ofBody(b),
                {body.position, body.rotation});
    }
  }
  for (int other = 0; other < b; ++other) {
    if (!mayTouch(b, other)) continue;
    const JoinedBody &to = elements_.body(other);
    const double width =
        0.5 * (scene_.bodies[std::size_t(b)].contact.distance + scene_.bodies[std::size_t(other)].contact.distance);
    if (isNear(c.positionAt(to.position), solids_[std::size_t(other)].reach + width + body_room_[std::size_t(other)]))
      addPair(body.rod, TouchingPair::ofBody(b), {body.position, body.rotation}, to.rod, TouchingPair::ofBody(other),
              {to.position, to.rotation});
  }
}

/// Numbers the pairs, with their laws and samples, and notes which follow each other along a rod.
void TouchingBodies::numberPairs() const {
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

/// All edges are looked at for every body that may be near: what bodies there are is few.
void TouchingBodies::take() const {
  pairs_ = {};
  for (int b = 0; b < int(solids_.size()); ++b)
    if (solids_[std::size_t(b)].shape) takePairsOf(b);
  pairs_.sort(scene_.rods.size());
  numberPairs();
}

} // namespace tendril
