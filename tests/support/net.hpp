#pragma once
/// \file net.hpp
/// Random rods that junctions and ties join, with matrices of any numbers.

#include "tendril/solver/banded.hpp"

#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include <Eigen/Dense>

namespace tendril::test {

/// Rods of random numbers of edges, of which each begins or ends at one of some junctions, or passes through one.
struct Net {
  Scene scene;
  DofMap dofs;
  EdgeBlocks blocks;
  Planes metric;
  std::vector<char> active;
  std::vector<double> shift;
  BandedSystem system;
  OwnedMat matrix; ///< of PETSc's own
  Eigen::MatrixXd dense;
};

inline int pick(Random &random, int count) { return std::min(count - 1, int(0.5 * (random() + 1) * count)); }

inline void draw(Net &net, Random &random, int rods, int nodes, bool frames) {
  net.scene.gravity = Vec3::Zero();
  std::vector<Vec3> places;
  for (int k = 0; k < nodes; ++k) {
    places.push_back(3 * random.vector());
    Junction junction{"j", {}, 0};
    if (frames && random() > -0.5) junction.groups = 1;
    net.scene.junctions.push_back(junction);
  }
  for (int r = 0; r < rods; ++r) {
    const int edges = 1 + pick(random, 12), from = pick(random, nodes), kind = pick(random, 4);
    int to = pick(random, nodes);
    if (to == from) to = (to + 1) % nodes;
    const Vec3 begin = kind == 1 ? Vec3(3 * random.vector()) : places[from],
               end = kind == 2 ? Vec3(3 * random.vector()) : places[to];
    Rod rod = inextensibleRod(lineShape(begin, end, edges).points, Measure::angle);
    if (random() > 0.8)
      rod.material.flexural_stiffness = {0, 0}, rod.material.torsional_stiffness = 0;
    else if (!frames && random() > 0)
      rod.model = RodModel::torsion_free;
    net.scene.rods.push_back(rod);
    auto join = [&](int node, int vertex) {
      Junction &j = net.scene.junctions[node];
      j.members.push_back({r, vertex, j.groups > 0 ? 0 : -1});
    };
    if (kind != 1) join(from, 0);
    if (kind != 2) join(to, edges);
    if (kind == 3 && edges > 3) { // through another one
      const int middle = (std::max(from, to) + 1) % nodes;
      if (middle != from && middle != to) {
        net.scene.rods.back().position[edges / 2] = places[middle];
        setBishopDirectors(net.scene.rods.back());
        join(middle, edges / 2);
      }
    }
    if (random() > 0.5 && edges > 5) net.scene.supports.push_back(hold(net.scene, r, 1, Support::Kind::pin));
  }
  std::erase_if(net.scene.junctions, [](const Junction &j) { return j.members.size() < 2; });
  if (random() > 0 && !net.scene.junctions.empty()) {
    const Junction::Member &m = net.scene.junctions[0].members[0];
    net.scene.supports.push_back(hold(net.scene, m.rod, m.vertex, Support::Kind::pin));
  }
}

/// Bodies in place of every other junction, with its vertices at random arms.
inline void embody(Net &net) {
  std::vector<Junction> left;
  for (std::size_t k = 0; k < net.scene.junctions.size(); ++k) {
    const Junction &junction = net.scene.junctions[k];
    if (k % 2 == 1) {
      left.push_back(junction);
      continue;
    }
    Body body;
    body.own = {1, Vec3::Zero(), Mat3::Identity()};
    for (const Junction::Member &m : junction.members) {
      const bool held = std::any_of(net.scene.supports.begin(), net.scene.supports.end(),
                                    [&](const Support &s) { return s.rod == m.rod && s.vertex == m.vertex; });
      const Rod &rod = net.scene.rods[m.rod];
      if (!held)
        net.scene.attachments.push_back(
            {"a", m.rod, m.vertex, int(net.scene.bodies.size()), m.group >= 0, frameAtVertex(rod, m.vertex)});
    }
    net.scene.bodies.push_back(body);
  }
  net.scene.junctions = left;
  net.scene.hostBodies();
}

/// Ties between vertices of any rods, some of one rod, some of vertices in junctions or held.
inline void tie(Net &net, Random &random, int count) {
  for (int k = 0; k < count; ++k) {
    Constraint c{};
    c.kind = Constraint::Kind::pin;
    c.rod = pick(random, int(net.scene.rods.size()));
    c.to_rod = pick(random, int(net.scene.rods.size()));
    c.at = pick(random, net.scene.rods[c.rod].vertices());
    c.to_vertex = pick(random, net.scene.rods[c.to_rod].vertices());
    if (c.rod == c.to_rod && c.at == c.to_vertex) continue;
    c.stiffness = 1;
    net.scene.constraints.push_back(c);
  }
}

/// Blocks of any numbers. \param diagonal large: definite; small: not
inline void fill(Net &net, Random &random, double diagonal) {
  ASSERT_EQ(net.dofs.setUp(net.scene), PetscErrorCode(0));
  const RodSet all = net.dofs.all();
  for (const JoinedVertex &j : net.dofs.joinedVertices(all))
    if (j.isOnBody()) net.dofs.setArm(j, random.vector());
  net.blocks = EdgeBlocks(net.dofs.slots());
  net.blocks.setOrigin(net.dofs.rods().front().first_slot);
  net.metric = net.dofs.makePlanes();
  net.active.assign(all.end, true);
  net.shift.assign(all.end, 0);
  for (const RodRange &rod : net.dofs.rods()) {
    for (int i = 0; i < rod.edges; ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = r; c < edge_size; ++c)
          if (rod.twist || c < 3) net.blocks.entry(rod, EdgeBlocks::own(r, c))[i] = random() + (r == c ? diagonal : 0);
    const int index = int(&rod - net.dofs.rods().data());
    const auto joined = net.dofs.joinedEdges({index, index + 1});
    for (int i = 1; i < rod.edges; ++i) {
      if (std::any_of(joined.begin(), joined.end(), [&](const JoinedEdge &j) { return j.vertex == i; })) continue;
      for (int r = 0; r < edge_size; ++r)
        for (int c = 0; c < edge_size; ++c)
          if (rod.twist) net.blocks.entry(rod, EdgeBlocks::across(r, c))[i] = random(); // cables have no cells
    }
    for (int i = 0; i < rod.vertices; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c)
          net.blocks.entry(rod, EdgeBlocks::vertex(r, c))[i] = random() + (r == c ? diagonal : 0);
  }
  for (const JoinedEdge &j : net.dofs.joinedEdges(all)) {
    const RodRange &rod = net.dofs.rods()[j.rod];
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c)
        net.blocks.entry(rod, EdgeBlocks::vertex(r, c))[j.frame - rod.first_slot] = random() + (r == c ? diagonal : 0);
      for (int c = 0; c < edge_size; ++c)
        net.blocks.entry(rod, EdgeBlocks::across(r, c))[j.cell - rod.first_slot] = random();
    }
  }
  for (const JoinedBody &b : net.dofs.bodies(all))
    for (const int slot : {b.position, b.rotation})
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c)
          net.blocks.entry(net.dofs.rods()[b.rod], EdgeBlocks::vertex(r, c))[slot - net.dofs.rods()[b.rod].first_slot] =
              random() + (r == c ? diagonal : 0);
  for (const Tie &t : net.dofs.ties(all)) // often of rank two or one
    for (int r = 0; r < 3; ++r)
      net.blocks.entry(net.dofs.rods()[t.rod], EdgeBlocks::vertex(r, r))[t.copy - net.dofs.rods()[t.rod].first_slot] =
          pick(random, 3) * 3.0;
  net.system = {&net.dofs, all, &net.blocks, &net.metric, &net.active, &net.shift};
  DofMap::Pattern pattern;
  ASSERT_EQ(net.dofs.createMatrix(all, false, net.matrix.out(), &pattern), PetscErrorCode(0));
  ASSERT_EQ(net.dofs.fillMatrix(net.blocks, pattern, net.matrix), PetscErrorCode(0));
  const PetscInt n = net.dofs.unknowns();
  net.dense = Eigen::MatrixXd::Zero(n, n);
  for (PetscInt r = 0; r < n; ++r) {
    PetscInt count;
    const PetscInt *column;
    const PetscScalar *value;
    ASSERT_EQ(MatGetRow(net.matrix, r, &count, &column, &value), PetscErrorCode(0));
    for (PetscInt k = 0; k < count; ++k) net.dense(r, column[k]) = value[k];
    ASSERT_EQ(MatRestoreRow(net.matrix, r, &count, &column, &value), PetscErrorCode(0));
  }
  EXPECT_LT((net.dense - net.dense.transpose()).norm(), 1e-13 * net.dense.norm());
}

