#include "tendril/io/summary.hpp"

#include "tendril/energy/widest_angle.hpp"
#include "tendril/io/text.hpp"

#include <iomanip>
#include <limits>
#include <sstream>
#include <utility>

namespace tendril {
namespace {

/// Parts of a vector that are rounding of its size are told as 0.
std::string textOf(const Vec3 &x, const char *unit) {
  std::ostringstream out;
  out << std::setprecision(5);
  for (int k = 0; k < 3; ++k) out << (k ? ", " : "(") << (std::abs(x[k]) > 1e-9 * x.norm() ? x[k] : 0.0);
  out << ") " << unit;
  return out.str();
}

} // namespace

Summary summarize(const Scene &scene, const Elements &elements, const State &state, double load_factor, bool dynamic) {
  Summary out;
  out.time = state.time;
  const RodActions actions = rodActions(scene, elements, state, state.time, load_factor, dynamic);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    for (int i = 0; i < rod.vertices; ++i) {
      const Vec3 &x = state.position[rod.first_vertex + i];
      out.mass += elements.mass()[rod.slot(i)];
      out.centre_of_mass += elements.mass()[rod.slot(i)] * x;
      out.displacement.include((x - scene.rods[r].position[i]).norm(), int(r), i);
    }
    for (int i = 0; i < rod.edges; ++i) {
      const int e = rod.first_edge + i;
      const Vec3 edge = state.position[elements.vertex1[e]] - state.position[elements.vertex0[e]];
      const double along = actions.force[e].dot(edge.normalized());
      out.tension.include(along, int(r), i);
      out.compression.include(-along, int(r), i);
    }
  }
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) { // with the vertices that are tied to them
    out.mass += elements.bodyMass(int(b)).mass;
    out.centre_of_mass += elements.bodyMass(int(b)).mass * state.body_position[b];
  }
  out.centre_of_mass /= out.mass;
  WidestAngle widest{0};
  widest.every_measure = true;
  widest.include(scene, elements, state);
  out.angle = {widest.angle, widest.rod, widest.vertex};
  out.force = actions.reaction;
  out.moment = actions.reaction_moment;
  for (std::size_t s = 0; s < scene.supports.size(); ++s) {
    const Support &support = scene.supports[s];
    out.total_force += out.force[s];
    out.total_moment +=
        state.position[elements.rods[support.rod].first_vertex + support.vertex].cross(out.force[s]) + out.moment[s];
  }
  for (std::size_t k = 0; k < scene.constraints.size(); ++k) {
    const ConstraintReading &c = actions.constraint[k];
    const Constraint &constraint = scene.constraints[k];
    out.constraint.push_back(c);
    if (!constraint.isToWorld()) continue; // both its forces act on rods and bodies
    out.total_force += c.force;
    if (constraint.isPin())
      out.total_moment += state.position[elements.rods[constraint.rod].first_vertex + constraint.at].cross(c.force);
    out.total_moment += c.moment;
  }
  out.joint = actions.joint;
  for (std::size_t k = 0; k < scene.joints.size(); ++k) {
    const Joint &joint = scene.joints[k];
    if (joint.parent >= 0) continue;
    const Mat3 turned = rotationOf(state, elements.body(joint.child).group);
    const Vec3 point =
        state.body_position[joint.child] + turned * (joint.point - elements.bodyMass(joint.child).centre);
    out.total_force += out.joint[k].force;
    out.total_moment += point.cross(out.joint[k].force) + out.joint[k].moment;
  }
  return out;
}

static std::string supportText(const Summary &s, const Scene &scene, std::size_t k) {
  const Support &support = scene.supports[k];
  std::string what = support.holdsPosition() ? textOf(s.force[k], "N") : "";
  if (support.holdsTwist()) what += (what.empty() ? "" : ", ") + textOf(s.moment[k], "N m");
  return what + ": " + nameOf(support.kind) + " at vertex " + std::to_string(support.vertex) + " of rod '" +
         scene.rods[std::size_t(support.rod)].name + "'";
}

static std::string constraintText(const Summary &s, const Scene &scene, std::size_t k) {
  const Constraint &c = scene.constraints[k];
  return (c.isPin() ? textOf(s.constraint[k].force, "N") + ": pin '"
                    : textOf(s.constraint[k].moment, "N m") + ": rotation '") +
         inOneLine(c.name) + "' " + (c.isPin() ? "at vertex " : "on edge ") + std::to_string(c.at) + " of rod '" +
         scene.rods[std::size_t(c.rod)].name + "', " +
         (c.isToBody() ? "to body '" + scene.bodies[std::size_t(c.to_body)].name + "', "
          : c.isTie()  ? "to vertex " + std::to_string(c.to_vertex) + " of rod '" +
                            scene.rods[std::size_t(c.to_rod)].name + "', "
                      : "") +
         (c.isPin() ? textOf(s.constraint[k].distance, "m") + " off"
                    : textOf(s.constraint[k].rotation, "rad") + " off");
}

