#include "tendril/layout/partition.hpp"

#include "tendril/model/builders.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace tendril {
namespace {

Scene lines(const std::vector<int> &edges) {
  Scene scene;
  for (std::size_t r = 0; r < edges.size(); ++r) {
    Rod rod;
    rod.name = "r" + std::to_string(r);
    for (int i = 0; i <= edges[r]; ++i) rod.position.push_back({0.1 * i, double(r), 0});
    scene.rods.push_back(rod);
  }
  return scene;
}

void join(Scene &scene, int a, int b) { scene.junctions.push_back({"j", {{a, 0, -1}, {b, 0, -1}}, 0}); }

/// Every rod once; blocks one behind the other; every rank has some.
void expectWhole(const Partition &p, const Scene &scene) {
  std::vector<int> rods;
  for (int rank = 0; rank < p.ranks; ++rank) {
    const std::vector<int> own = p.rodsOf(rank);
    EXPECT_FALSE(own.empty()) << rank;
    int next = 0;
    for (const RodSet &block : p.blocksOf(rank)) {
      EXPECT_EQ(block.begin, next);
      next = block.end;
    }
    EXPECT_EQ(next, int(own.size()));
    EXPECT_EQ(p.blocksOf(rank).size(), p.placesOf(rank).size());
    rods.insert(rods.end(), own.begin(), own.end());
  }
  std::sort(rods.begin(), rods.end());
  std::vector<int> all(scene.rods.size());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(rods, all);
}

TEST(Partition, BlocksDoNotDependOnRanks) {
  const Scene scene = lines(std::vector<int>(200, 37));
  const Partition one = partition(scene, 1, PartitionKind::automatic);
  EXPECT_TRUE(one.isOrdered());
  for (const int ranks : {2, 3, 7, 1000}) {
    const Partition p = partition(scene, ranks, PartitionKind::automatic);
    expectWhole(p, scene);
    ASSERT_EQ(p.blocks.size(), one.blocks.size());
    for (std::size_t b = 0; b < p.blocks.size(); ++b) EXPECT_EQ(p.blocks[b].rods.end, one.blocks[b].rods.end);
    EXPECT_EQ(p.ranks, std::min(ranks, int(p.blocks.size())));
  }
}

TEST(Partition, IslandsStayWholeAndFollowEachOther) {
  Scene scene = lines(std::vector<int>(40, 30));
  for (int r = 0; r < 20; ++r) join(scene, r, r + 20); // far apart in the scene
  Constraint tie{};
  tie.kind = Constraint::Kind::pin;
  tie.rod = 0, tie.to_rod = 39, tie.to_vertex = 0;
  scene.constraints.push_back(tie); // two islands become one
  for (const PartitionKind kind : {PartitionKind::contiguous, PartitionKind::metis}) {
    const Partition p = partition(scene, 4, kind);
    expectWhole(p, scene);
    EXPECT_EQ(p.blocks.size(), 19u);
    EXPECT_FALSE(p.isOrdered());
    for (int rank = 0; rank < 4; ++rank) {
      const std::vector<int> own = p.rodsOf(rank);
      for (const int r : own)
        EXPECT_TRUE(std::count(own.begin(), own.end(), (r + 20) % 40))
            << "rod " << r << " without the one it is joined to";
    }
    EXPECT_LE(p.imbalance, 1.25); // 19 islands, one of twice the size, on 4 ranks
    EXPECT_EQ(p.by_metis, kind == PartitionKind::metis);
  }
}

TEST(Partition, UnevenRodsAreEvenedOut) {
  std::vector<int> edges;
  for (int r = 0; r < 48; ++r) edges.push_back(3200 + r * r * 37 % 9000); // each a block by itself
  const Scene scene = lines(edges);
  const Partition slices = partition(scene, 16, PartitionKind::contiguous),
                  even = partition(scene, 16, PartitionKind::automatic);
  EXPECT_TRUE(even.by_metis);
  EXPECT_LT(even.most, slices.most);
  expectWhole(even, scene);
  EXPECT_EQ(even.owner, partition(scene, 16, PartitionKind::automatic).owner); // each time the same
}

/// Blocks stay what they are; those of a group come to one rank, and no more ranks have any than there are groups.
TEST(Partition, GroupsOfBlocksAreOnOneRank) {
  const Scene scene = lines(std::vector<int>(200, 37));
  const Partition alone = partition(scene, 1, PartitionKind::automatic);
  const int blocks = int(alone.blocks.size());
  ASSERT_GT(blocks, 6);
  std::vector<int> group = alone.group;
  group[3] = group[5] = 0;
  for (const PartitionKind kind : {PartitionKind::contiguous, PartitionKind::metis}) {
    const Partition p = partition(scene, 4, kind, group);
    expectWhole(p, scene);
    ASSERT_EQ(int(p.blocks.size()), blocks);
    EXPECT_EQ(p.owner[3], p.owner[0]);
    EXPECT_EQ(p.owner[5], p.owner[0]);
    EXPECT_EQ(p.ranks, 4);
  }
  for (int b = 2; b < blocks; ++b) group[std::size_t(b)] = 0;
  EXPECT_EQ(partition(scene, 4, PartitionKind::automatic, group).ranks, 2);
}

TEST(Partition, OneRodThatIsJoinedToItselfIsABlock) {
  Scene scene = lines({50, 50, 50});
  scene.junctions.push_back({"j", {{1, 0, -1}, {1, 50, -1}}, 0});
  const Partition p = partition(scene, 1, PartitionKind::automatic);
  ASSERT_EQ(p.blocks.size(), 3u);
  EXPECT_TRUE(p.blocks[1].joined);
  EXPECT_FALSE(p.blocks[0].joined);
}

TEST(Partition, TellsWhatWaits) {
  Scene scene = lines({5000, 900, 900, 900, 900});
  join(scene, 1, 2);
  const std::vector<std::string> lines_ = describe(partition(scene, 2, PartitionKind::automatic), scene, 2);
  ASSERT_EQ(lines_.size(), 2u);
  EXPECT_EQ(lines_[0].find("ranks: 2, "), 0u) << lines_[0];
  EXPECT_NE(lines_[1].find("rod 'r0' of 5000 edges is more than a rank's share of 4400"), std::string::npos)
      << lines_[1];
  const Scene small = lines({10});
  const std::vector<std::string> idle = describe(partition(small, 4, PartitionKind::automatic), small, 4);
  EXPECT_NE(idle.back().find("3 of 4 ranks have nothing to do"), std::string::npos) << idle.back();
}

} // namespace
} // namespace tendril
