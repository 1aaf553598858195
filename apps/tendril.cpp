/// tendril: dynamics and statics of the rods of a scene.
///
/// Each step minimises an incremental potential over the configuration manifold of framed polylines (docs/theory.md):
/// stretch, bend and twist of discrete elastic rods (Bergou et al. 2008, 2010), inertia and dissipation, by Newton with
/// the exact Hessian.
///
///     clamp |=====o-----o-----o-----o   vertex o: position;  edge -----: director (twist)
///
/// Sample runs, from the root of the repository; each is a test (options/README.md):
///   tendril -options_file options/cases/helix.yaml
///   tendril -options_file options/cases/cantilever.yaml -options_file options/dynamics/accurate.yaml
///   tendril -options_file options/cases/elastica_accuracy.yaml
///   tendril -options_file options/cases/helix.yaml -options_file options/profile.yaml
///   tendril -options_file options/cases/column.yaml
///   tendril -options_file options/cases/hung_spring_modes.yaml
///   tendril -options_file options/cases/deep_arch.yaml
#include "tendril/io/run.hpp"

int main(int argc, char **argv) { return tendril::runMain(argc, argv); }
