#pragma once
/// \file prolong.hpp
/// A state carried to the same rods with twice the edges: from there Newton finds the equilibrium that belongs to it,
/// whatever others there are.

#include "tendril/state/state.hpp"

namespace tendril {

/// Old vertices stay, new ones lie on the curve through them (curveThrough), where they cut the edges at rest; twist,
/// with its whole turns, is spread as it was; at rest. \param fine the scene of `scene` remeshed with twice the edges
State prolonged(const State &state, const Scene &scene, const Elements &elements, const Scene &fine,
                const Elements &fine_elements);

} // namespace tendril
