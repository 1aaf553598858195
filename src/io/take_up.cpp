#include "tendril/io/take_up.hpp"

#include "tendril/io/checks.hpp"
#include "tendril/io/prepare.hpp"

#include <filesystem>
#include <sstream>

namespace tendril {

static bool isInside(const std::string &file, const std::string &folder) {
  std::error_code none;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(file, none),
                              top = std::filesystem::weakly_canonical(folder, none);
  return std::mismatch(top.begin(), top.end(), whole.begin(), whole.end()).first == top.end();
}

/// Reads the newest checkpoint of the folder that is whole. \return which, empty where there is none
static std::string readNewest(const Options &o, const OutputFolder &folder, const RunFacts &facts, Simulation &run,
                              StepControl *control, bool *changed, std::vector<std::string> *told) {
  for (const std::string &path : folder.checkpoints()) {
    try {
      *changed = readCheckpoint(path, &run, control, facts, told);
      return path;
    } catch (const DamagedCheckpoint &e) {
      told->push_back("passed over: " + std::string(e.what()));
    }
  }
  if (!told->empty())
    throw SceneError("option -restart: no checkpoint in '" + o.output_dir + "' is whole (" + told->front() +
                     "); to run from the start, without those results, take '-restart auto' away");
  told->push_back("-restart auto: no checkpoint in " + o.output_dir + ", from the start");
  return "";
}

/// Reads the checkpoint that was asked for. \return its path
static std::string readAsked(const Options &o, const RunFacts &facts, Simulation &run, StepControl *control,
                             bool *changed, std::vector<std::string> *told) {
  const std::string from = std::filesystem::is_directory(o.restart)
                               ? (std::filesystem::path(o.restart) / "checkpoint.h5").string()
                               : o.restart;
  if (!std::filesystem::exists(from))
    throw SceneError("option -restart: there is no checkpoint '" + from +
                     "'; give that of a run, or its output folder");
  *changed = readCheckpoint(from, &run, control, facts, told);
  if (isInside(from, o.output_dir))
    throw SceneError("option -restart: the results would replace those beside the checkpoint '" + from +
                     "'; choose another -output_dir, or write -restart auto");
  if (o.restart_time) run.state.time = *o.restart_time;
  if ((!run.scene.colliders.empty() || run.scene.touchesMoving()) && (*changed || o.restart_time)) refuseOverlaps(run);
  return from;
}

bool takeUp(const Options &o, const OutputFolder &folder, const RunFacts &facts, Simulation &run, StepControl *control,
            std::vector<std::string> *told) {
  const bool automatic = o.restart == "auto";
  std::string from;
  bool changed = false;
  if (!o.restart.empty() && !o.loop.dynamic && o.loop.continuation == Continuation::arclength)
    throw SceneError("option -restart: -continuation arclength cannot be taken up again");
  if (automatic && o.restart_time)
    throw SceneError("option -restart_time: -restart auto goes on at the time of its checkpoint");
  if (automatic)
    from = readNewest(o, folder, facts, run, control, &changed, told);
  else if (!o.restart.empty())
    from = readAsked(o, facts, run, control, &changed, told);
  if (!from.empty() && !(run.state.time < o.loop.t_end)) {
    if (changed && !o.loop.dynamic) {
      run.state.time = 0;
      *control = {};
      told->push_back("the load factor begins anew at 0");
    } else if (automatic && !changed) {
      std::printf("complete already: %s is at the end, nothing is left to do\n", from.c_str());
      return false;
    } else {
      std::ostringstream time;
      time << run.state.time;
      throw SceneError("option -restart: the checkpoint is at " +
                       std::string(o.loop.dynamic ? "time " : "load factor ") + time.str() + ", nothing is left to do" +
                       (o.loop.dynamic ? "; write a larger -t_end, or another -restart_time" : ""));
    }
  }
  if (from.empty() || !automatic) {
    std::string names;
    for (const std::string &name : folder.clear()) names += (names.empty() ? "" : ", ") + name;
    if (!names.empty()) told->push_back("removed from " + o.output_dir + ", of an earlier run: " + names);
  } else
    from = folder.setAside(from);
  if (from.empty()) return true;
  std::ostringstream line;
  line << "goes on from " << from << " at " << (o.loop.dynamic ? "time " : "load factor ") << run.state.time;
  told->insert(told->begin(), line.str());
  return true;
}

} // namespace tendril
