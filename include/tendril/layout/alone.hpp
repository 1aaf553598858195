#pragma once
/// \file alone.hpp
/// Starting MPI in a process that no launcher has started.

#include <cstdlib>
#include <initializer_list>

namespace tendril {

/// Open MPI starts a daemon and asks all networks for a process by itself, too: most of the time of a small run.
/// Without a launcher there is nobody to talk to, and this leaves both out. What the environment says already, stays.
/// Call before PetscInitialize.
inline void startAlone() {
  for (const char *launched : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"})
    if (std::getenv(launched)) return;
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  setenv("OMPI_MCA_orte_create_session_dirs", "0", 0); // all that are isolated would have the same
  setenv("OMPI_MCA_pml", "ob1", 0);
  setenv("OMPI_MCA_btl", "self", 0);
}

} // namespace tendril
