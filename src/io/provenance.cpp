#include "tendril/io/provenance.hpp"

#include <ctime>
#include <iomanip>
#include <petscsys.h>
#include <sstream>

namespace tendril {

static std::string petscVersion() {
  char version[256];
  (void)PetscGetVersion(version, sizeof version);
  return version;
}

std::string versionText() {
  return std::string("tendril ") + TENDRIL_VERSION + " (" + TENDRIL_GIT_COMMIT + "), " + petscVersion();
}

Provenance provenance(int argc, char **argv) {
  Provenance p;
  for (int i = 0; i < argc; ++i) {
    if (i) p.command_line += ' ';
    p.command_line += argv[i];
  }
  char *all = nullptr;
  if (PetscOptionsGetAll(nullptr, &all) == 0 && all) p.options = all;
  (void)PetscFree(all);
  p.version = TENDRIL_VERSION;
  p.git_commit = TENDRIL_GIT_COMMIT;
  p.petsc_version = petscVersion();
  const std::time_t now = std::time(nullptr);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  p.created = stamp;
  return p;
}

std::string groupsText(const Scene &scene) {
  std::vector<std::vector<char>> corners(scene.rods.size()); // in rigid groups of junctions
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) {
      if (m.group < 0) continue;
      corners[m.rod].resize(scene.rods[m.rod].vertices(), false);
      corners[m.rod][m.vertex] = true;
    }
  std::ostringstream s;
  s << std::setprecision(4);
  const std::size_t shown = std::min<std::size_t>(scene.rods.size(), 4);
  for (std::size_t r = 0; r < shown; ++r) {
    const DimensionlessGroups g = dimensionlessGroups(scene.rods[r], scene.gravity, corners[r]);
    s << "rod '" << scene.rods[r].name << "': " << scene.rods[r].edges() << " edges, length " << g.length << " m";
    if (scene.rods[r].bends() && scene.rods[r].model != RodModel::full) s << ", model " << nameOf(scene.rods[r].model);
    if (scene.rods[r].material.isCable())
      s << ", a cable\n";
    else
      s << ", rho g L^3/EI " << g.gravito_bending << ", EA L^2/EI " << g.axial_to_bending << ", largest turning "
        << g.largest_turning << " deg and twist " << g.largest_twist << " deg per vertex\n";
  }
  if (shown < scene.rods.size()) s << "... and " << scene.rods.size() - shown << " more rods\n";
  constexpr double soft = 1e-4; // of the rod's own bending
  double turning = 0, twist = 0;
  bool told = false;
  for (const Rod &rod : scene.rods) {
    if (rod.material.isCable()) continue; // free to fold
    const DimensionlessGroups g =
        dimensionlessGroups(rod, scene.gravity, corners[std::size_t(&rod - scene.rods.data())]);
    turning = std::max(turning, g.largest_turning);
    twist = std::max(twist, g.largest_twist);
    if (told || !(g.corner_softness > soft)) continue;
    s << "warning: rod '" << rod.name << "' has a corner at vertex " << g.softest_corner
      << ", which 'energy: seed' makes softer by " << shortText(g.corner_softness)
      << " of the bending of the whole rod, more with shorter edges, for stretch turns it; use 'energy: classical'\n";
    told = true;
  }
  if (turning > 30 || twist > 30)
    s << "warning: neighbouring edges turn or twist by up to " << std::max(turning, twist)
      << " degrees; above 30 the strains are more than 10 % off: use more edges\n";
  return s.str();
}

} // namespace tendril
