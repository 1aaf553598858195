#include "tendril/dynamics/integrator.hpp"

#include "tendril/model/scene.hpp"

namespace tendril {
namespace {

/// All methods. A new one needs its line here and nothing else.
struct Entry {
  const char *name, *meaning;
  std::unique_ptr<Integrator> (*make)(const IntegratorSettings &);
};
constexpr Entry entries[] = {
    {"euler", "backward Euler, first order, most dissipative", makeEuler},
    {"bdf2", "second order, L-stable, most accurate per solve on stiff rods", makeBdf2},
    {"sdirk2", "second order, L-stable, two solves a step", makeSdirk2},
    {"midpoint", "second order, keeps the energy within a band, damps nothing", makeMidpoint},
    {"generalized_alpha", "second order, damps high frequencies by -rho_inf", makeGeneralizedAlpha},
};

} // namespace

std::vector<std::string> integratorNames() {
  std::vector<std::string> names;
  for (const Entry &e : entries) names.emplace_back(e.name);
  return names;
}

std::string integratorMeanings() {
  std::string text;
  for (const Entry &e : entries) text += std::string(text.empty() ? "" : "; ") + e.name + " (" + e.meaning + ")";
  return text;
}

std::unique_ptr<Integrator> makeIntegrator(const IntegratorSettings &settings) {
  for (const Entry &e : entries)
    if (settings.name == e.name) return e.make(settings);
  throw SceneError("there is no integrator '" + settings.name + "'; choose from " + integratorMeanings());
}

} // namespace tendril
