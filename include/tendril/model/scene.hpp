#pragma once
/// \file scene.hpp
/// The scene: all that is fixed once set-up is done. Rods, what holds them, what pulls on them. Nothing here changes
/// during a run.

#include "tendril/model/body.hpp"
#include "tendril/model/contact.hpp"
#include "tendril/model/joint.hpp"
#include "tendril/model/material.hpp"
#include "tendril/model/rod_model.hpp"
#include "tendril/model/skin.hpp"
#include "tendril/model/strain.hpp"
#include "tendril/model/tendon.hpp"

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace tendril {

/// A mistake in the user's input. what() names the file and line (or the option), what was found and what to write.
struct SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
  virtual int exitCode() const { return 1; }
};
/// A number with three digits, for messages.
std::string shortText(double value);

/// Rod as drawn: the reference configuration. Vertex i and i+1 bound edge i; a closed rod has as many edges as
/// vertices.
struct Rod {
  std::string name, layer;
  bool closed = false;
  std::vector<Vec3> position; ///< reference positions (nv) [m]
  std::vector<Vec3> director; ///< first directors (ne), unit, normal to their edges
  Material material;
  Measure measure = Measure::tan;
  Energy energy = Energy::seed;
  RodModel model = RodModel::full;
  bool chooses_model = false;           ///< the smallest that is proven to do (settleModels)
  int flat = -1;                        ///< of a planar rod: the coordinate that stays; else -1
  std::array<double, 2> left_out{0, 0}; ///< flexural stiffness that the model `cable` does not count [N m^2]
  bool gravity = true;
  ContactSettings contact;
  std::shared_ptr<const SkinRecipe> skin; ///< null: none
  /// Natural curvature about the two directors and twist (each [1/m]) where the rod is not stress-free as drawn.
  enum class Natural { as_drawn, given } natural = Natural::as_drawn;
  Vec3 natural_strain = Vec3::Zero(); ///< (curvature 1, curvature 2, twist) for Natural::given; zero is a straight rod
  Vec3 initial_velocity = Vec3::Zero(); ///< [m/s]

  double initial_turns =
      0; ///< turns of twist put in at the start, spread by arc length; the natural shape does not have them

  int vertices() const { return int(position.size()); }
  int edges() const { return vertices() - (closed ? 0 : 1); }
  int next(int vertex) const { return vertex + 1 == vertices() ? 0 : vertex + 1; }
  Vec3 edge(int i) const { return position[next(i)] - position[i]; }
  double length() const; ///< of all edges [m]
  bool bends() const { return !material.isCable(); }
  bool twists() const { return bends() && model == RodModel::full; } ///< whether twists are unknowns
  /// Edge on the far side of a vertex (towards lower numbers), or -1 at the first vertex of an open rod; and the other
  /// way.
  int edgeBefore(int vertex) const { return vertex > 0 ? vertex - 1 : closed ? edges() - 1 : -1; }
  int edgeAfter(int vertex) const { return vertex < edges() ? vertex : -1; }
};

/// What holds a vertex. `clamp` holds its position, tangent and director by half cells to a fixed frame; `pin` its
/// position; `fix_twist` the twist of the rod there, by half cells, relative to the frame (a joint of constant
/// velocity: the tangent is free).
struct Support {
  enum class Kind { clamp, pin, fix_twist } kind;
  int rod, vertex;
  Motion motion;
  Frame frame;                                        ///< reference frame at the vertex (clamp, fix_twist); length 1
  bool tangent_given = false, director_given = false; ///< by the scene; otherwise the frame is that of the rod as drawn

  bool holdsPosition() const { return kind != Kind::fix_twist; }
  bool holdsTwist() const { return kind != Kind::pin; }
};
/// As scenes and files of results have it.
const char *nameOf(Support::Kind kind);

