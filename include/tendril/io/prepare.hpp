#pragma once
/// \file prepare.hpp
/// From a scene file and options to a scene that is ready to run.

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/dynamics/slice.hpp"
#include "tendril/io/options.hpp"

namespace tendril {

class BucklingPath;

/// A scene ready to run, on this rank its part of it; and as written, when it may have to be drawn again.
struct Prepared {
  Team team;                             ///< of the ranks that have rods; empty on others
  std::unique_ptr<Simulation> run;       ///< of the rods of this rank
  std::unique_ptr<Simulation> described; ///< the whole scene, where the leading rank has a part only
  Slice slice;
  SceneSource source;
  std::vector<std::string> notes, ranks; ///< to be told: of the scene; of how it is dealt out
  std::shared_ptr<const Scene> all; ///< on every rank, where what different ranks have may come to touch; else null
  std::shared_ptr<BucklingPath> buckling; ///< that has been followed; else null
  Scene written;
  std::vector<Drawing> drawings;

  /// What results are made of: the whole scene with the state collected last; on the leading rank.
  Simulation &whole() const { return described ? *described : *run; }
  /// A state of the whole scene on the leading rank, from the parts of all.
  const State &collect(const State &part) const {
    if (slice.isAll()) return part;
    slice.collect(*run->elements, part, described ? described->elements.get() : nullptr, &whole().state);
    return whole().state;
  }
  /// The state of the whole scene to the parts of all ranks.
  void spread() const {
    if (!slice.isAll())
      slice.spread(*run->elements, &run->state, described ? described->elements.get() : nullptr, &whole().state);
  }
};

/// Reads the scene and sets everything up, on all ranks of the program. \throws SceneError
void prepare(Prepared &prepared, Options &options);
/// Has what may touch in the next step on one rank each (StepSolver::groups), with its state; a rank that has nothing
/// then is no longer of the team. \param line what to tell of it
PetscErrorCode unite(Prepared &prepared, const Options &options, std::string *line);
/// Gives rods that chose a model all their unknowns; the state stays.
PetscErrorCode leaveModel(RodModel model, Prepared &prepared, const Options &options);
/// Chooses the edges, and in dynamics the steps, and makes the scene ready to run with them.
void meetAccuracy(Prepared &prepared, Options &options, Choice *choice);

} // namespace tendril
