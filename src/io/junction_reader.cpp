#include "tendril/io/junction_reader.hpp"

#include "tendril/io/support_reader.hpp"

#include <algorithm>
#include <map>
#include <set>

namespace tendril {
namespace {

std::string labelOf(const Scene &scene, const Junction::Member &m) {
  return "vertex " + std::to_string(m.vertex) + " of rod '" + scene.rods[m.rod].name + "'";
}

Vec3 &placeOf(Scene &scene, const Junction::Member &m) { return scene.rods[m.rod].position[m.vertex]; }

/// Points that vertices of several rods share, each with its vertices, by the first of them. Sorted along a direction
/// in which hardly any scene has many vertices side by side, so that only neighbours have to be compared.
std::vector<std::vector<Junction::Member>> sharedPoints(const Scene &scene, const std::vector<int> &rods,
                                                        double within) {
  std::vector<Junction::Member> all;
  for (const int r : rods)
    for (int v = 0; v < scene.rods[r].vertices(); ++v) all.push_back({r, v, -1});
  auto x = [&](int k) -> const Vec3 & { return scene.rods[all[k].rod].position[all[k].vertex]; };
  const Vec3 direction = Vec3(1, 0.6180339887, 0.4142135624).normalized();
  std::vector<double> along(all.size());
  std::vector<int> order(all.size());
  for (int k = 0; k < int(order.size()); ++k) {
    order[k] = k;
    along[k] = direction.dot(x(k));
  }
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return along[a] != along[b] ? along[a] < along[b] : a < b; });
  std::vector<int> first(all.size());
  for (int k = 0; k < int(first.size()); ++k) first[k] = k;
  auto rootOf = [&](int k) {
    while (first[k] != k) k = first[k];
    return k;
  };
  const double rounding = 1e-12 * (all.empty() ? 0 : std::abs(along[order.front()]) + std::abs(along[order.back()]));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && along[order[j]] - along[order[i]] <= within + rounding; ++j)
      if ((x(order[j]) - x(order[i])).norm() <= within) {
        const int a = rootOf(order[i]), b = rootOf(order[j]);
        first[std::max(a, b)] = std::min(a, b);
      }
  std::map<int, std::vector<Junction::Member>> points;
  for (int k = 0; k < int(all.size()); ++k) points[rootOf(k)].push_back(all[k]);
  std::vector<std::vector<Junction::Member>> shared;
  for (auto &[root, members] : points)
    if (members.size() > 1) shared.push_back(std::move(members));
  return shared;
}

/// Members that a block lists.
std::vector<Junction::Member> readMembers(YamlMap &map, const SceneFile &file) {
  std::vector<Junction::Member> members;
  for (const YamlValue &v : map.at("junctions[].members").items()) {
    YamlMap m(v, "junctions[].members");
    const std::vector<int> rods = readTargets(m, "junctions[].members[].rod", file.names);
    const int group = m.has("junctions[].members[].group") ? m.integer("junctions[].members[].group") : -1;
    for (const int r : rods) {
      const Rod &rod = file.scene.rods[r];
      members.push_back({r, readIndex(m, "junctions[].members[].vertex", rod.vertices(), rod.name), group});
    }
    m.finish();
  }
  return members;
}

/// Numbers of groups from 0 on, in the order of their members. \return how many there are
int numberGroups(std::vector<Junction::Member> &members) {
  std::map<int, int> number;
  for (Junction::Member &m : members)
    if (m.group >= 0) m.group = number.try_emplace(m.group, int(number.size())).first->second;
  return int(number.size());
}

