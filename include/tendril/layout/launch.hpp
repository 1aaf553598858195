#pragma once
/// \file launch.hpp
/// How MPI starts: in a process that no launcher has started, and in one of several.

#include <cstdlib>
#include <initializer_list>

namespace tendril {

/// The rank that a launcher says a process has, before MPI has started; 0 without one.
inline int launchedRank() {
  for (const char *rank : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"})
    if (const char *text = std::getenv(rank)) return std::atoi(text);
  return 0;
}

/// Whether a launcher has started the process, alone or as one of several.
inline bool isLaunched() {
  for (const char *launched : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"})
    if (std::getenv(launched)) return true;
  return false;
}

/// Open MPI starts a daemon and asks all networks for a process by itself, too: most of the time of a small run.
/// Without a launcher there is nobody to talk to, and this leaves both out. Ranks that wait give way to those that do
/// not, which they may share a processor with. What the environment says already, stays. Call before PetscInitialize.
inline void prepareMpi() {
  if (isLaunched()) {
    setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);
    return;
  }
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  setenv("OMPI_MCA_orte_create_session_dirs", "0", 0); // all that are isolated would have the same
  setenv("OMPI_MCA_pml", "ob1", 0);
  setenv("OMPI_MCA_btl", "self", 0);
}

} // namespace tendril
