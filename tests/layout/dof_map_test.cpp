/// Where unknowns and elements are: numbers without gaps, room that nothing shares, and the way to PETSc and back.
#include "support/rods.hpp"

#include <set>

namespace tendril::test {
namespace {

/// A rod with clamps at an end and along it, a cable with pins, and a ring.
Scene lineAndRing() {
  Scene scene;
  Rod bar = straightRod(12), cable = straightRod(7), ring;
  cable.material.flexural_stiffness = {0, 0};
  cable.material.torsional_stiffness = 0;
  ring = inextensibleRod(ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.5, 9).points);
  ring.closed = true;
  setBishopDirectors(ring);
  scene.rods = {bar, cable, ring};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 0, 5, Support::Kind::clamp),
                    hold(scene, 0, 8, Support::Kind::fix_twist), hold(scene, 1, 3, Support::Kind::pin),
                    hold(scene, 2, 4, Support::Kind::clamp)};
  return scene;
}

struct Mapped {
  Scene scene = lineAndRing();
  DofMap dofs;
  std::unique_ptr<Elements> elements;
  Mapped() {
    EXPECT_EQ(dofs.setUp(scene), PetscErrorCode(0));
    elements = std::make_unique<Elements>(scene, dofs);
  }
};

TEST(DofMap, NumbersWhatIsFreeOneAfterTheOther) {
  const Mapped m;
  // 11 of 13 vertices and 12 twists; 7 of 8 vertices; 8 of 9 vertices and 9 twists
  EXPECT_EQ(m.dofs.unknowns(), 3 * 11 + 12 + 3 * 7 + 3 * 8 + 9);
  PetscInt next = 0;
  for (const RodRange &rod : m.dofs.rods())
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (const PetscInt u = m.dofs.unknown(s, a); u >= 0) EXPECT_EQ(u, next++);
  EXPECT_EQ(next, m.dofs.unknowns());
  for (const int v : {0, 5}) EXPECT_EQ(m.dofs.unknown(m.dofs.rods()[0].slot(v), 0), -1) << v;
  EXPECT_GE(m.dofs.unknown(m.dofs.rods()[0].slot(8), 0), 0);   // its twist alone is held
  EXPECT_EQ(m.dofs.unknown(m.dofs.rods()[1].slot(0), 3), -1);  // a cable has no twist
  EXPECT_EQ(m.dofs.unknown(m.dofs.rods()[0].slot(12), 3), -1); // nor has the last vertex an edge
}

TEST(DofMap, GivesEverythingASlotOfItsOwn) {
  const Mapped m;
  std::set<int> slots;
  auto take = [&](int s) {
    EXPECT_TRUE(slots.insert(s).second) << s;
    EXPECT_LT(s, m.elements->slots);
  };
  for (const int s : m.elements->vertex_slot) take(s);
  for (const RodRange &rod : m.dofs.rods())
    for (int k = 0; k < 2 && rod.closed; ++k) take(rod.slot(rod.vertices + k)); // copies
  int frames = 0;
  for (std::size_t s = 0; s < m.scene.supports.size(); ++s) {
    const int frame = m.elements->support_slot[s];
    frames += frame >= 0;
    if (frame >= 0) take(frame);
  }
  EXPECT_EQ(frames, 4); // a pin has none
  int loose = 0;
  for (std::size_t r = 0; r < m.dofs.rods().size(); ++r)
    for (const LooseCell &cell : m.elements->loose[r]) {
      take(cell.slot);
      const RodRange &rod = m.dofs.rods()[r]; // beside its rod, where the windows of blocks reach
      EXPECT_GE(cell.slot, rod.looseSlot());
      EXPECT_LT(cell.slot, rod.first_slot + rod.slots - 1);
      ++loose;
    }
  EXPECT_EQ(loose, 6); // two for each support along a rod that holds a twist
}

TEST(DofMap, GoesToPetscAndBack) {
  Mapped m;
  Planes values = m.dofs.makePlanes(), back = m.dofs.makePlanes();
  for (const RodRange &rod : m.dofs.rods())
    for (int s = rod.first_slot; s < rod.vertexEnd() + 2; ++s)
      for (int a = 0; a < slot_size; ++a) values[a][s] = 1 + 10 * s + a;
  OwnedVec x;
  EXPECT_PETSC(DMCreateGlobalVector(m.dofs.dm(), x.out()));
  EXPECT_PETSC(m.dofs.gather(values, m.dofs.all(), x));
  EXPECT_PETSC(m.dofs.scatter(x, m.dofs.all(), back));
  for (const RodRange &rod : m.dofs.rods()) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        EXPECT_EQ(back[a][s], m.dofs.unknown(s, a) >= 0 ? values[a][s] : 0) << s << " " << a;
    if (!rod.closed) continue;
    for (const int k : {0, 1}) EXPECT_EQ(back[1][rod.slot(rod.vertices + k)], back[1][rod.slot(k)]);
  }
  const std::vector<char> wanted{true, false, true};
  EXPECT_PETSC(m.dofs.gather(values, m.dofs.all(), x, &wanted));
  EXPECT_PETSC(m.dofs.scatter(x, m.dofs.all(), back));
  EXPECT_EQ(back[0][m.dofs.rods()[1].slot(1)], 0);
  EXPECT_EQ(back[0][m.dofs.rods()[2].slot(1)], values[0][m.dofs.rods()[2].slot(1)]);
}

TEST(DofMap, FoldsWhatWasSummedBehindARing) {
  const Mapped m;
  const RodRange &ring = m.dofs.rods()[2];
  Planes sums = m.dofs.makePlanes();
  for (int s = ring.first_slot; s < ring.vertexEnd() + 2; ++s) sums[2][s] = s - ring.first_slot;
  m.dofs.fold(ring, sums);
  EXPECT_EQ(sums[2][ring.slot(0)], 0 + 9);
  EXPECT_EQ(sums[2][ring.slot(1)], 1 + 10);
  EXPECT_EQ(sums[2][ring.slot(2)], 2);
  EXPECT_EQ(sums[2][ring.slot(9)], 0);
}

} // namespace
} // namespace tendril::test
