#include "tendril/io/run_facts.hpp"

#include "tendril/embedding/embedding.hpp"
#include "tendril/io/digest.hpp"
#include "tendril/io/text.hpp"

#include <charconv>

namespace tendril {
namespace {

std::string hashOf(const std::string &text) {
  Digest d;
  d.add(text);
  return d.hex();
}

/// As many digits as bring the number back.
std::string textOf(double x) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, x).ptr};
}
std::string textOf(const Vec3 &x) { return "[" + textOf(x[0]) + ", " + textOf(x[1]) + ", " + textOf(x[2]) + "]"; }

std::string textOf(const Material &m) {
  return "linear_density " + textOf(m.linear_density) + ", linear_rotational_inertia " +
         textOf(m.linear_rotational_inertia) + ", axial_stiffness " + textOf(m.axial_stiffness) +
         ", torsional_stiffness " + textOf(m.torsional_stiffness) + ", flexural_stiffness [" +
         textOf(m.flexural_stiffness[0]) + ", " + textOf(m.flexural_stiffness[1]) + "], damping " +
         textOf(m.mass_damping_coefficient) + " and " + textOf(m.stiffness_damping_coefficient);
}

std::string textOf(const Motion &m) {
  if (!m.arm.isZero(0)) {
    const std::string of_body = textOf(m.at(Vec3::Zero()));
    return of_body.empty() ? "" : of_body + ", of a body with the arm " + textOf(m.arm);
  }
  const std::string swing =
      m.amplitude.isZero(0) ? "" : ", amplitude " + textOf(m.amplitude) + " by " + textOf(m.period) + " s";
  if (m.table.empty())
    return m.moves() ? ", velocity " + textOf(m.velocity) + ", angular velocity " + textOf(m.angular_velocity) + swing
                     : "";
  std::string table;
  for (const Motion::Key &k : m.table) table += textOf(k.time) + textOf(k.displacement) + textOf(k.rotation);
  return ", motion by a table of " + std::to_string(m.table.size()) + " rows, #" + hashOf(table);
}

/// All but what its actuator is given.
std::string textOf(const Tendon &t, const Scene &scene) {
  const Actuator &a = t.actuator;
  std::string text = std::string(nameOf(a.kind)) + ", stiffness " + textOf(a.stiffness) + ", damping " +
                     textOf(a.damping) + (a.compression ? ", pushes" : "") + (a.rigid ? ", rigid" : "");
  if (a.kind == Actuator::Kind::mckibben)
    text += ", braid " + textOf(a.braid_length) + ", " + textOf(a.turns) + " turns, length " + textOf(a.muscle_length) +
            ", above " + textOf(a.minimum_pressure) + " Pa";
  if (const std::vector<Tendon::Rub> rubs = t.rubs(); !rubs.empty()) {
    text += ", slip length " + textOf(t.slip_length) + ", friction";
    for (const Tendon::Rub &r : rubs) text += " " + textOf(r.friction);
  }
  for (const Tendon::Pull &p : t.joints)
    text += ", " + textOf(p.coefficient) + " of joint '" + scene.joints[std::size_t(p.joint)].name + "'";
  Digest path;
  for (const Waypoint &p : t.points) {
    path.add(&p.at, sizeof p.at);
    path.add(textOf(p.motion));
  }
  for (const Wrap &w : t.wraps) {
    const double what[] = {double(w.body), double(w.sphere), w.radius, double(w.side)};
    path.add(what, sizeof what);
    path.add(w.centre.data(), sizeof(Vec3));
    path.add(w.axis.data(), sizeof(Vec3));
  }
  for (const Tendon::Segment &s : t.segments) path.add(&s, sizeof s);
  return text + ", path #" + path.hex();
}

std::string inputOf(const Actuator &a) {
  std::string table;
  for (const Motion::Key &k : a.input_motion.table) table += textOf(k.time) + textOf(k.displacement[0]);
  return table.empty() ? textOf(a.input)
                       : "a table of " + std::to_string(a.input_motion.table.size()) + " rows, #" + hashOf(table);
}

std::string textOf(const Support &support) {
  std::string text = nameOf(support.kind);
  if (support.holdsTwist())
    text += " of tangent " + textOf(support.frame.tangent) + " and director " + textOf(support.frame.director);
  return text + textOf(support.motion);
}