/// A spring with a damper between a rod and the world: `pin` draws a vertex to a point, `rotation` turns the frame of
/// an edge to a given one. With g the distance of the vertex, or the angle by which the frame is turned, it stores
/// stiffness/2 g^2; with a saturation s stiffness s (v^2 - v^3/3), v = g/s, until its force is stiffness s at g = s,
/// and by that force times g from there. The measure `sine` of a rotation stores stiffness (1 - cos g).
struct Constraint {
  enum class Kind { pin, rotation } kind;
  enum class Measure { angle, sine };
  std::string name;
  int rod, at;                      ///< vertex of a pin, edge of a rotation
  int to_rod = -1, to_vertex = -1;  ///< of a pin to another vertex, or -1
  int to_body = -1;                 ///< or to a body: `point` and `frame` are those of the body as drawn
  Vec3 point;                       ///< of a pin to the world, without its motion [m]
  Frame frame;                      ///< of a rotation, without its motion; length 1
  Motion motion;                    ///< of the point, or of the frame
  double stiffness;                 ///< [N/m] or [N m/rad]
  double damping = 0;               ///< [N s/m] or [N m s/rad]
  double saturation = -1;           ///< [m] or [rad]; none where negative
  Measure measure = Measure::angle; ///< of a rotation
  bool damps_motion = true;         ///< whether the damper moves with the point or frame, or stands still
  bool point_given = false, tangent_given = false, director_given = false; ///< by the scene, otherwise as drawn

  bool isPin() const { return kind == Kind::pin; }
  /// A pin to another vertex: both are drawn to each other.
  bool isTie() const { return to_rod >= 0; }
  bool isToBody() const { return to_body >= 0; }
  bool isToWorld() const { return !isTie() && !isToBody(); }
  /// What rows of a trajectory and the rods' own memory need room for, in slots.
  int slots() const { return isPin() ? 1 : 3; }
  Vec3 pointAt(double time) const { return point + motion.displacementAt(time); }
  Frame frameAt(double time) const {
    const Mat3 turn = motion.rotationAt(time);
    return {turn * frame.tangent, turn * frame.director, 1};
  }
};
const char *nameOf(Constraint::Kind kind);

/// Vertices of rods that are one point. Those of a group have one frame, too, a body without mass: every edge beside
/// them is tied to it by a half cell, stress-free as drawn. The others turn freely, and their own rod runs through.
struct Junction {
  struct Member {
    int rod, vertex;
    int group; ///< from 0 on, or -1 for none
  };
  std::string name;
  std::vector<Member> members;
  int groups = 0;
};

/// Dead loads, and point masses on vertices; torques act about the present tangent of their edge, moments are fixed in
/// space.
struct NodalForce {
  int rod, vertex;
  Vec3 force;      ///< [N]
  double mass = 0; ///< [kg]
};
/// A force that turns with the frame of the edge at its vertex; of two edges, half with either.
struct FollowerForce {
  int rod, vertex;
  Vec3 force; ///< along the first and the second director and the tangent [N]
  bool isTangential() const { return force[0] == 0 && force[1] == 0; }
};
struct EdgeMoment {
  int rod, edge;
  double torque; ///< about the tangent [N m]
  Vec3 moment;   ///< [N m]
};

struct Scene {
  std::vector<Rod> rods;
  std::vector<Support> supports;
  std::vector<Constraint> constraints;
  std::vector<Junction> junctions;
  std::vector<Body> bodies;      ///< that are free to move
  std::vector<Body> held_bodies; ///< those at rest, or that move as they are told: what is tied to them, supports hold
  std::vector<Attachment> attachments;
  std::vector<Joint> joints; ///< between bodies
  std::vector<Tendon> tendons;
  /// Gives every body its first rod, in the present order of rods: one that is tied to it, or to what joints and
  /// tendons join it to; and every tendon its own.
  void hostBodies();
  /// Bodies that a tendon pulls on, and rods, with those that bodies have; each once.
  std::vector<int> bodiesOf(const Tendon &tendon) const;
  std::vector<int> rodsOf(const Tendon &tendon) const;
  /// Whether tendons rub on what they run over; and of what State::tendon_memory has of all: the first of a tendon, of
  /// their number how many.
  bool tendonsRub() const;
  int firstMemory(int tendon) const;
  /// Whether a tendon runs through points beside the axis of a rod, which its twist moves.
  bool tendonsTwist() const;
  /// Whether junctions, ties, bodies or tendons join rods.
  bool isJoined() const;
  std::vector<NodalForce> forces;
  std::vector<FollowerForce> followers;
  std::vector<EdgeMoment> moments;
  std::vector<Collider> colliders;
  Vec3 gravity{0, -9.81, 0}; ///< [m/s^2]
  /// Statics in a frame that turns about an axis through `centre`: the scene is at rest there, under centrifugal
  /// forces.
  struct Rotation {
    Vec3 angular_velocity = Vec3::Zero(); ///< [rad/s]
    Vec3 centre = Vec3::Zero();           ///< [m]
    /// Acceleration at a place: matrix() (x - centre).
    Mat3 matrix() const {
      return angular_velocity.squaredNorm() * Mat3::Identity() - angular_velocity * angular_velocity.transpose();
    }
  } rotation;

