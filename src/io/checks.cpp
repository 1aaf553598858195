#include "tendril/io/checks.hpp"

#include "tendril/contact/contact.hpp"
#include "tendril/contact/touching_bodies.hpp"
#include "tendril/contact/touching_rods.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/embedding/embedding.hpp"
#include "tendril/io/mode_output.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// A rod that nothing holds, itself or by what junctions join it to, has no equilibrium to find.
void requireHeld(const Scene &scene) {
  std::vector<int> first(scene.rods.size()); // of the rods that are joined
  for (int r = 0; r < int(first.size()); ++r) first[r] = r;
  auto rootOf = [&](int r) {
    while (first[r] != r) r = first[r] = first[first[r]];
    return r;
  };
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) first[rootOf(m.rod)] = rootOf(j.members.front().rod);
  for (const Constraint &c : scene.constraints)
    if (c.isPin() && !c.isToWorld() && c.stiffness > 0)
      first[rootOf(c.rod)] = rootOf(c.isTie() ? c.to_rod : scene.bodies[c.to_body].rod);
  for (const Attachment &a : scene.attachments) first[rootOf(a.rod)] = rootOf(scene.bodies[a.body].rod);
  for (const Joint &j : scene.joints)
    if (j.parent >= 0) first[rootOf(j.rod)] = rootOf(scene.bodies[j.parent].rod);
  for (const Tendon &t : scene.tendons)
    for (const int r : scene.rodsOf(t)) first[rootOf(t.rod)] = rootOf(r);
  std::vector<char> held(scene.rods.size(), false);
  for (const Support &s : scene.supports)
    if (s.holdsPosition()) held[rootOf(s.rod)] = true;
  for (const Constraint &c : scene.constraints)
    if (c.isPin() && c.isToWorld() && c.stiffness > 0) held[rootOf(c.rod)] = true;
  for (const Tendon &t : scene.tendons)
    if ((t.actuator.stiffness > 0 || t.actuator.rigid) &&
        std::any_of(t.points.begin(), t.points.end(), [](const Waypoint &p) { return p.isTold(); }))
      held[rootOf(t.rod)] = true;
  for (int r = 0; r < int(scene.rods.size()); ++r)
    if (scene.touches(r) || scene.rods[r].contact.touchesMoving())
      held[rootOf(r)] = true; // what obstacles, other rods and bodies hold shows
  for (int b = 0; b < int(scene.bodies.size()); ++b)
    if (scene.touchesBody(b)) held[rootOf(scene.bodies[b].rod)] = true;
  std::vector<char> tied(scene.bodies.size(), false);
  for (const Attachment &a : scene.attachments) tied[a.body] = true;
  for (const Constraint &c : scene.constraints)
    if (c.isToBody() && c.isPin() && c.stiffness > 0) tied[c.to_body] = true;
  for (const Joint &j : scene.joints) tied[j.child] = true;
  for (const Joint &j : scene.joints)
    if (j.parent >= 0) tied[j.parent] = true;
  for (int b = 0; b < int(tied.size()); ++b)
    if (!tied[b] && !scene.isPressed(b))
      throw SceneError(
          "body '" + scene.bodies[b].name +
          "' is free to move: -mode static needs a weld or pin, exact or with a stiffness, that ties it to "
          "a rod, or a joint, or write 'fixed: true'");
  for (int r = 0; r < int(scene.rods.size()); ++r)
    if (!held[rootOf(r)])
      throw SceneError("rod '" + scene.rods[r].name +
                       "' is free to move as a whole: -mode static needs a clamp, pins or constraints that hold every "
                       "rod, or one that it is joined to; dampers hold nothing");
}

/// Where a rod begins to touch moves with the edges: errors do not fall with the square of their length.
void refuseWithObstacles(const Options &o) {
  const bool arc = !o.loop.dynamic && o.loop.continuation == Continuation::arclength;
  const bool estimates = o.error_estimate && !o.loop.dynamic;
  if (!o.accuracy && !estimates && !arc) return;
  const std::string option = arc ? "-continuation arclength" : o.accuracy ? "-accuracy" : "-error_estimate";
  throw SceneError("option " + option + ": is not for scenes with 'colliders' or rods that touch each other yet; " +
                   (arc ? "take load steps" : "compare runs with -rod_edges, and with other values of -dt"));
}

