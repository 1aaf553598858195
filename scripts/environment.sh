# Open MPI as root, with more ranks than cores: what containers and test machines need.
# Ranks that wait give way to others: without it, ranks that share a core stand in each other's way.
export OMPI_MCA_mpi_yield_when_idle=1
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
