#pragma once
/// \file options.hpp
/// The command line: options of our own, listed by -help and read as text, so that a mistake is told in one line.

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/io/trajectory.hpp"

#include <array>
#include <set>
#include <string_view>

namespace tendril {

/// Words of -bifurcation, in the order of Bifurcation.
inline constexpr std::array<std::string_view, 4> bifurcations{"off", "locate", "stop", "switch"};

/// Words of -partition, in the order of PartitionKind.
inline constexpr std::array<std::string_view, 3> partitions{"auto", "contiguous", "metis"};

/// Load factor up to which critical ones are looked for, unless told.
constexpr double furthest_buckling = 100;

/// What is in force in a run: the command line over the scene's `simulation` block.
struct Options {
  std::string scene; ///< empty when not given
  bool help = false, schema = false, keys = false;
  std::optional<std::string> mode; ///< these as given; `loop` holds what is in force
  std::optional<double> dt, t_end;
  std::string dynamic_only; ///< an option that was given and means something in dynamics only
  std::optional<int> given_load_steps, arclength_steps;
  std::optional<Continuation> continuation;
  std::optional<Bifurcation> bifurcation;
  Overrides overrides;
  LoopSettings loop;
  PartitionKind partition = PartitionKind::automatic;
  int load_steps = 1;
  bool modes_given = false;
  int modes = 0; ///< natural frequencies, or buckling modes, to find; 0 in other modes
  bool buckling = false;
  std::optional<double> buckling_to; ///< as given
  std::optional<Vec3> gravity;
  std::vector<std::pair<std::string, int>> rod_edges; ///< by names of rods, in order of the command line
  std::string output_dir = "out";
  std::string output_shapes; ///< file for the rods as drawn; empty: none
  double output_interval = 0;
  int checkpoint_interval = 0;        ///< steps; 0: only at the end
  std::string restart;                ///< checkpoint to go on from, `auto`, or empty
  std::optional<double> restart_time; ///< [s]
  std::optional<double> time_limit;   ///< [s]
  std::set<std::string> fields;
  bool error_estimate = false;
  bool model_check = false;
  std::optional<Accuracy> accuracy;
  std::optional<Quantity> accuracy_of; ///< as given
};

/// Reads our options from PETSc's data base. \throws SceneError naming the option.
PetscErrorCode readOptions(int argc, char **argv, Options *options);

/// Fills `loop` and what the command line leaves open from the scene. \throws SceneError
void resolve(const RunSettings &scene, Options &options);

/// The edges of every rod, those of -rod_edges in place of the scene's. \throws SceneError
std::vector<int> edgesAsked(const Scene &scene, const Options &options);

/// Options that nobody has asked for, in the order of the command line; call when the solvers are set up.
/// \param touches whether rods may come to touch each other, which MUMPS solves then
PetscErrorCode unusedOptions(bool touches, std::vector<std::string> *unused);
/// \throws SceneError with what may have been meant
[[noreturn]] void refuseUnused(const std::string &option);

/// Writes all that is in force, PETSc's options included, as YAML, and returns what it wrote.
std::string writeOptionsFile(const std::string &path, const Options &options, const Provenance &provenance,
                             const Scene &scene);

} // namespace tendril