std::string textOf(const Constraint &c, const Scene &scene) {
  std::string text =
      c.isToBody() ? std::string(nameOf(c.kind)) + " to body '" + scene.bodies[c.to_body].name + "' at " +
                         textOf(c.isPin() ? c.point : c.frame.tangent)
      : c.isTie() ? "pin to vertex " + std::to_string(c.to_vertex) + " of rod '" + scene.rods[c.to_rod].name + "'"
      : c.isPin() ? "pin to " + textOf(c.point)
                  : "rotation to tangent " + textOf(c.frame.tangent) + " and director " + textOf(c.frame.director);
  text += ", stiffness " + textOf(c.stiffness) + ", damping " + textOf(c.damping);
  if (c.damping != 0 && !c.damps_motion) text += " of the rod's motion alone";
  if (c.saturation > 0) text += ", saturation " + textOf(c.saturation);
  if (c.measure == Constraint::Measure::sine) text += ", measure sine";
  return text + textOf(c.motion);
}

std::string textOf(const Joint &j) {
  std::string text(nameOf(j.type));
  for (const auto &[name, value] :
       {std::pair(", stiffness ", j.stiffness), std::pair(", rotational stiffness ", j.rotational_stiffness),
        std::pair(", damping ", j.damping), std::pair(", rotational damping ", j.rotational_damping),
        std::pair(", saturation ", j.saturation), std::pair(", range stiffness ", j.range_stiffness)})
    text += name + textOf(value);
  text += ", range " + textOf(j.lower) + " to " + textOf(j.upper);
  if (j.driven)
    text += ", drive to " + textOf(j.target) + " of stiffness " + textOf(j.drive_stiffness) + " and damping " +
            textOf(j.drive_damping) + textOf(j.target_motion);
  return text + textOf(j.motion);
}

std::string textOf(const ContactSettings &c) {
  if (!c.on) return "none";
  std::string passes, stick;
  for (const int k : c.passes) passes += (passes.empty() ? ", passes collider " : " and ") + std::to_string(k);
  if (c.stick != ContactSettings::Stick::by_mode)
    stick = c.stick == ContactSettings::Stick::creep ? ", creeping" : ", anchored";
  return std::string(c.isBarrier() ? "barrier of width " + textOf(c.distance)
                                   : "penalty from " + textOf(c.threshold) + ", smoothing " + textOf(c.smoothing)) +
         ", radius " + textOf(c.radius) + ", stiffness " + textOf(c.stiffness) + ", quadrature " +
         std::to_string(c.quadrature) + ", friction " + textOf(c.friction) +
         (c.friction_at_surface ? " at the surface" : " at the centreline") + ", falling off below " +
         textOf(c.fall_off_velocity) + " and " + textOf(c.slip_length) + ", damping " + textOf(c.tangential_damping) +
         " and " + textOf(c.normal_damping) + stick + passes +
         (!c.touchesRods()                       ? ""
          : c.rods == ContactSettings::Rods::all ? ", with all rods"
                                                 : ", with other rods") +
         (c.touchesBodies() ? ", with bodies" : "") + (c.on_surface ? ", on its skin" : "") +
         (c.point_cloud ? ", cloud of " + std::to_string(c.cloud) + " apart by " + textOf(c.exclusion_ratio) : "") +
         (c.apart_from | c.apart_to
              ? ", apart by " + std::to_string(c.apart_from) + " and " + std::to_string(c.apart_to)
              : "");
}

std::string textOf(const Collider &c) {
  std::string text = c.kind + " of size " + textOf(c.size) + " at " + textOf(c.position) + ", axes";
  for (int k = 0; k < 3; ++k) text += " " + textOf(Vec3(c.rotation.col(k)));
  if (c.mesh) {
    Digest d;
    d.add(c.mesh->vertices.data(), c.mesh->vertices.size() * sizeof(Vec3));
    d.add(c.mesh->triangles.data(), c.mesh->triangles.size() * sizeof(c.mesh->triangles[0]));
    text += ", mesh #" + d.hex();
  }
  return text + (c.friction < 0 ? "" : ", friction " + textOf(c.friction)) + textOf(c.motion);
}

using Kind = RunFacts::Kind;
constexpr const char *kinds[] = {"option", "load", "scene", "start"};
constexpr const char *order_of_rods = "order of the rods", *names_of_rods = "names of the rods",
                     *order_of_holders = "order of supports and constraints";

