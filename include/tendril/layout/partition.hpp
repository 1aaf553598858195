#pragma once
/// \file partition.hpp
/// Which rods are solved together, and on which rank.

#include "tendril/layout/rod_range.hpp"
#include "tendril/model/scene.hpp"

#include <cstdint>

namespace tendril {

/// How islands are dealt out: one behind the other; by METIS, which evens out what they weigh; or the first, and the
/// second where that leaves ranks waiting.
enum class PartitionKind { automatic, contiguous, metis };

/// Rods that nothing joins, or all of an island.
struct Block {
  RodSet rods;
  bool joined;
};

/// Cuts rods into blocks of at least so many edges that a block fills the cache (about 2 kB each), and at least a pack
/// of rods to factor together. An island of several rods is a block by itself. Blocks follow from the rods alone, never
/// from the number of ranks: so no rank changes what is computed.
/// \param edges of each rod \param island_end the rod behind the last of the island that begins with a rod that others
/// are joined to, or 0 for one that nothing joins
std::vector<Block> blocksOf(const std::vector<int> &edges, const std::vector<int> &island_end);

/// The rods of a scene in the order in which they are solved, and which rank has them.
struct Partition {
  std::vector<int> order;    ///< rods of the scene; those of an island follow each other
  std::vector<Block> blocks; ///< in that order
  std::vector<int> owner;    ///< rank of each block
  std::vector<int> group;    ///< the first block that each has to be on one rank with
  int ranks = 1;             ///< that have any; no more than there are groups of blocks
  bool by_metis = false;
  std::vector<std::int64_t> work;   ///< of each block, in edges; a coupling counts as `coupling_edges`
  std::int64_t most = 0, least = 0; ///< work of a rank
  double imbalance = 1;             ///< that of the rank that has most, over the mean

  /// Whether it is the order of the scene.
  bool isOrdered() const;
  /// Rods of a rank, in the order in which they are solved, and its blocks in the numbering of these.
  std::vector<int> rodsOf(int rank) const;
  std::vector<RodSet> blocksOf(int rank) const;
  /// Numbers of these blocks among all.
  std::vector<double> placesOf(int rank) const;
};

/// Work of a junction's member or of a pin between vertices, in edges by themselves: from 30 for rods that meet in one
/// node to 350 in a net of 20 x 20 rods (docs/performance.md).
inline constexpr int coupling_edges = 100;

/// \param ranks that could take part \param group see Partition; none: any block may be on any rank
Partition partition(const Scene &scene, int ranks, PartitionKind kind, std::vector<int> group = {});

/// Lines for the user: how many ranks, how even, and which islands are larger than a rank's share.
std::vector<std::string> describe(const Partition &partition, const Scene &scene, int ranks);

} // namespace tendril