  /// What is asked of the whole scene, where this is the part of it that one rank has: what a run does follows from
  /// all rods, whichever rank has them.
  struct Whole {
    bool strains_dissipate, slides, has_couples, touches_rods, touches_bodies, slides_among_moving, tendons_rub;
    std::int64_t edges;
  };
  std::optional<Whole> whole;
  /// Whether anything dissipates by the rate of its strains: the stiffness of a rod, or a constraint.
  bool strainsDissipate() const;
  bool hasCouples() const;
  std::int64_t edges() const;
  bool collidersMove() const;
  /// The latest time up to another, later one until which all obstacles move evenly (Motion::evenUntil).
  double collidersEvenUntil(double from, double to) const;
  /// Whether a body may touch obstacles, rods or other bodies.
  bool touchesBody(int body) const {
    const ContactSettings &contact = bodies[body].contact;
    return contact.on && (!colliders.empty() || contact.bodies);
  }
  /// Whether more acts on a body itself than joints and what is tied to it: contact, or a tendon.
  bool isPressed(int body) const;
  /// Whether any rod touches others or itself.
  bool touchesRods() const {
    if (whole) return whole->touches_rods;
    return std::any_of(rods.begin(), rods.end(), [](const Rod &r) { return r.contact.touchesRods(); });
  }
  /// Whether any body touches rods or other bodies.
  bool touchesBodies() const {
    if (whole) return whole->touches_bodies;
    const auto touches = [](const auto &of) { return of.contact.touchesBodies(); };
    const auto count = std::count_if(bodies.begin(), bodies.end(), touches);
    return count > 1 || (count == 1 && std::any_of(rods.begin(), rods.end(), touches));
  }
  /// Whether anything touches what moves by what it does to it.
  bool touchesMoving() const { return touchesRods() || touchesBodies(); }
  /// Whether friction or damping acts between any of these.
  bool slidesAmongMoving() const {
    if (whole) return whole->slides_among_moving;
    const auto slides = [](const auto &of) { return of.contact.touchesMoving() && of.contact.slides(); };
    return touchesMoving() &&
           (std::any_of(rods.begin(), rods.end(), slides) || std::any_of(bodies.begin(), bodies.end(), slides));
  }
  /// Whether a rod may touch obstacles.
  bool touches(int rod) const { return !colliders.empty() && rods[rod].contact.on; }
  /// Whether friction or damping with obstacles acts on any rod.
  bool slides() const;
  /// The same with obstacles, or among rods and bodies.
  bool hasFriction() const { return slides() || slidesAmongMoving() || tendonsRub(); }
};

/// The scene with some of its rods only, in any order, and what holds, joins and pulls them.
/// \param rods with all that any of them is joined to
Scene withRods(const Scene &scene, const std::vector<int> &rods);

/// Fills the directors of a rod with discrete Bishop frames: `start` (or some normal of the first edge when zero)
/// transported along the polyline; on a closed rod the angle that remains after one round is spread over the edges by
/// arc length.
void setBishopDirectors(Rod &rod, const Vec3 &start = Vec3::Zero());

/// Reference frame of edge i.
Frame referenceFrame(const Rod &rod, int edge);

/// Frame of the rod at a vertex: the mean of its two edges' frames; at an end, the tangent of the curve extrapolated by
/// half an edge.
Frame frameAtVertex(const Rod &rod, int vertex);

/// Checks what the reader cannot see at one line: zero-length and folded edges, directors, indices. \throws SceneError
/// naming the rod.
void checkRod(const Rod &rod);

/// Sizes of one rod that tell what to expect of it.
struct DimensionlessGroups {
  double length;           ///< [m]
  double gravito_bending;  ///< rho_L g L^3 / EI
  double axial_to_bending; ///< EA L^2 / EI
  double largest_turning;  ///< per vertex [deg]
  double largest_twist;    ///< per vertex, of the reference directors [deg]
  /// With `energy: seed`, what stretch adds to the bending compliance L/EI at the corner (above 30 degrees) where that
  /// is most: a moment M stretches the two edges by M theta/(2 EA h), by which a natural turning theta opens: theta^2
  /// EI/(2 EA h L). It grows without end as the edges h get shorter.
  double corner_softness;
  int softest_corner; ///< that vertex
};
/// \param corners by vertex, those that junctions keep: their turning is none of the rod's
DimensionlessGroups dimensionlessGroups(const Rod &rod, const Vec3 &gravity, const std::vector<char> &corners = {});

} // namespace tendril