/// Impacts of bodies are sudden: methods that remember velocities throw them back with more.
void tellOfImpacts(const Scene &scene, const Options &o, std::vector<std::string> *notes) {
  const std::string &name = o.loop.integrator.name;
  for (int b = 0; b < int(scene.bodies.size()); ++b)
    if (o.loop.dynamic && name != "euler" && scene.touchesBody(b))
      return notes->push_back("warning: -integrator " + name + " throws bodies, as '" + scene.bodies[b].name +
                              "', back from obstacles by more or less than they have come with; euler does not, nor "
                              "does 'contact: {normal_damping: ...}' in short steps");
}

/// Friction of bodies is taken anew with every step, and in statics nothing would hold it.
void refuseFrictionOfBodies(const Scene &scene, const Options &o) {
  for (int b = 0; b < int(scene.bodies.size()); ++b)
    if (!o.loop.dynamic && scene.touchesBody(b) && !scene.colliders.empty() && scene.bodies[b].contact.friction > 0)
      throw SceneError("body '" + scene.bodies[b].name +
                       "' has friction with colliders, which acts on bodies in steps of time only; write 'contact: "
                       "{friction: 0}' in its block, or take -mode dynamic");
}

/// The same of rigid tendons.
void refuseWithRigidTendons(const Scene &scene, const Options &o) {
  const std::string &name = o.loop.integrator.name;
  for (const Tendon &t : scene.tendons) {
    if (!t.actuator.rigid) continue;
    if (o.loop.dynamic && name != "euler" && name != "bdf2")
      throw SceneError("option -integrator " + name + ": does not hold tendon '" + t.name +
                       "', which is rigid, at the ends of its steps; take euler or bdf2, or give it a 'stiffness'");
    if (const double target = t.actuator.inputAt(0);
        o.loop.dynamic && (target < 0 || (target > 0 && t.actuator.compression)))
      throw SceneError("tendon '" + t.name + "': it is rigid, its target begins at " + shortText(target) +
                       " and it is drawn at 0, from where all would jump in the first step; write a 'table' that "
                       "begins at 0, or give it a 'stiffness'");
  }
}

/// Methods whose stages do not end with their steps hold joints exactly within them only, and their forces swing.
void refuseWithJoints(const Scene &scene, const Options &o, std::vector<std::string> *notes) {
  const std::string &name = o.loop.integrator.name;
  const auto exact = std::find_if(scene.joints.begin(), scene.joints.end(), [](const Joint &j) {
    return j.isExact() || (j.driven && j.drive_stiffness < 0) || (j.hasRange() && j.range_stiffness < 0);
  });
  if (!o.loop.dynamic || exact == scene.joints.end()) return;
  if (name == "midpoint" || name == "symplectic2" || name == "energy_momentum" || name == "sdirk23")
    throw SceneError("option -integrator " + name + ": does not hold joint '" + exact->name +
                     "', which is exact, at the ends of its steps; take bdf2 or generalized_alpha, or give the "
                     "joint (its drive, its range) a stiffness");
  for (const Joint &j : scene.joints)
    if (j.driven && j.drive_stiffness < 0 && j.targetAt(0) != 0)
      throw SceneError("joint '" + j.name + "': its exact drive begins at " + shortText(j.targetAt(0)) +
                       " and the bodies are drawn at 0, from where they would jump in the first step; write a 'table' "
                       "that begins at 0, draw them there, or give the drive a 'stiffness'");
  for (const Joint &j : scene.joints)
    if (j.hasRange() && j.range_stiffness < 0 && name != "euler")
      throw SceneError("option -integrator " + name + ": joint '" + j.name +
                       "' has an exact 'range', whose end would throw it back by what the method remembers of its "
                       "velocity; take euler, or give a 'range_stiffness'");
  if (name == "generalized_alpha")
    notes->push_back("warning: -integrator generalized_alpha gains energy with exact joints, as '" + exact->name +
                     "', in steps that do not resolve their motion; bdf2 does not");
  if (name.rfind("sdirk", 0) == 0)
    notes->push_back("warning: -integrator " + name + " is of first order with exact joints, as '" + exact->name +
                     "'; bdf2 and generalized_alpha keep their second order");
}

