#include "tendril/io/body_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/tendon_reader.hpp"

#include <algorithm>

namespace tendril {
namespace {

Joint::Type typeOf(const std::string &word) {
  return Joint::Type(std::find(std::begin(joint_types), std::end(joint_types), word) - std::begin(joint_types));
}

/// Its coordinate, in words.
std::string coordinateOf(const Joint &joint) {
  if (joint.type == Joint::Type::ball) return "the angle of its rotation";
  if (joint.held().slidesFreely()) return "the way along its axis";
  return joint.held().turnsFreely() ? "the angle about its axis" : "";
}

/// Springs in place of what is held.
void readSprings(YamlMap &map, Joint &joint) {
  const bool turns = joint.held().tilt || joint.held().turn;
  const AnyKey stiffness("joints[].stiffness"), turning("joints[].rotational_stiffness");
  const bool soft = map.has(stiffness), turns_softly = map.has(turning);
  if (turns_softly && !turns)
    map.at(turning).fail("a joint of 'type: " + std::string(nameOf(joint.type)) +
                         "' leaves all turns free: 'rotational_stiffness' has nothing to act on; take it away");
  if (soft != turns_softly && turns)
    map.value().fail(std::string("a joint is exact or made of springs: '") +
                     (soft ? "rotational_stiffness' [N m/rad]" : "stiffness' [N/m]") + " is missing beside '" +
                     (soft ? "stiffness'" : "rotational_stiffness'") + "; give both, or take it away");
  if (soft) joint.stiffness = map.number("joints[].stiffness");
  if (turns_softly) joint.rotational_stiffness = map.number("joints[].rotational_stiffness");
  for (const AnyKey key :
       {AnyKey("joints[].damping"), AnyKey("joints[].rotational_damping"), AnyKey("joints[].saturation")})
    if (!soft && map.has(key))
      map.at(key).fail("'" + std::string(key->name()) +
                       "' is for a joint made of springs, and this one is exact; give a 'stiffness', or take it away");
  joint.damping = map.number("joints[].damping");
  joint.rotational_damping = map.number("joints[].rotational_damping");
  joint.saturation = map.number("joints[].saturation");
  if (joint.saturation == 0)
    map.at("joints[].saturation").fail("'saturation' must be positive, or negative for none; found 0");
}

void readDrive(YamlMap &map, const std::string &coordinate, Joint &joint) {
  const YamlValue value = map.at("joints[].drive");
  if (coordinate.empty() || joint.type == Joint::Type::ball)
    value.fail("a 'drive' is for a joint with one coordinate: hinge, prismatic, cylindrical or planar; found 'type: " +
               std::string(nameOf(joint.type)) + "'");
  YamlMap drive(value, "joints[].drive");
  joint.driven = true;
  if (drive.has("joints[].drive.stiffness")) joint.drive_stiffness = drive.number("joints[].drive.stiffness");
  joint.drive_damping = drive.number("joints[].drive.damping");
  joint.target = drive.number("joints[].drive.target");
  if (joint.drive_damping > 0 && joint.drive_stiffness < 0)
    drive.at("joints[].drive.damping")
        .fail("'damping' is for a drive with a 'stiffness', and this one is exact; give one (0 for a damper alone), or "
              "take 'damping' away");
  if (joint.drive_stiffness == 0 && joint.drive_damping == 0)
    value.fail("'stiffness' and 'damping' are both zero: nothing is driven");
  if (drive.has("joints[].drive.table")) {
    const YamlValue table = drive.at("joints[].drive.table");
    if (drive.has("joints[].drive.target")) table.fail("a drive takes a 'target' or a 'table', not both");
    joint.target_motion = readProfile(table);
  }
  drive.finish();
}

void readRange(YamlMap &map, const std::string &coordinate, Joint &joint) {
  const AnyKey range("joints[].range");
  if (map.has("joints[].range_stiffness") && !map.has(range))
    map.at("joints[].range_stiffness").fail("'range_stiffness' needs a 'range', which is missing");
  if (!map.has(range)) return;
  const YamlValue value = map.at(range);
  if (coordinate.empty())
    value.fail("a joint of 'type: " + std::string(nameOf(joint.type)) + "' has no coordinate with a 'range'");
  const std::vector<double> v = value.numbers(2);
  joint.lower = v[0];
  joint.upper = v[1];
  if (!(joint.lower < joint.upper)) value.fail("'range' is [lower, upper], lower first");
  if (joint.type == Joint::Type::ball) {
    if (joint.lower != 0 || joint.upper > pi)
      value.fail("the 'range' of a ball is [0, upper], of " + coordinate + " from how it is drawn, at most pi");
    joint.lower = -HUGE_VAL;
    if (joint.upper < 0.01) value.fail("the 'range' of a ball must be 0.01 rad or more; less is 'type: fixed'");
  }
  if (joint.lower > 0 || joint.upper < 0)
    value.fail("'range' must hold 0: " + coordinate + " as drawn; draw the bodies within it");
  if (map.has("joints[].range_stiffness")) joint.range_stiffness = map.number("joints[].range_stiffness");
}

} // namespace

void readJoint(const YamlValue &value, SceneFile &out) {
  YamlMap map(value, "joints");
  Joint joint;
  joint.name =
      map.has("joints[].name") ? readName(map.at("joints[].name")) : "joint" + std::to_string(out.joint_blocks);
  ++out.joint_blocks;
  if (!out.joint_names.insert(joint.name).second)
    value.fail("a joint with the name '" + joint.name + "' is there already");
  joint.type = typeOf(map.word("joints[].type"));
  map.refuseUnknown();
  const SceneFile::BodyPlace child = findBody(map.at("joints[].child"), out);
  const Body &own = out.bodyAt(child);
  const YamlValue parent = map.at("joints[].parent");
  const bool to_world = parent.text() == "world";
  const SceneFile::BodyPlace other = to_world ? SceneFile::BodyPlace{true, -1} : findBody(parent, out);
  if (child.held)
    map.at("joints[].child")
        .fail("body '" + own.name + "' is 'fixed' or goes by its 'motion': a joint cannot move it; " +
              (other.held ? "nothing here can move" : "make it the 'parent', and the other body the 'child'"));
  if (!to_world && !other.held && other.index == child.index)
    parent.fail("both sides of the joint are body '" + own.name + "'; the 'parent' is another body, or world");
  joint.child = child.index;
  joint.point = map.has("joints[].point") ? map.vector("joints[].point") : own.own.centre;
  const bool has_axis = joint.type != Joint::Type::ball && joint.type != Joint::Type::fixed;
  if (map.has("joints[].axis") && !has_axis)
    map.at("joints[].axis")
        .fail("a joint of 'type: " + std::string(nameOf(joint.type)) + "' has no 'axis'; take it away");
  const Vec3 axis = unit(map.at("joints[].axis")), across = axis.unitOrthogonal();
  joint.axes << across, axis.cross(across), axis;
  if (!to_world && !other.held) joint.parent = other.index;
  if (!to_world && other.held) {
    const Body &holder = out.bodyAt(other);
    joint.motion = holder.motion.at(joint.point - holder.position);
  }
  const std::string coordinate = coordinateOf(joint);
  readSprings(map, joint);
  readRange(map, coordinate, joint);
  if (map.has("joints[].drive")) readDrive(map, coordinate, joint);
  if (joint.driven && joint.drive_stiffness < 0 && joint.hasRange() && joint.range_stiffness < 0)
    value.fail("an exact 'drive' and an exact 'range' hold the same coordinate; take one of them away, or give it a "
               "stiffness");
  map.finish();
  out.scene.joints.push_back(std::move(joint));
}

} // namespace tendril
