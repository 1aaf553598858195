/// options.yaml: all that is in force in a run.
#include "tendril/io/options.hpp"

#include <yaml-cpp/yaml.h>

#include <fstream>

namespace tendril {

namespace {

/// The text of options.yaml, part by part.
class OptionsText {
public:
  OptionsText(const Options &options, const Scene &scene) : o(options), scene(scene) { out.SetDoublePrecision(17); }

  std::string write(const Provenance &p) {
    out << YAML::Comment("All that was in force in this run.") << YAML::BeginMap;
    put("command_line", p.command_line);
    put("tendril_version", p.version);
    put("git_commit", p.git_commit);
    put("petsc_version", p.petsc_version);
    put("scene", o.scene);
    putTime();
    putOutput();
    putSolver();
    putRods();
    put("petsc_options", p.options);
    out << YAML::EndMap;
    return std::string(out.c_str()) + "\n";
  }

private:
  const Options &o;
  const Scene &scene;
  YAML::Emitter out;

  template <class Value> void put(const char *key, const Value &value) {
    out << YAML::Key << key << YAML::Value << value;
  }
  template <class Iterator> void list(const char *key, Iterator begin, Iterator end) {
    out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginSeq;
    for (Iterator k = begin; k != end; ++k) out << *k;
    out << YAML::EndSeq;
  }

  void putTime() {
    put("mode", o.buckling ? "buckling" : o.modes > 0 ? "modes" : o.loop.dynamic ? "dynamic" : "static");
    if (o.modes > 0) put("modes", o.modes);
    if (o.buckling) {
      put("buckling_to", o.loop.t_end);
      return put("load_steps", o.load_steps);
    }
    if (o.loop.dynamic) {
      put("dt", o.loop.dt);
      put("t_end", o.loop.t_end);
      put("integrator", o.loop.integrator.name);
      if (o.loop.integrator.name == "generalized_alpha") put("rho_inf", o.loop.integrator.rho_inf);
      put("dt_adapt", o.loop.adapt == Adaptation::error ? "error" : "none");
      if (o.loop.adapt == Adaptation::error) {
        put("dt_rtol", o.loop.dt_rtol);
        put("dt_atol", o.loop.dt_atol);
        if (o.loop.dt_max > 0) put("dt_max", o.loop.dt_max);
      }
    } else {
      put("load_steps", o.load_steps);
      put("continuation", o.loop.continuation == Continuation::load ? "load" : "arclength");
      put("bifurcation", std::string(bifurcations[std::size_t(o.loop.bifurcation)]));
      put("arclength_steps", o.loop.arclength_steps);
    }
    put("dt_min", o.loop.dt_min > 0 ? o.loop.dt_min : o.loop.dt / 1024);
  }

  void putOutput() {
    list("gravity", scene.gravity.data(), scene.gravity.data() + 3);
    put("output_dir", o.output_dir);
    if (!o.output_shapes.empty()) put("output_shapes", o.output_shapes);
    put("output_interval", o.output_interval);
    put("checkpoint_interval", o.checkpoint_interval);
    if (!o.restart.empty()) put("restart", o.restart);
    list("output_fields", o.fields.begin(), o.fields.end());
    put("error_estimate", o.error_estimate);
    put("model_check", o.model_check);
    if (o.accuracy) {
      put("accuracy", o.accuracy->tolerance);
      put("accuracy_of", o.accuracy->of == Quantity::tip      ? "tip"
                         : o.accuracy->of == Quantity::energy ? "energy"
                                                              : "position");
    }
  }

  void putSolver() {
    put("rounding_tolerance", o.loop.solve.rounding_tolerance);
    put("partition", std::string(partitions[int(o.partition)]));
    constexpr const char *searches[] = {"energy", "wolfe", "residual"};
    put("line_search", searches[int(o.loop.solve.line_search)]);
    put("quasi_newton", o.loop.solve.quasi_newton);
    put("retraction", o.loop.solve.retraction == RetractionKind::length ? "length" : "additive");
    put("stretch", o.loop.mixed ? "mixed" : "primal");
    put("hessian", o.loop.hessian == HessianKind::exact ? "exact" : "gauss_newton");
  }

  void putRods() {
    out << YAML::Key << "rods" << YAML::Value << YAML::BeginSeq;
    for (const Rod &rod : scene.rods) {
      const Material &m = rod.material;
      out << YAML::BeginMap;
      put("name", rod.name);
      put("edges", rod.edges());
      put("measure", rod.measure == Measure::tan ? "tan" : "angle");
      put("energy", rod.energy == Energy::seed ? "seed" : "classical");
      put("linear_density", m.linear_density);
      put("linear_rotational_inertia", m.linear_rotational_inertia);
      put("axial_stiffness", m.axial_stiffness);
      put("torsional_stiffness", m.torsional_stiffness);
      list("flexural_stiffness", m.flexural_stiffness.begin(), m.flexural_stiffness.end());
      put("mass_damping_coefficient", m.mass_damping_coefficient);
      put("stiffness_damping_coefficient", m.stiffness_damping_coefficient);
      out << YAML::EndMap;
    }
    out << YAML::EndSeq;
  }
};

} // namespace

std::string writeOptionsFile(const std::string &path, const Options &o, const Provenance &p, const Scene &scene) {
  const std::string text = OptionsText(o, scene).write(p);
  std::ofstream file(path);
  file << text << std::flush;
  if (!file) throw WriteError(path + ": cannot be written; is the disk full?");
  return text;
}

} // namespace tendril
