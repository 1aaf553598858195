/// The elimination of runs a pack at once.
#include "tendril/solver/condensed_elimination.hpp"

namespace tendril {

template void CondensedFactor::factorGroup<Pack>(const Group &, const BandedSystem &);

} // namespace tendril