/// Methods that go on beyond the middle of a step may go through rods there.
void refuseWithRodContact(const Scene &scene, const Options &o) {
  if (!scene.touchesMoving()) return;
  const std::string &name = o.loop.integrator.name;
  if (o.loop.dynamic && (name == "midpoint" || name == "symplectic2" || name == "energy_momentum" || name == "sdirk23"))
    throw SceneError("option -integrator " + name +
                     ": is not for rods that touch each other or bodies ('contact: {rods: ...}', '{bodies: true}'), "
                     "which the ends of its steps may go through; take euler, bdf2 or generalized_alpha");
}

} // namespace

void checkScene(const Scene &scene, const Options &o, std::vector<std::string> *notes) {
  if (o.model_check && (!o.restart.empty() || (!o.loop.dynamic && o.loop.continuation == Continuation::arclength)))
    throw SceneError("option -model_check: runs the scene again from its start, in steps of time or load; take "
                     "-restart and -continuation arclength away");
  if (o.modes > 0) checkModes(scene, o);
  if (!o.loop.dynamic && !(o.modes > 0 && !o.buckling && isAlone(scene))) requireHeld(scene);
  if (o.loop.dynamic && !scene.rotation.angular_velocity.isZero(0))
    throw SceneError("scene key 'rotation': is for -mode static, a scene at rest in a frame that turns; in dynamics "
                     "let supports turn by their motion");
  if (o.bifurcation && o.loop.bifurcation != Bifurcation::off && scene.hasCouples())
    throw SceneError(
        "option -bifurcation: a scene with couples or follower forces has no potential whose Hessian could tell "
        "stability; use off");
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength) requireDeadLoads(scene);
  for (const Constraint &c : scene.constraints)
    if (!c.isPin() && (o.accuracy || (o.error_estimate && !o.loop.dynamic)))
      throw SceneError(
          std::string("option ") + (o.accuracy ? "-accuracy" : "-error_estimate") + ": constraint '" + c.name +
          "' turns an edge, whose middle moves when edges change: errors do not fall with the square of their "
          "length; take a clamp, or compare runs with -rod_edges");
  if (!scene.colliders.empty() || scene.touchesMoving()) refuseWithObstacles(o);
  refuseWithRodContact(scene, o);
  refuseWithJoints(scene, o, notes);
  refuseWithRigidTendons(scene, o);
  refuseFrictionOfBodies(scene, o);
  tellOfImpacts(scene, o, notes);
  if (o.accuracy && scene.isJoined())
    throw SceneError("option -accuracy: chooses the edges of each rod by itself, and is not for rods that 'junctions', "
                     "'bodies' or 'constraints' join yet; compare runs with -rod_edges, or take -error_estimate");
  if (o.accuracy && o.accuracy->of == Quantity::tip)
    for (const Rod &rod : scene.rods)
      if (rod.closed)
        throw SceneError("option -accuracy_of: rod '" + rod.name + "' is closed and has no tip; use position");
}

void refuseTearing(const Simulation &run) {
  const Scene &scene = run.scene;
  const Configuration c = configurationOf(run.state, scene, *run.elements, run.state.time);
  for (int k = 0; k < int(scene.joints.size()); ++k) {
    const Joint &joint = scene.joints[std::size_t(k)];
    if (!joint.isExact()) continue;
    const double apart = tearingOf(scene, *run.elements, k, run.state, c);
    const BodyRate &rate = run.state.body_rate[std::size_t(joint.child)];
    const double size = run.elements->bodySize(joint.child);
    if (apart > 1e-6 * (rate.translation.norm() + size * rate.spin.norm()) && apart > 1e-9 * size)
      throw SceneError("joint '" + joint.name + "': body '" + scene.bodies[std::size_t(joint.child)].name +
                       "' moves away from it by " + shortText(apart) +
                       " m/s at the start, which an exact joint cannot let it; its 'velocity' is that of its centre of "
                       "mass: of a body that turns about a point, angular_velocity x (centre - point)");
  }
}

