#include "tendril/layout/launch.hpp"
#include "tendril/solver/events.hpp"
#include "tendril/solver/newton.hpp"

#include <gtest/gtest.h>

int main(int argc, char **argv) {
  testing::InitGoogleTest(&argc, argv);
  tendril::prepareMpi();
  if (PetscInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  if (tendril::registerEvents() || tendril::registerSolvers()) return 1;
  const int result = RUN_ALL_TESTS();
  (void)PetscFinalize();
  return result;
}
