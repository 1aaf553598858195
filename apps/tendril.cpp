/// tendril: dynamics and statics of the rods of a scene.
///
/// Each step minimises an incremental potential over the configuration manifold of framed polylines (docs/theory.md): stretch, bend and twist
/// of discrete elastic rods (Bergou et al. 2008, 2010), inertia and dissipation, by Newton with the exact Hessian.
///
///     clamp |=====o-----o-----o-----o   vertex o: position;  edge -----: director (twist)
///
/// Sample runs:
///   tendril -scene data/scenes/helix.yaml -output_dir out/helix
///   tendril -scene data/scenes/cantilever.yaml -rod_young 1e9 -dt 1e-2 -snes_monitor
///   tendril -scene data/scenes/elastica.yaml -load_steps 4 -output_fields position,director
///   tendril -scene data/scenes/twisted_ring.yaml -log_view
#include "tendril/io/run.hpp"

int main(int argc, char **argv) { return tendril::runMain(argc, argv); }
