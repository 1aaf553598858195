/// Where unknowns and elements are: numbers without gaps, room that nothing shares, and the way to PETSc and back.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include <Eigen/Dense>

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

/// Three rods in a junction, the third of which passes through it or is a ring; a fourth beside them. The first two are
/// tied to one frame and the third turns freely, or all three are; a body that the second is welded to and the fourth
/// is pinned to, and a spring from the fourth to a point of it; a tie between the fourth and the third.
Scene netOf(bool ring) {
  Scene scene;
  const Vec3 node(0, 0, 1);
  scene.rods = {inextensibleRod(lineShape({1, 0, 0}, node, 4).points),
                inextensibleRod(lineShape(node, {0, 1, 0}, 3).points),
                inextensibleRod(lineShape({-1, -1, 1}, {1, 1, 1}, 6).points),
                inextensibleRod(lineShape({0, 1, 1}, {1, 2, 0}, 5).points)};
  if (ring) {
    scene.rods[2] = inextensibleRod(ringShape({0, 0, 0.5}, Vec3::UnitX(), 0.5, 7).points);
    scene.rods[2].closed = true;
    setBishopDirectors(scene.rods[2]);
  }
  scene.junctions = {{"node", {{0, 4, 0}, {1, 0, 0}, {2, ring ? 0 : 3, ring ? 0 : -1}}, 1}};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  Body body;
  body.own = {1, Vec3(0.2, 1, 0.3), Mat3::Identity()};
  scene.bodies = {body};
  scene.attachments = {{"weld", 1, 3, 0, true, frameAtVertex(scene.rods[1], 3)},
                       {"pin", 3, 0, 0, false, frameAtVertex(scene.rods[3], 0)}};
  scene.constraints = {pinTo(scene, 3, 2, Vec3(0, 0, 0.1), 1), constraintOn(3, 5, Constraint::Kind::pin, 2)};
  scene.constraints[0].to_body = 0;
  scene.constraints[1].to_rod = 2;
  scene.constraints[1].to_vertex = 1;
  scene.hostBodies();
  return scene;
}

/// That with arms and numbers of its own, and all maps as dense matrices.
struct MappedNet {
  Scene scene;
  DofMap dofs;
  Random random{7};
  explicit MappedNet(bool ring) : scene(netOf(ring)) {
    EXPECT_EQ(dofs.setUp(scene), PetscErrorCode(0));
    for (const JoinedVertex &j : dofs.joinedVertices(dofs.all()))
      if (j.isOnBody()) dofs.setArm(j, random.vector());
  }
  Eigen::VectorXd randomUnknowns() {
    Eigen::VectorXd x(dofs.unknowns());
    for (double &v : x) v = random();
    return x;
  }
  Planes scatter(const Eigen::VectorXd &x) const {
    OwnedVec vec;
    PetscScalar *to;
    Planes values = dofs.makePlanes();
    EXPECT_EQ(DMCreateGlobalVector(dofs.dm(), vec.out()), PetscErrorCode(0));
    EXPECT_EQ(VecGetArrayWrite(vec, &to), PetscErrorCode(0));
    std::copy(x.begin(), x.end(), to);
    EXPECT_EQ(VecRestoreArrayWrite(vec, &to), PetscErrorCode(0));
    EXPECT_EQ(dofs.scatter(vec, dofs.all(), values), PetscErrorCode(0));
    return values;
  }
  Eigen::VectorXd gather(const Planes &values) const {
    OwnedVec vec;
    const PetscScalar *from;
    EXPECT_EQ(DMCreateGlobalVector(dofs.dm(), vec.out()), PetscErrorCode(0));
    EXPECT_EQ(dofs.gather(values, dofs.all(), vec), PetscErrorCode(0));
    EXPECT_EQ(VecGetArrayRead(vec, &from), PetscErrorCode(0));
    Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(from, dofs.unknowns());
    EXPECT_EQ(VecRestoreArrayRead(vec, &from), PetscErrorCode(0));
    return x;
  }
  Eigen::VectorXd fold(Planes sums) const {
    for (const RodRange &rod : dofs.rods()) dofs.fold(rod, sums);
    dofs.foldJoined(dofs.all(), sums);
    return gather(sums);
  }
  /// Row slot_size x slot + component, column unknown.
  Eigen::MatrixXd scatterMatrix() const {
    Eigen::MatrixXd dense(slot_size * dofs.slots(), dofs.unknowns());
    for (int u = 0; u < dofs.unknowns(); ++u) {
      const Planes one = scatter(Eigen::VectorXd::Unit(dofs.unknowns(), u));
      for (int s = 0; s < dofs.slots(); ++s)
        for (int a = 0; a < slot_size; ++a) dense(slot_size * s + a, u) = one[a][s];
    }
    return dense;
  }
};