using Facts = std::vector<RunFacts::Fact>;

void add(Facts &facts, Kind kind, const std::string &name, const std::string &value) {
  facts.push_back({kind, inOneLine(name), inOneLine(value)});
}
void addNumbers(Digest &d, std::initializer_list<int> numbers) { d.add(numbers.begin(), numbers.size() * sizeof(int)); }

std::string onRod(const Scene &scene, const char *what, int place, int rod) {
  return std::string(what) + std::to_string(place) + " of rod '" + scene.rods[rod].name + "'";
}

void addOptions(Facts &facts, const LoopSettings &settings) {
  auto option = [&](const char *name, const std::string &value) { add(facts, Kind::option, name, value); };
  if (settings.dynamic) {
    option("dt", textOf(settings.dt));
    option("integrator", settings.integrator.name);
    if (settings.integrator.name == "generalized_alpha") option("rho_inf", textOf(settings.integrator.rho_inf));
    option("dt_adapt", settings.adapt == Adaptation::error ? "error" : "none");
    if (settings.adapt == Adaptation::error) {
      option("dt_rtol", textOf(settings.dt_rtol));
      option("dt_atol", textOf(settings.dt_atol));
      option("dt_max", textOf(settings.dt_max));
    }
    option("output_interval", textOf(settings.output_interval));
  } else
    option("load_steps", std::to_string(std::lround(1 / settings.dt)));
  option("stretch", settings.mixed ? "mixed" : "primal");
  option("retraction", settings.solve.retraction == RetractionKind::length ? "length" : "additive");
  option("hessian", settings.hessian == HessianKind::exact ? "exact" : "gauss_newton");
  option("line_search", settings.solve.line_search == LineSearchKind::energy  ? "energy"
                        : settings.solve.line_search == LineSearchKind::wolfe ? "wolfe"
                                                                              : "residual");
  option("quasi_newton", textOf(settings.solve.quasi_newton));
  option("rounding_tolerance", textOf(settings.solve.rounding_tolerance));
}

void addFactsOf(const Rod &rod, Facts &facts) {
  std::string start = rod.initial_velocity.isZero(0) ? "" : "velocity " + textOf(rod.initial_velocity);
  if (rod.initial_turns != 0) start += (start.empty() ? "turns " : ", turns ") + textOf(rod.initial_turns);
  if (!start.empty()) add(facts, Kind::start, "start of rod '" + rod.name + "'", start);
  const std::string of = " of rod '" + rod.name + "'";
  add(facts, Kind::scene, "material" + of, textOf(rod.material));
  add(facts, Kind::scene, "law" + of,
      std::string(rod.measure == Measure::tan ? "measure tan" : "measure angle") +
          (rod.energy == Energy::seed ? ", energy seed" : ", energy classical") +
          (rod.bends() && rod.model != RodModel::full ? std::string(", model ") + nameOf(rod.model) : "") +
          (rod.gravity ? "" : ", without gravity"));
  Digest shape;
  shape.add(rod.position.data(), rod.position.size() * sizeof(Vec3));
  shape.add(rod.director.data(), rod.director.size() * sizeof(Vec3));
  shape.add(rod.natural == Rod::Natural::given ? textOf(rod.natural_strain) : "");
  add(facts, Kind::scene, "shape at rest" + of, "#" + shape.hex());
}

void addFactsOf(const Body &b, Facts &facts) {
  add(facts, Kind::load, "force and torque on body '" + b.name + "'", textOf(b.force) + " and " + textOf(b.torque));
  if (!b.gravity) add(facts, Kind::scene, "gravity on body '" + b.name + "'", "none");
  if (!b.velocity.isZero(0) || !b.angular_velocity.isZero(0))
    add(facts, Kind::start, "start of body '" + b.name + "'",
        textOf(b.velocity) + " and " + textOf(b.angular_velocity));
}

