/// The elimination of runs one by one.
#include "tendril/solver/condensed_elimination.hpp"

namespace tendril {

template void CondensedFactor::factorGroup<double>(const Group &, const BandedSystem &);

} // namespace tendril