/// Obstacles that stand whole within a skin are touched by none of its points.
static void refuseWithinSkins(const Scene &scene) {
  for (const Rod &rod : scene.rods) {
    if (!rod.contact.on || !rod.contact.on_surface) continue;
    std::vector<std::string> names;
    std::vector<Vec3> middles;
    auto isSolid = [](const std::string &kind) {
      return kind == "sphere" || kind == "capsule" || kind == "cylinder" || kind == "box";
    };
    for (int k = 0; k < int(scene.colliders.size()); ++k) {
      const Collider &c = scene.colliders[std::size_t(k)];
      const std::vector<int> &passes = rod.contact.passes;
      if (!isSolid(c.kind) || std::find(passes.begin(), passes.end(), k) != passes.end()) continue;
      names.push_back("collider '" + c.name + "'");
      middles.push_back(c.position);
    }
    for (const Body &b : scene.bodies) {
      if (!isSolid(b.shape) || !rod.contact.touchesBodies() || !b.contact.touchesBodies() ||
          rod.contact.isApartFrom(b.contact))
        continue;
      names.push_back("body '" + b.name + "'");
      middles.push_back(b.position);
    }
    if (middles.empty()) continue;
    const std::vector<bool> inside = isInside(rod, skinOf(rod), middles);
    for (std::size_t k = 0; k < inside.size(); ++k)
      if (inside[k])
        throw SceneError(
            names[k] + " has its middle within the skin of rod '" + rod.name +
            "' as drawn; move one of them, write 'contact: none', or name both in 'contact: {ignore: ...}'");
  }
}

void refuseOverlaps(const Simulation &run) {
  const Scene &scene = run.scene;
  const Configuration drawn = configurationOf(run.state, scene, *run.elements, run.state.time);
  if (const std::vector<Meeting> rods = overlapsOfRods(scene, *run.elements, drawn); !rods.empty()) {
    const Meeting &m = rods.front();
    const Rod &one = scene.rods[std::size_t(m.rod)], &other = scene.rods[std::size_t(m.to_rod)];
    throw SceneError(
        "rod '" + one.name + "' at arc length " + shortText(m.arc) + " m lies " + shortText(-m.gap) + " m deep in " +
        (m.rod == m.to_rod ? "itself" : "rod '" + other.name + "'") + " at " + shortText(m.to_arc) +
        " m as it is drawn" +
        (rods.size() > 1 ? ", and so do " + std::to_string(rods.size() - 1) + " more pairs of edges" : "") +
        "; move them " + shortText(-m.gap) +
        " m or more apart, give them a smaller 'contact: {radius: "
        "...}', or write 'contact: {rods: " +
        (m.rod == m.to_rod ? "others}'" : "none}' for one of them"));
  }
  for (const BodyMeeting &m : tightestAmongBodies(scene, *run.elements, drawn)) {
    if (m.gap > m.wall + 0.05 * m.width) continue;
    const std::string name = scene.bodies[std::size_t(m.body)].name;
    throw SceneError((m.rod < 0 ? "body '" + scene.bodies[std::size_t(m.other)].name + "' is drawn "
                                : "rod '" + scene.rods[std::size_t(m.rod)].name + "' at arc length " +
                                      shortText(m.arc) + " m is drawn ") +
                     shortText(-m.gap) + " m deep in body '" + name + "'; move one of them by " +
                     shortText(m.wall - m.gap + 0.5 * m.width) + " m or more, or name both in 'contact: {ignore: [{" +
                     (m.rod < 0 ? "bodies: ..., to_bodies: ...}]}'" : "rods: ..., bodies: ...}]}'"));
  }
  for (const Touch &o : tightestOfBodies(scene, *run.elements, drawn))
    if (const Body &body = scene.bodies[std::size_t(o.rod)]; o.gap < -0.45 * body.contact.distance)
      throw SceneError("body '" + body.name + "' is drawn " + shortText(-o.gap) + " m deep in collider '" +
                       scene.colliders[std::size_t(o.collider)].name +
                       "'; move one of them, or write 'contact: none' "
                       "in the block of the body");
  if (run.state.step == 0) refuseWithinSkins(scene);
  for (const Touch &o : tightest(scene, *run.elements, drawn)) {
    const ContactSettings &contact = scene.rods[o.rod].contact;
    const double wall = contact.wall(*scene.colliders[o.collider].shape);
    if (o.gap > wall) continue;
    throw SceneError(
        "rod '" + scene.rods[o.rod].name + "' lies " + shortText(-o.gap) + " m deep in collider '" +
        scene.colliders[o.collider].name + "' at its start, at arc length " + shortText(o.arc) +
        " m; move one of them by " + shortText(wall - o.gap + 0.5 * contact.distance) + " m or more" +
        (-o.gap < contact.radius && !contact.on_surface
             ? ", give the rod a smaller 'contact: {radius: ...}' than " + shortText(contact.radius) + " m,"
             : std::string()) +
        " or write 'contact: none'");
  }
}