/// Refuses what cannot be joined, and puts all members at the place of the first.
void complete(const YamlValue &value, const Junction &junction, double within, SceneFile &out) {
  Scene &scene = out.scene;
  const Support *held = nullptr;
  for (const Junction::Member &m : junction.members) {
    const auto [other, is_new] = out.joined.try_emplace({m.rod, m.vertex}, junction.name);
    if (!is_new)
      value.fail(labelOf(scene, m) + " is in junction '" + other->second + "' already; " +
                 (other->second == junction.name ? "name it once" : "list all its members in one junction"));
    if (const auto tied = out.attached.find({m.rod, m.vertex}); tied != out.attached.end())
      value.fail(labelOf(scene, m) + " is tied to a body by constraint '" + tied->second + "', and junction '" +
                 junction.name + "' joins it; take it out of one of them, or tie every member to the body instead");
    const Vec3 &first = placeOf(scene, junction.members.front());
    if (const double away = (placeOf(scene, m) - first).norm(); away > within)
      value.fail(labelOf(scene, m) + " is " + shortText(away) + " m from " + labelOf(scene, junction.members.front()) +
                 ", and a junction joins what is within " + shortText(within) +
                 " m: move one of them, or write a larger 'within'");
    placeOf(scene, m) = first;
    for (const Support &s : scene.supports) {
      if (s.rod != m.rod || s.vertex != m.vertex) continue;
      if (m.group >= 0 && s.holdsTwist())
        value.fail(labelOf(scene, m) + " is in a rigid group and has a support of 'type: " + nameOf(s.kind) +
                   "'; write 'type: pin', or clamp every member instead of joining them");
      if (held && s.holdsPosition())
        value.fail("two supports hold junction '" + junction.name + "', at " +
                   labelOf(scene, {held->rod, held->vertex, -1}) + " and at " + labelOf(scene, m) +
                   "; take one of them away");
      if (s.holdsPosition()) held = &s;
    }
  }
}

} // namespace

void readJunction(const YamlValue &value, SceneFile &out) {
  Scene &scene = out.scene;
  YamlMap map(value, "junctions");
  const std::string type = map.word("junctions[].type");
  const bool rigid = type == "rigid", listed = map.has("junctions[].members"), found = map.flag("junctions[].shared");
  const double within = map.number("junctions[].within");
  const std::string name = map.has("junctions[].name") ? readName(map.at("junctions[].name"))
                                                       : "junction" + std::to_string(out.junction_blocks);
  ++out.junction_blocks;
  if (listed == found)
    value.fail("a junction needs 'members', or 'shared: true' for all points that rods share" +
               std::string(listed ? ", not both" : ""));
  if (listed && map.has("junctions[].rod")) map.at("junctions[].rod").fail("'rod' is for 'shared: true'");
  std::vector<std::vector<Junction::Member>> points;
  if (listed)
    points.push_back(readMembers(map, out));
  else {
    std::vector<int> rods(scene.rods.size());
    for (int r = 0; r < int(rods.size()); ++r) rods[r] = r;
    if (map.has("junctions[].rod")) rods = readTargets(map, "junctions[].rod", out.names);
    points = sharedPoints(scene, rods, within);
    if (points.empty()) value.fail("no two vertices of these rods are within " + shortText(within) + " m");
  }
  std::size_t before = scene.junctions.size();
  for (std::size_t k = 0; k < points.size(); ++k) {
    Junction junction;
    junction.name = listed ? name : name + "#" + std::to_string(k);
    junction.members = std::move(points[k]);
    if (junction.members.empty())
      map.at("junctions[].members").fail("'members' is empty; a junction needs two or more");
    const Junction::Member &only = junction.members.front();
    if (junction.members.size() < 2 && !(rigid && scene.rods[only.rod].edgeBefore(only.vertex) >= 0 &&
                                         scene.rods[only.rod].edgeAfter(only.vertex) >= 0))
      value.fail("a junction needs two 'members' or more, or as a corner one along its rod with 'type: rigid'");
    for (Junction::Member &m : junction.members) {
      if (rigid && m.group >= 0)
        map.at("junctions[].members").fail("'group' is for 'type: ball'; all members of a rigid junction are one");
      if (rigid) m.group = 0;
    }
    junction.groups = numberGroups(junction.members);
    complete(value, junction, within, out);
    scene.junctions.push_back(std::move(junction));
  }
  std::set<int> moved;
  for (; before < scene.junctions.size(); ++before)
    for (const Junction::Member &m : scene.junctions[before].members) moved.insert(m.rod);
  for (const int r : moved) {
    try {
      checkRod(scene.rods[r]);
    } catch (const SceneError &e) {
      value.fail(e.what());
    }
  }
  map.finish();
}

} // namespace tendril
