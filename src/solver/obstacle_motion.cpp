/// Obstacles that move within a step, and how far rods can go between them.
#include "tendril/solver/incremental_potential.hpp"

namespace tendril {

double IncrementalPotential::freeFraction(const Configuration &from, const Configuration &to, int r) const {
  double free = 1;
  for (const auto &term : terms_) free = std::min(free, term->freeFraction(from, to, r));
  return free;
}

/// As far as they can go while the rod stays; the rest is left to the iterations.
void IncrementalPotential::moveObstacles(int r) {
  constexpr double margin = 0.5; // closer, it would press harder than need be
  for (double part = 1; part == 1 && obstaclesRemain(r);) {
    const double from = iterate_.obstacleTime(r), to = nextObstacleTime(r);
    start_.setObstacleTime(r, from);
    double free = 0;
    for (int tries = 0; tries < 60 && free < 1; ++tries) { // a part of the time need not be that of the way
      iterate_.setObstacleTime(r, part == 1 ? to : from + part * (to - from));
      free = freeFraction(start_, iterate_, r);
      if (free < 1) part *= margin * free;
    }
    if (free < 1) iterate_.setObstacleTime(r, from);
  }
  start_.setObstacleTime(r, start_time_);
  for (auto &term : terms_) term->moveIterate(iterate_, r);
}

} // namespace tendril