static std::string jointText(const Summary &s, const Scene &scene, std::size_t k) {
  const Joint &j = scene.joints[k];
  const JointReading &of = s.joint[k];
  std::string what = textOf(of.force, "N") + ", " + textOf(of.moment, "N m") + ": " + std::string(nameOf(j.type)) +
                     " '" + inOneLine(j.name) + "' of body '" + scene.bodies[std::size_t(j.child)].name + "'";
  std::ostringstream at;
  at << std::setprecision(5) << of.coordinate;
  if (j.held().slidesFreely())
    what += ", at " + at.str() + " m";
  else if (j.type != Joint::Type::fixed)
    what += ", at " + at.str() + " rad";
  return what;
}

std::vector<std::string> describe(const Summary &s, const Scene &scene) {
  std::vector<std::string> lines;
  auto row = [&](const std::string &name, const std::string &value, const std::string &where) {
    std::ostringstream line;
    line << "  " << std::left << std::setw(14) << name << std::setw(where.empty() ? 0 : 18) << value << where;
    lines.push_back(line.str());
  };
  auto largest = [&](const char *name, const Summary::Extreme &e, double scale, const char *unit, const char *place) {
    if (e.rod < 0) return;
    std::ostringstream value;
    value << std::setprecision(5) << e.value * scale << ' ' << unit;
    row(name, value.str(),
        std::string(place) + " " + std::to_string(e.at) + " of rod '" + scene.rods[std::size_t(e.rod)].name + "'");
  };
  lines.push_back("at the end, largest values and where:");
  largest("displacement", s.displacement, 1, "m", "vertex");
  largest("tension", s.tension, 1, "N", "edge");
  largest("compression", s.compression, 1, "N", "edge");
  largest("angle", s.angle, 180 / pi, "deg", "vertex");
  std::ostringstream mass;
  mass << std::setprecision(5) << s.mass << " kg";
  row("mass", mass.str(), "centre " + textOf(s.centre_of_mass, "m"));
  const char *name = "reactions";
  if (scene.supports.size() + scene.constraints.size() + scene.joints.size() > 1)
    row(std::exchange(name, ""),
        textOf(s.total_force, "N") + " in all; about the origin " + textOf(s.total_moment, "N m"), "");
  for (std::size_t k = 0; k < scene.supports.size() && scene.supports.size() <= most_supports_told; ++k)
    row(std::exchange(name, ""), supportText(s, scene, k), "");
  for (std::size_t k = 0; k < scene.constraints.size() && scene.constraints.size() <= most_supports_told; ++k)
    row(std::exchange(name, ""), constraintText(s, scene, k), "");
  for (std::size_t k = 0; k < scene.joints.size() && scene.joints.size() <= most_supports_told; ++k)
    row(std::exchange(name, ""), jointText(s, scene, k), "");
  return lines;
}

Summary emptySummary(const Scene &scene) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Summary out;
  out.time = out.mass = nan;
  for (Summary::Extreme *e : {&out.displacement, &out.tension, &out.compression, &out.angle}) e->value = nan;
  for (Vec3 *x : {&out.centre_of_mass, &out.total_force, &out.total_moment}) x->setConstant(nan);
  out.force.assign(scene.supports.size(), Vec3::Constant(nan));
  out.moment = out.force;
  return out;
}

void writeSummary(Hdf5File &file, const Summary &s) {
  auto vectors = [&](const char *name, const Vec3 *x, std::size_t n) {
    file.writeAttribute("summary", name, std::vector<double>(x->data(), x->data() + 3 * n));
  };
  auto extreme = [&](const std::string &name, const Summary::Extreme &e, const char *place) {
    file.writeAttribute("summary", "largest_" + name, e.value);
    file.writeAttribute("summary", "largest_" + name + "_rod", e.rod);
    file.writeAttribute("summary", "largest_" + name + "_" + place, e.at);
  };
  file.writeAttribute("summary", "time", s.time);
  file.writeAttribute("summary", "mass", s.mass);
  vectors("centre_of_mass", &s.centre_of_mass, 1);
  extreme("displacement", s.displacement, "vertex");
  extreme("tension", s.tension, "edge");
  extreme("compression", s.compression, "edge");
  extreme("angle", s.angle, "vertex");
  vectors("total_reaction", &s.total_force, 1);
  vectors("total_reaction_moment", &s.total_moment, 1);
  if (s.force.empty() || s.force.size() > most_supports_told) return;
  vectors("reaction", s.force.data(), s.force.size());
  vectors("reaction_moment", s.moment.data(), s.moment.size());
}

} // namespace tendril