std::vector<std::string> notesOnContact(const Simulation &run) {
  constexpr double longest = 20; // radii
  std::vector<std::string> notes;
  auto slides = [](const Body &b) { return b.contact.on && b.contact.slides(); };
  for (const Collider &c : run.scene.colliders)
    if (c.friction > 0 && !run.scene.slides() && std::none_of(run.scene.bodies.begin(), run.scene.bodies.end(), slides))
      notes.push_back(
          "warning: collider '" + c.name + "' has the friction " + shortText(c.friction) +
          " and no rod or body has any: of both the geometric mean counts; write 'contact: {friction: ...}', too");
  for (int r = 0; r < int(run.scene.rods.size()); ++r) {
    const ContactSettings &contact = run.scene.rods[r].contact;
    if (!(run.scene.touches(r) || contact.touchesMoving()) || contact.radius == 0) continue;
    const RodRange &rod = run.elements->rods[r];
    const double *const rest = run.elements->restLength();
    const double edge = *std::max_element(rest + rod.first_slot, rest + rod.edgeEnd());
    if (edge >= longest * contact.radius * (1 - 1e-9))
      notes.push_back(
          "warning: rod '" + run.scene.rods[r].name + "' has edges of up to " + shortText(edge / contact.radius) +
          " of its radii: it may miss obstacles that are smaller, and is felt as a chain of straight pieces; "
          "take shorter edges");
    if (const double apart = edge / most_samples, wanted = spacingOfSamples(contact.radius, contact.distance);
        contact.touchesRods() && contact.isBarrier() && apart > 1.01 * wanted)
      notes.push_back(
          "warning: rod '" + run.scene.rods[r].name + "' has edges of up to " + shortText(edge) +
          " m and feels other rods at points " + shortText(apart) + " m apart, where its barrier of " +
          shortText(contact.distance) + " m wants " + shortText(wanted) +
          " m: other rods may stop between them; take shorter edges or a larger 'contact: {distance: ...}'");
    if (contact.quadrature == 0) continue;
    const double apart = contact.on_surface
                             ? measureOf(run.scene.rods[r], skinOf(run.scene.rods[r])).side /
                                   std::sqrt(std::max(contact.quadrature, 1)) // as many points along a side, about
                             : edge / contact.quadrature;
    for (const Collider &c : run.scene.colliders)
      if (const double across = 2 * (c.shape->depth() + contact.padding()); apart > across)
        notes.push_back("warning: rod '" + run.scene.rods[r].name + "' touches by points up to " + shortText(apart) +
                        " m apart and may miss collider '" + c.name + "', with it " + shortText(across) +
                        " m across: take " + (contact.on_surface ? "smaller triangles" : "'quadrature: auto'") +
                        " or shorter edges");
      else if (const double wanted = sampleSpacing(*c.shape, contact); contact.on_surface && apart > 2 * wanted)
        notes.push_back("warning: rod '" + run.scene.rods[r].name + "' touches by points up to " + shortText(apart) +
                        " m apart, where collider '" + c.name + "' asks for " + shortText(wanted) +
                        " m: it may sink in between; take smaller triangles, shorter edges or a larger 'distance'");
  }
  return notes;
}

} // namespace tendril