TEST(DofMap, CountsWhatJoinsRods) {
  // Positions: of the first rod 4 of 5 vertices, for one is clamped; of the second 2 of 4, for one is a copy and one on
  // the body; of the third all but the copy, 6 of 7 of either; of the fourth 5 of 6. Twists of all edges; the spin of
  // the frame; the body. Ties have none.
  const MappedNet open(false), ring(true);
  EXPECT_EQ(open.dofs.unknowns(), 3 * (4 + 2 + 6 + 5) + (4 + 3 + 6 + 5) + 3 + 6);
  EXPECT_EQ(ring.dofs.unknowns(), 3 * (4 + 2 + 6 + 5) + (4 + 3 + 7 + 5) + 3 + 6);
  EXPECT_EQ(open.dofs.groups(), 2); // of the junction, and the body
  for (const MappedNet *m : {&open, &ring}) {
    const DofMap &dofs = m->dofs;
    // Edges beside the junction, then that at the weld.
    EXPECT_EQ(dofs.joinedEdges(dofs.all()).size(), (m == &ring ? 4u : 2u) + 1u);
    EXPECT_EQ(dofs.joinedVertices(dofs.all()).size(), 3u + 2u + 1u); // of it, on the body, and the spring's point there
    EXPECT_EQ(dofs.ties(dofs.all()).size(), 2u);
    // One after the other, by slots.
    PetscInt next = 0;
    for (int s = 0; s < dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (const PetscInt u = dofs.unknown(s, a); u >= 0) EXPECT_EQ(u, next++);
    EXPECT_EQ(next, dofs.unknowns());
    // All are one island.
    EXPECT_EQ(dofs.islandOf(2).begin, 0);
    EXPECT_EQ(dofs.islandOf(2).end, 4);
    EXPECT_TRUE(dofs.isJoined({3, 4}));
  }
}

TEST(DofMap, GathersJoinedUnknownsAsScattered) {
  for (const bool ring : {false, true}) {
    MappedNet m(ring);
    const Eigen::VectorXd x = m.randomUnknowns();
    EXPECT_EQ(m.gather(m.scatter(x)), x) << ring; // to the last bit
    // What held vertices, copies and empty slots have is no matter of the unknowns.
    Planes values = m.scatter(x);
    for (int s = 0; s < m.dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (m.dofs.unknown(s, a) < 0) values[a][s] = 100;
    EXPECT_EQ(m.gather(values), x) << ring;
  }
}

TEST(DofMap, ScattersTheSameToAllCopies) {
  for (const bool ring : {false, true}) {
    MappedNet m(ring);
    const Planes values = m.scatter(m.randomUnknowns());
    const DofMap &dofs = m.dofs;
    const JoinedBody &body = dofs.bodies(dofs.all())[0];
    int copies = 0, points = 0, spins = 0;
    for (const JoinedVertex &j : dofs.joinedVertices(dofs.all())) {
      const Vec3 first = values.vector(0, j.first_slot), here = values.vector(0, j.slot);
      EXPECT_GT(first.norm(), 0.1);
      if (!j.isOnBody()) {
        EXPECT_EQ(here, first) << j.rod;
        copies += j.isCopy();
        continue;
      }
      const Vec3 spin = values.vector(0, body.rotation);
      EXPECT_EQ(j.first_slot, body.position);
      EXPECT_EQ(values.vector(0, j.frame), spin) << j.rod;
      EXPECT_LE((here - first - spin.cross(dofs.arm(j))).norm(), 1e-15) << j.rod; // rounding, of about 1
      ++points;
    }
    for (const JoinedEdge &j : dofs.joinedEdges(dofs.all())) {
      EXPECT_EQ(values.vector(0, j.frame), values.vector(0, j.first_frame));
      spins += !j.isFirst();
    }
    EXPECT_EQ(copies, 2);
    EXPECT_EQ(points, 3);
    EXPECT_EQ(spins, ring ? 4 : 2); // of the junction all but its first, and that of the weld
    const RodRange &third = dofs.rods()[2];
    int ties = 0;
    for (const Tie &t : dofs.ties(dofs.all())) {
      if (t.isToBody()) continue;
      EXPECT_EQ(t.of, third.slot(1));
      EXPECT_EQ(values.vector(0, t.copy), values.vector(0, t.of));
      ++ties;
    }
    EXPECT_EQ(ties, 1);
    EXPECT_EQ(values.vector(0, dofs.rods()[0].slot(0)), Vec3::Zero().eval()); // held
    if (!ring) continue;
    for (const int k : {0, 1}) EXPECT_EQ(values.vector(0, third.slot(7 + k)), values.vector(0, third.slot(k))) << k;
    EXPECT_EQ(values[3][third.slot(7)], values[3][third.slot(0)]);
    EXPECT_EQ(values.vector(0, third.slot(0)), values.vector(0, dofs.rods()[0].slot(4))); // a copy has copies
  }
}

/// What is summed anywhere goes to the unknowns that move it.
TEST(DofMap, FoldsByTheTransposeOfScatter) {
  for (const bool ring : {false, true}) {
    MappedNet m(ring);
    Planes sums = m.dofs.makePlanes();
    auto put = [&](int slot, int a) { sums[a][slot] = m.random(); };
    for (const RodRange &rod : m.dofs.rods())
      for (int i = 0; i < rod.vertices + (rod.closed ? 2 : 0); ++i)
        for (int a = 0; a < slot_size; ++a)
          if (a < 3 || i < rod.edges + (rod.closed ? 1 : 0)) put(rod.slot(i), a);
    m.dofs.forBeside(m.dofs.all(), [&](int s) {
      for (int a = 0; a < 3; ++a) put(s, a);
    });
    // Couples on points of bodies come from the forces there alone.
    for (const JoinedVertex &j : m.dofs.joinedVertices(m.dofs.all()))
      if (j.isOnBody()) sums.setVector(0, j.frame, Vec3::Zero());
    Eigen::VectorXd flat(slot_size * m.dofs.slots());
    for (int s = 0; s < m.dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a) flat[slot_size * s + a] = sums[a][s];
    const Eigen::VectorXd expected = m.scatterMatrix().transpose() * flat, folded = m.fold(sums);
    EXPECT_LE((folded - expected).lpNorm<Eigen::Infinity>(), 2e-15)
        << ring;                                              // rounding: the body sums about ten numbers
    EXPECT_GT((m.gather(sums) - expected).norm(), 1) << ring; // what copies add
  }
}

using Variables = std::vector<std::pair<int, int>>; ///< slots and components

/// The matrix has an entry for each two unknowns that move variables of one element, and no others; its values are
/// those of the blocks between these.
TEST(DofMap, MakesAMatrixOfAllElements) {
  for (const bool ring : {false, true}) {
    MappedNet m(ring);
    const DofMap &dofs = m.dofs;
    const Eigen::MatrixXd moved = m.scatterMatrix();
    const int n = int(dofs.unknowns());
    Eigen::MatrixXd touched = Eigen::MatrixXd::Zero(n, n); // how many variables two unknowns share
    auto unknownsOf = [&](const Variables &variables) {
      Eigen::VectorXd of = Eigen::VectorXd::Zero(n);
      for (const auto &[slot, a] : variables) of += moved.row(slot_size * slot + a).cwiseAbs().transpose();
      return of;
    };
    auto couple = [&](const Variables &left, const Variables &right) {
      const Eigen::VectorXd a = unknownsOf(left), b = unknownsOf(right);
      touched += a * b.transpose() + b * a.transpose();
    };
    auto vectorAt = [](int slot) { return Variables{{slot, 0}, {slot, 1}, {slot, 2}}; };
    auto both = [](Variables a, const Variables &b) {
      a.insert(a.end(), b.begin(), b.end());
      return a;
    };
    EdgeBlocks blocks(dofs.slots());
    blocks.setOrigin(dofs.rods().front().first_slot);
    auto fillVertex = [&](const RodRange &rod, int at) {
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c) blocks.entry(rod, EdgeBlocks::vertex(r, c))[at] = m.random();
    };
    auto fillAcross = [&](const RodRange &rod, int at, int rows) {
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < edge_size; ++c) blocks.entry(rod, EdgeBlocks::across(r, c))[at] = m.random();
    };
    for (const RodRange &rod : dofs.rods()) {
      auto edge = [&](int i) {
        Variables v = both(vectorAt(rod.slot(i)), vectorAt(rod.slot(i + 1)));
        v.push_back({rod.slot(i), 3});
        return v;
      };
      for (int i = 0; i < rod.edges; ++i) {
        couple(edge(i), edge(i));
        for (int r = 0; r < edge_size; ++r)
          for (int c = r; c < edge_size; ++c) blocks.entry(rod, EdgeBlocks::own(r, c))[i] = m.random();
      }
      for (int i = 1; i < rod.edges + (rod.closed ? 1 : 0); ++i) { // the copy of a ring's first edge has its last cell
        couple(edge(i - 1), edge(i == rod.vertices ? 0 : i));
        fillAcross(rod, i, edge_size);
      }
      for (int i = 0; i < rod.vertices; ++i) {
        couple(vectorAt(rod.slot(i)), vectorAt(rod.slot(i)));
        fillVertex(rod, i);
      }
      const int r = int(&rod - dofs.rods().data());
      const Joins joins = dofs.joins(r);
      for (const JoinedEdge &j : joins.edges) {
        couple(vectorAt(j.frame), both(vectorAt(j.frame), edge(j.edge)));
        fillVertex(rod, j.frame - rod.first_slot);
        fillAcross(rod, j.cell - rod.first_slot, 3);
      }
      for (const JoinedBody &b : joins.bodies)
        for (const int s : {b.position, b.rotation}) {
          couple(vectorAt(s), vectorAt(s));
          fillVertex(rod, s - rod.first_slot);
        }
      for (const Tie &t : joins.ties) {
        const Variables ends = both(vectorAt(t.slot), vectorAt(t.copy));
        couple(ends, ends);
        fillVertex(rod, t.copy - rod.first_slot);
      }
    }
    OwnedMat matrix;
    DofMap::Pattern pattern;
    EXPECT_PETSC(dofs.createMatrix(dofs.all(), false, matrix.out(), &pattern));
    EXPECT_PETSC(dofs.fillMatrix(blocks, pattern, matrix));
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n, n);
    int missing = 0, idle = 0, entries = 0;
    for (PetscInt row = 0; row < n; ++row) {
      PetscInt count;
      const PetscInt *column;
      const PetscScalar *value;
      EXPECT_PETSC(MatGetRow(matrix, row, &count, &column, &value));
      std::vector<char> has(n, false);
      for (PetscInt k = 0; k < count; ++k) {
        has[column[k]] = true;
        dense(row, column[k]) = value[k];
      }
      EXPECT_PETSC(MatRestoreRow(matrix, row, &count, &column, &value));
      for (int c = 0; c < n; ++c) {
        missing += touched(row, c) != 0 && !has[c];
        idle += touched(row, c) == 0 && has[c];
        entries += has[c];
      }
    }
    EXPECT_EQ(missing, 0) << ring;
    EXPECT_EQ(idle, 0) << ring;
    EXPECT_LT(entries, n * n / 2) << ring; // or the pattern would tell nothing
    double off = 0;
    for (int u = 0; u < n; ++u) {
      const Planes x = m.scatter(Eigen::VectorXd::Unit(n, u));
      Planes y = dofs.makePlanes();
      for (int r = 0; r < dofs.all().end; ++r) blocks.multiply(dofs.rods()[r], dofs.joins(r), x, y);
      off = std::max(off, (dense.col(u) - m.fold(y)).lpNorm<Eigen::Infinity>());
    }
    EXPECT_LE(off, 4e-15) << ring; // rounding of sums of up to about a hundred numbers below 1
  }
}

} // namespace
} // namespace tendril::test