inline int negativeByMumps(Mat matrix) {
  Mat factor;
  MatFactorInfo info;
  PetscInt minus = -1, zero = 0, plus = 0;
  EXPECT_EQ(MatGetFactor(matrix, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &factor), PetscErrorCode(0));
  EXPECT_EQ(MatMumpsSetIcntl(factor, 24, 1), PetscErrorCode(0));
  EXPECT_EQ(MatFactorInfoInitialize(&info), PetscErrorCode(0));
  EXPECT_EQ(MatCholeskyFactorSymbolic(factor, matrix, nullptr, &info), PetscErrorCode(0));
  EXPECT_EQ(MatCholeskyFactorNumeric(factor, matrix, &info), PetscErrorCode(0));
  EXPECT_EQ(MatGetInertia(factor, &minus, &zero, &plus), PetscErrorCode(0));
  EXPECT_EQ(MatDestroy(&factor), PetscErrorCode(0));
  return int(minus);
}

/// That a factorisation solves as the dense matrix and counts negative pivots as MUMPS and the eigenvalues do, also
/// when it is made again and where the solution takes the place of the right-hand side. \return whether it is
/// indefinite
template <class Factor> bool expectAsWhole(const Net &net, Factor &factor, double tolerance, int repeat) {
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(net.dense.rows(), -1, 2);
  Eigen::VectorXd x(b.size());
  for (int again = 0; again < 2; ++again) {
    factor.factor(net.system);
    factor.solve(b.data(), x.data());
    EXPECT_LT((net.dense * x - b).norm(), tolerance * b.norm()) << repeat;
  }
  const int negative =
      int((Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(net.dense).eigenvalues().array() < 0).count());
  EXPECT_EQ(factor.negative(), negative) << repeat;
  EXPECT_EQ(factor.zero(), 0) << repeat;
  EXPECT_EQ(negativeByMumps(net.matrix), negative) << repeat;
  x = b;
  factor.solve(x.data(), x.data());
  EXPECT_LT((net.dense * x - b).norm(), tolerance * b.norm()) << repeat;
  return negative > 0;
}

} // namespace tendril::test