/// By its hash: what has to be as it was for a state to fit.
std::string topologyOf(const Scene &scene) {
  Digest topology;
  for (const Rod &rod : scene.rods) addNumbers(topology, {rod.vertices(), rod.edges(), int(rod.closed)});
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members)
      addNumbers(topology, {int(&j - scene.junctions.data()), m.rod, m.vertex, m.group});
  for (const Attachment &a : scene.attachments) {
    addNumbers(topology, {a.rod, a.vertex, a.body, int(a.weld)});
    topology.add(a.frame.tangent.data(), sizeof(Vec3));
    topology.add(a.frame.director.data(), sizeof(Vec3));
  }
  for (const Body &b : scene.bodies) { // of which the state has the centre of mass
    topology.add(&b.own.mass, sizeof b.own.mass);
    topology.add(b.own.centre.data(), sizeof(Vec3));
    topology.add(b.own.inertia.data(), sizeof(Mat3));
  }
  for (const Joint &j : scene.joints) {
    addNumbers(topology, {int(j.type), j.child, j.parent});
    topology.add(j.point.data(), sizeof(Vec3));
    topology.add(j.axes.data(), sizeof(Mat3));
  }
  for (const Tendon &t : scene.tendons)
    for (const Waypoint &p : t.points) {
      addNumbers(topology, {int(&t - scene.tendons.data()), p.body, p.rod, p.edge});
      topology.add(p.point.data(), sizeof(Vec3));
    }
  return topology.hex();
}

void addNamesOfRods(Facts &facts, const Scene &scene) {
  Digest order, set;
  std::vector<std::string> names;
  for (const Rod &rod : scene.rods) names.push_back(rod.name);
  for (const std::string &name : names) order.add(name + "\n");
  std::sort(names.begin(), names.end());
  for (const std::string &name : names) set.add(name + "\n");
  add(facts, Kind::scene, order_of_rods, "#" + order.hex());
  add(facts, Kind::scene, names_of_rods, "#" + set.hex());
}

void addHolders(Facts &facts, const Scene &scene) {
  Digest holders; // a state remembers what they did by their order
  for (const Support &s : scene.supports) {
    addNumbers(holders, {int(s.kind), s.rod, s.vertex});
    add(facts, Kind::scene, onRod(scene, "support at vertex ", s.vertex, s.rod), textOf(s));
  }
  for (const Constraint &c : scene.constraints) {
    addNumbers(holders, {int(c.kind), c.rod, c.at});
    holders.add(textOf(c, scene));
    add(facts, Kind::scene, onRod(scene, c.isPin() ? "constraint at vertex " : "constraint at edge ", c.at, c.rod),
        textOf(c, scene));
  }
  for (const Joint &j : scene.joints) {
    holders.add(j.name);
    add(facts, Kind::scene, "joint '" + j.name + "'", textOf(j));
  }
  for (const Tendon &t : scene.tendons) {
    holders.add(t.name);
    add(facts, Kind::scene, "tendon '" + t.name + "'", textOf(t, scene));
    add(facts, Kind::load, "input of tendon '" + t.name + "'", inputOf(t.actuator));
  }
  add(facts, Kind::scene, order_of_holders, "#" + holders.hex());
}

void addSurfaces(Facts &facts, const Scene &scene) {
  for (const Collider &c : scene.colliders) add(facts, Kind::scene, "collider '" + c.name + "'", textOf(c));
  for (const Rod &rod : scene.rods)
    if (!scene.colliders.empty() || rod.contact.touchesMoving())
      add(facts, Kind::scene, "contact of rod '" + rod.name + "'", textOf(rod.contact));
  for (const Rod &rod : scene.rods) {
    if (!rod.skin) continue;
    Digest skin;
    const Skin all = skinOf(rod);
    for (const SkinPoint &p : all.points) {
      skin.add(p.edge.data(), sizeof p.edge);
      skin.add(p.weight.data(), sizeof p.weight);
      skin.add(p.local.data(), sizeof p.local);
    }
    skin.add(all.triangles.data(), all.triangles.size() * sizeof all.triangles[0]);
    add(facts, Kind::scene, "skin of rod '" + rod.name + "'", "#" + skin.hex());
  }
}

void addLoads(Facts &facts, const Scene &scene) {
  for (const NodalForce &f : scene.forces)
    if (f.mass > 0) add(facts, Kind::scene, onRod(scene, "mass on vertex ", f.vertex, f.rod), textOf(f.mass));
  for (const NodalForce &f : scene.forces)
    add(facts, Kind::load, onRod(scene, "force on vertex ", f.vertex, f.rod), textOf(f.force));
  for (const FollowerForce &f : scene.followers)
    add(facts, Kind::load, onRod(scene, "follower force on vertex ", f.vertex, f.rod), textOf(f.force));
  for (const EdgeMoment &m : scene.moments) {
    if (m.torque != 0) add(facts, Kind::load, onRod(scene, "torque on edge ", m.edge, m.rod), textOf(m.torque));
    if (!m.moment.isZero(0)) add(facts, Kind::load, onRod(scene, "moment on edge ", m.edge, m.rod), textOf(m.moment));
  }
}

} // namespace

