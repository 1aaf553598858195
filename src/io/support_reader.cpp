#include "tendril/io/support_reader.hpp"

#include "tendril/io/text.hpp"

#include <algorithm>
#include <sstream>

namespace tendril {

Vec3 unit(const YamlValue &value) {
  const Vec3 v = value.vector();
  if (v.norm() == 0) value.fail("'" + value.name() + "' must not be zero");
  return v.normalized();
}

std::string readName(const YamlValue &value) {
  const std::string name = value.text();
  if (name.empty() || name != inOneLine(name) || name.front() == ' ' || name.back() == ' ')
    value.fail("'name' must be in one line, neither empty nor with blanks around it, found '" + inOneLine(name) + "'");
  return name;
}

std::vector<int> readTargets(YamlMap &map, KeyOf<KeyType::rod> key, const RodNames &rods) {
  if (rods.count() == 0) map.value().fail("this is for a rod, and the scene has no 'rods' before it");
  if (!map.has(*key)) {
    if (rods.count() > 1) map.value().fail("say which 'rod' is meant: a name, a number from 0, or all");
    return {0};
  }
  const YamlValue v = map.at(*key);
  const std::string word = v.text();
  const std::vector<int> found = rods.find(word);
  if (found.empty())
    v.fail("there is no rod '" + word + "'; write the name of a rod, its number from 0 to " +
           std::to_string(rods.count() - 1) + ", or all");
  return found;
}

int readIndex(YamlMap &map, KeyOf<KeyType::index> key, int count, const std::string &rod) {
  const YamlValue v = map.at(*key);
  if (v.isScalar() && v.node().Scalar() == "last") return count - 1;
  const int i = v.integer(*key);
  if (i >= count)
    v.fail("'" + v.name() + "' " + std::to_string(i) + " is out of range: rod '" + rod + "' has " +
           std::to_string(count) + ", numbered 0 to " + std::to_string(count - 1));
  return i;
}

Motion readMotion(const YamlValue &value, const MotionKeys &keys) {
  YamlMap map(value, keys.motion);
  Motion m;
  m.velocity = map.vector(keys.velocity);
  m.angular_velocity = map.vector(keys.angular_velocity);
  m.amplitude = map.vector(keys.amplitude);
  const bool swings = map.has(*keys.amplitude), table = map.has(*keys.table),
             steady = map.has(*keys.velocity) || map.has(*keys.angular_velocity) || swings;
  if (swings != map.has(*keys.period))
    value.fail(std::string("'amplitude' and 'period' belong together, and '") + (swings ? "period" : "amplitude") +
               "' is missing");
  if (swings) m.period = map.number(keys.period);
  if (!steady && !table)
    value.fail("'motion' needs 'velocity', 'angular_velocity' and/or an 'amplitude' with its 'period', or a 'table'");
  if (table) {
    if (steady) value.fail("'motion' takes a 'table', or velocities and an amplitude, not both");
    for (const YamlValue &row : map.at(*keys.table).items()) {
      const std::size_t n = row.node().size();
      if (n != 4 && n != 7) row.fail("a row of 'table' is [time, dx, dy, dz] or [time, dx, dy, dz, rx, ry, rz]");
      const std::vector<double> v = row.numbers(n);
      m.table.push_back({v[0], Vec3(v[1], v[2], v[3]), n == 7 ? Vec3(v[4], v[5], v[6]) : Vec3(Vec3::Zero())});
      if (m.table.size() > 1 && m.table[m.table.size() - 2].time >= v[0])
        row.fail("the times of 'table' must increase, found " + std::to_string(v[0]) + " after " +
                 std::to_string(m.table[m.table.size() - 2].time));
    }
    if (m.table.empty()) value.fail("'table' is empty");
  }
  map.finish();
  return m;
}

void refuseTurning(const YamlValue &motion, const Motion &m, const std::string &advice) {
  const bool turns = std::any_of(m.table.begin(), m.table.end(), [](const auto &k) { return !k.rotation.isZero(0); });
  if (turns || !m.angular_velocity.isZero(0)) motion.fail(advice);
}

void refuseTravel(const YamlValue &motion, const Motion &m, const std::string &advice) {
  const bool moves =
      std::any_of(m.table.begin(), m.table.end(), [](const auto &k) { return !k.displacement.isZero(0); });
  if (moves || !m.velocity.isZero(0) || !m.amplitude.isZero(0)) motion.fail(advice);
}

namespace {

constexpr MotionKeys support_motion_keys{
    "supports[].motion",           "supports[].motion.velocity", "supports[].motion.angular_velocity",
    "supports[].motion.amplitude", "supports[].motion.period",   "supports[].motion.table"};

/// A motion that is elsewhere at the start than the rod as drawn.
std::string jumpOf(const Motion &motion, const std::string &rod) {
  const double away = motion.displacementAt(0).norm(), turned = motion.rotationVectorAt(0).norm();
  if (away == 0 && turned == 0) return {};
  std::ostringstream s;
  s << "the motion begins " << away << " m and " << turned << " rad away from rod '" << rod
    << "' as drawn, which jumps there in the first step";
  return s.str();
}

} // namespace

void readSupport(const YamlValue &value, SceneFile &out) {
  Scene &scene = out.scene;
  YamlMap map(value, "supports");
  bool warned = false;
  const std::string type = map.word("supports[].type");
  for (const int r : readTargets(map, "supports[].rod", out.names)) {
    const Rod &rod = scene.rods[r];
    Support s{};
    s.kind = type == "clamp" ? Support::Kind::clamp : type == "pin" ? Support::Kind::pin : Support::Kind::fix_twist;
    s.rod = r;
    s.vertex = readIndex(map, "supports[].vertex", rod.vertices(), rod.name);
    std::vector<int> &here = out.supports_at[{r, s.vertex}];
    for (const int k : here)
      if (const Support &other = scene.supports[k];
          (other.holdsPosition() && s.holdsPosition()) || (other.holdsTwist() && s.holdsTwist()))
        value.fail("vertex " + std::to_string(s.vertex) + " of rod '" + rod.name + "' is held twice");
    s.frame = frameAtVertex(rod, s.vertex);
    if (type != "pin") {
      s.tangent_given = map.has("supports[].tangent");
      s.director_given = map.has("supports[].director");
      if (s.tangent_given) s.frame.tangent = unit(map.at("supports[].tangent"));
      s.frame.director = orthonormalised(s.frame.director, s.frame.tangent);
      if (s.director_given) {
        const YamlValue d = map.at("supports[].director");
        const Vec3 v = unit(d);
        if (std::abs(v.dot(s.frame.tangent)) > 1e-6) d.fail("'director' is not normal to the tangent of the support");
        s.frame.director = v;
      }
      for (const int edge : {rod.edgeBefore(s.vertex), rod.edgeAfter(s.vertex)})
        if (type == "clamp" && edge >= 0 && s.frame.tangent.dot(rod.edge(edge).normalized()) < -0.9999)
          map.at("supports[].tangent")
              .fail("'tangent' points against edge " + std::to_string(edge) + " of rod '" + rod.name +
                    "', which would fold back on itself; tangents point from vertex to vertex, by their numbers");
      if (!s.frame.director.allFinite())
        value.fail("'tangent' is parallel to the rod's director; give a 'director' too");
    }
    if (type == "fix_twist" && rod.material.isCable())
      value.fail("rod '" + rod.name + "' has no flexural stiffness and no twist to fix");
    if (map.has("supports[].motion")) {
      const YamlValue motion = map.at("supports[].motion");
      s.motion = readMotion(motion, support_motion_keys);
      if (type == "pin")
        refuseTurning(motion, s.motion, "a pin holds no rotation; take it away or write 'type: clamp'");
      if (type == "fix_twist")
        refuseTravel(motion, s.motion,
                     "fix_twist holds no position; take the displacement away or add a pin that moves");
    }
    if (const std::string jump = jumpOf(s.motion, rod.name); !jump.empty() && !warned) {
      out.notes.push_back("warning: " + value.place() + ": " + jump);
      warned = true;
    }
    here.push_back(int(scene.supports.size()));
    scene.supports.push_back(s);
  }
  map.finish();
}

/// Takes the force of a load that turns with its rod away from it.
static bool readFollower(YamlMap &map, const Rod &rod, NodalForce &load, Scene &scene) {
  if (!map.has("loads[].axes") || map.word("loads[].axes") == "world") return false;
  if (!map.has("loads[].force")) map.at("loads[].axes").fail("'axes' are those of a 'force'; write one");
  const FollowerForce follower{load.rod, load.vertex, std::exchange(load.force, Vec3::Zero())};
  if (rod.material.isCable() && !follower.isTangential())
    map.at("loads[].force")
        .fail("rod '" + rod.name +
              "' has no flexural stiffness, and so no directors that a force could turn with; "
              "write 'force: [0, 0, " +
              shortText(follower.force[2]) + "]', along its tangent, or 'axes: world'");
  if (follower.force.isZero(0)) return false;
  scene.followers.push_back(follower);
  return true;
}

void readLoad(const YamlValue &value, SceneFile &out) {
  Scene &scene = out.scene;
  YamlMap map(value, "loads");
  bool warned = false;
  for (const int r : readTargets(map, "loads[].rod", out.names)) {
    const Rod &rod = scene.rods[r];
    if (map.has("loads[].force") || map.has("loads[].mass")) {
      NodalForce load{r, readIndex(map, "loads[].vertex", rod.vertices(), rod.name), Vec3::Zero()};
      if (map.has("loads[].force")) load.force = map.vector("loads[].force");
      if (map.has("loads[].mass")) load.mass = map.number("loads[].mass");
      const bool follows = readFollower(map, rod, load, scene);
      const auto at = out.supports_at.find({r, load.vertex});
      const bool held = at != out.supports_at.end() && std::any_of(at->second.begin(), at->second.end(), [&](int k) {
                          return scene.supports[k].holdsPosition();
                        });
      if (held && !warned && (follows || !load.force.isZero(0)))
        out.notes.push_back("warning: " + value.place() + ": the force acts on vertex " + std::to_string(load.vertex) +
                            " of rod '" + rod.name + "', which a support holds: it moves nothing");
      warned = warned || held;
      if (!follows || load.mass > 0) scene.forces.push_back(load);
    } else if (map.has("loads[].torque") || map.has("loads[].moment")) {
      if (rod.material.isCable())
        value.fail("rod '" + rod.name + "' has no flexural stiffness: it cannot carry a torque or moment");
      EdgeMoment m{r, readIndex(map, "loads[].edge", rod.edges(), rod.name), 0, Vec3::Zero()};
      if (map.has("loads[].torque")) m.torque = map.number("loads[].torque");
      if (map.has("loads[].moment")) m.moment = map.vector("loads[].moment");
      scene.moments.push_back(m);
    } else
      value.fail("a load needs 'vertex' and 'force' or 'mass', or 'edge' and 'torque' or 'moment'");
  }
  map.finish();
}

} // namespace tendril