std::string textOf(const std::vector<RunFacts::Fact> &facts) {
  std::string text;
  for (const RunFacts::Fact &f : facts) text += std::string(kinds[int(f.kind)]) + '\t' + f.name + '\t' + f.value + '\n';
  return text;
}

FactValues factsOf(const std::string &text) {
  FactValues values;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size()), tab = text.find('\t', at),
                      second = text.find('\t', tab + 1);
    if (tab < end && second < end) {
      std::string &value = values[{text.substr(at, tab - at), text.substr(tab + 1, second - tab - 1)}];
      value += (value.empty() ? "" : " and ") + text.substr(second + 1, end - second - 1);
    }
    at = end + 1;
  }
  return values;
}

int compareFacts(const FactValues &before, const FactValues &now, bool options, std::vector<std::string> *told) {
  constexpr std::size_t most = 20;
  int kind = 0, order_line = -1;
  std::vector<std::string> lines;
  FactValues all = before;
  all.insert(now.begin(), now.end());
  bool holders_changed = false;
  for (const auto &[key, any] : all) {
    const auto old = before.find(key), present = now.find(key);
    const bool gone = present == now.end(), added = old == before.end();
    if (!gone && !added && old->second == present->second) continue;
    if (key.first == kinds[int(Kind::option)] && (!options || gone || added)) continue; // an option of another method
    if (key.first == kinds[int(Kind::start)]) {
      lines.push_back("changed since the checkpoint, but only for the start, so that it is ignored: " + key.second +
                      ": " + (added ? "none" : old->second) + " -> " + (gone ? "none" : present->second));
      continue;
    }
    if (added && (key.second == order_of_rods || key.second == names_of_rods || key.second == order_of_holders))
      continue; // earlier versions did not keep it
    for (int k = 0; k < 3; ++k)
      if (key.first == kinds[k]) kind = std::max(kind, k);
    if (key.second == order_of_holders) order_line = int(lines.size());
    holders_changed =
        holders_changed || key.second.starts_with("constraint at ") || key.second.starts_with("support at ");
    const bool is_long = any.find('#') != std::string::npos;
    const std::string value = is_long ? "" : ": " + any;
    lines.push_back(gone      ? "no longer there: " + key.second + value
                    : added   ? "new since the checkpoint: " + key.second + value
                    : is_long ? "changed since the checkpoint: " + key.second
                              : "changed since the checkpoint: " + key.second + ": " + old->second + " -> " +
                                    present->second);
  }
  if (holders_changed && order_line >= 0) lines.erase(lines.begin() + order_line); // of others
  for (std::size_t k = 0; k < lines.size() && k < most; ++k) told->push_back(lines[k]);
  if (lines.size() > most) told->push_back("... and " + std::to_string(lines.size() - most) + " more changes");
  return kind;
}

bool areInAnotherOrder(const FactValues &before, const FactValues &now) {
  const std::pair<std::string, std::string> order{kinds[int(Kind::scene)], order_of_rods},
      names{kinds[int(Kind::scene)], names_of_rods};
  return before.count(order) && before.at(order) != now.at(order) && before.at(names) == now.at(names);
}

RunFacts::RunFacts(const Scene &scene, const LoopSettings &settings, const std::string &text)
    : dynamic(settings.dynamic), integrator(settings.dynamic ? settings.integrator.name : "statics"), dt(settings.dt),
      topology_hash(topologyOf(scene)), scene_hash(hashOf(text)) {
  addOptions(facts, settings);
  add(facts, Kind::scene, "gravity", textOf(scene.gravity));
  if (!scene.rotation.angular_velocity.isZero(0))
    add(facts, Kind::scene, "rotation",
        textOf(scene.rotation.angular_velocity) + " about " + textOf(scene.rotation.centre));
  for (const Rod &rod : scene.rods) addFactsOf(rod, facts);
  for (const Body &b : scene.bodies) addFactsOf(b, facts);
  addNamesOfRods(facts, scene);
  addHolders(facts, scene);
  addSurfaces(facts, scene);
  addLoads(facts, scene);
}

} // namespace tendril
