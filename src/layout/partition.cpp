#include "tendril/layout/partition.hpp"

#include <metis.h>

#include <iomanip>
#include <numeric>
#include <sstream>

namespace tendril {
namespace {

/// Islands by their first rods, and whether anything joins rods of each, to others or to themselves.
struct Islands {
  std::vector<std::vector<int>> rods; ///< none where a rod is not the first of its island
  std::vector<char> joined;
};

Islands islandsOf(const Scene &scene) {
  const std::size_t n = scene.rods.size();
  std::vector<int> first(n);
  std::iota(first.begin(), first.end(), 0);
  auto rootOf = [&](int r) {
    while (first[r] != r) r = first[r] = first[first[r]];
    return r;
  };
  Islands islands{std::vector<std::vector<int>>(n), std::vector<char>(n, false)};
  std::vector<int> any;
  auto join = [&](int a, int b) {
    any.push_back(a);
    a = rootOf(a);
    b = rootOf(b);
    first[std::max(a, b)] = std::min(a, b);
  };
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) join(j.members.front().rod, m.rod);
  for (const Constraint &c : scene.constraints)
    if (c.isTie())
      join(c.rod, c.to_rod);
    else if (c.isToBody())
      join(c.rod, scene.bodies[c.to_body].rod);
  for (const Body &b : scene.bodies) join(b.rod, b.rod);
  for (const Attachment &a : scene.attachments) join(scene.bodies[a.body].rod, a.rod);
  for (const Joint &j : scene.joints)
    if (j.parent >= 0) join(j.rod, scene.bodies[j.parent].rod);
  for (const Tendon &t : scene.tendons)
    for (const int r : scene.rodsOf(t)) join(t.rod, r);
  for (std::size_t r = 0; r < n; ++r) islands.rods[rootOf(int(r))].push_back(int(r));
  for (const int r : any) islands.joined[rootOf(r)] = true;
  return islands;
}

/// Ranks of blocks, one behind the other, each rank as near to its share as whole blocks allow.
std::vector<int> dealContiguously(const std::vector<std::int64_t> &weight, int ranks) {
  const std::int64_t all = std::accumulate(weight.begin(), weight.end(), std::int64_t(0));
  std::vector<int> owner;
  std::int64_t before = 0;
  const int blocks = int(weight.size());
  int rank = 0, of_rank = 0;
  for (int b = 0; b < blocks; ++b) {
    const std::int64_t end = all * (rank + 1) / ranks;
    const bool beyond = before + weight[b] / 2 >= end, needed = blocks - b <= ranks - 1 - rank; // by ranks to come
    if (of_rank > 0 && rank + 1 < ranks && (beyond || needed)) {
      ++rank;
      of_rank = 0;
    }
    owner.push_back(rank);
    ++of_rank;
    before += weight[b];
  }
  return owner;
}

/// Ranks of blocks by METIS. They have no edges between them yet, for islands stay whole: only weights count.
std::vector<int> dealByMetis(const std::vector<std::int64_t> &weight, int ranks) {
  constexpr idx_t seed = 1;
  idx_t blocks = idx_t(weight.size()), constraints = 1, parts = ranks, cut = 0;
  const std::int64_t all = std::accumulate(weight.begin(), weight.end(), std::int64_t(0)),
                     unit = 1 + all / (std::int64_t(1) << 30); // METIS adds weights up in its own integers
  std::vector<idx_t> begin(weight.size() + 1, 0), neighbours(1, 0), scaled, owner(weight.size());
  for (const std::int64_t w : weight) scaled.push_back(idx_t(std::max<std::int64_t>(1, w / unit)));
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  if (METIS_PartGraphRecursive(&blocks, &constraints, begin.data(), neighbours.data(), scaled.data(), nullptr, nullptr,
                               &parts, nullptr, nullptr, options, &cut, owner.data()) != METIS_OK)
    return {};
  std::vector<int> out(owner.begin(), owner.end());
  for (int rank = 0; rank < ranks; ++rank) // one without any is of no use
    if (std::find(out.begin(), out.end(), rank) == out.end()) return {};
  return out;
}

std::vector<std::int64_t> loads(const std::vector<std::int64_t> &weight, const std::vector<int> &owner, int ranks) {
  std::vector<std::int64_t> of_rank(ranks, 0);
  for (std::size_t b = 0; b < weight.size(); ++b) of_rank[owner[b]] += weight[b];
  return of_rank;
}

/// Edges of each rod, and what its couplings weigh.
std::vector<std::int64_t> workOfRods(const Scene &scene) {
  std::vector<std::int64_t> work;
  for (const Rod &rod : scene.rods) work.push_back(rod.edges());
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) work[m.rod] += coupling_edges;
  for (const Constraint &c : scene.constraints)
    if (!c.isToWorld()) work[c.rod] += coupling_edges;
  for (const Attachment &a : scene.attachments) work[a.rod] += coupling_edges;
  return work;
}

} // namespace

std::vector<Block> blocksOf(const std::vector<int> &edges, const std::vector<int> &island_end) {
  constexpr int block_edges = 800;
  const int count = int(edges.size());
  std::vector<Block> blocks;
  int begin = 0, sum = 0;
  auto close = [&](int end, bool joined) {
    if (end > begin) blocks.push_back({{begin, end}, joined});
    begin = end;
    sum = 0;
  };
  for (int r = 0; r < count; ++r) {
    if (island_end[r] > 0) {
      close(r, false);
      close(island_end[r], true);
      r = island_end[r] - 1;
      continue;
    }
    sum += edges[r];
    if ((sum < block_edges || (r + 1 - begin) % lanes != 0) && sum < 4 * block_edges && r + 1 < count) continue;
    close(r + 1, false);
  }
  return blocks;
}

bool Partition::isOrdered() const { return std::is_sorted(order.begin(), order.end()); }

std::vector<int> Partition::rodsOf(int rank) const {
  std::vector<int> rods;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    if (owner[b] == rank)
      rods.insert(rods.end(), order.begin() + blocks[b].rods.begin, order.begin() + blocks[b].rods.end);
  return rods;
}

std::vector<RodSet> Partition::blocksOf(int rank) const {
  std::vector<RodSet> own;
  int next = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (owner[b] != rank) continue;
    const int rods = blocks[b].rods.end - blocks[b].rods.begin;
    own.push_back({next, next + rods});
    next += rods;
  }
  return own;
}

std::vector<double> Partition::placesOf(int rank) const {
  std::vector<double> places;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    if (owner[b] == rank) places.push_back(double(b));
  return places;
}

Partition partition(const Scene &scene, int ranks, PartitionKind kind, std::vector<int> group) {
  constexpr double even = 1.1; // imbalance that is not worth another order
  Partition p;
  const Islands islands = islandsOf(scene);
  std::vector<int> edges, island_end;
  for (std::size_t first = 0; first < islands.rods.size(); ++first) {
    const std::size_t begin = p.order.size();
    for (const int r : islands.rods[first]) {
      p.order.push_back(r);
      edges.push_back(scene.rods[r].edges());
    }
    island_end.resize(p.order.size(), 0);
    if (islands.joined[first]) island_end[begin] = int(p.order.size());
  }
  p.blocks = tendril::blocksOf(edges, island_end);
  p.group = std::move(group);
  if (p.group.empty()) {
    p.group.resize(p.blocks.size());
    std::iota(p.group.begin(), p.group.end(), 0);
  }
  const std::vector<std::int64_t> of_rods = workOfRods(scene);
  for (const Block &b : p.blocks) {
    p.work.push_back(0);
    for (int k = b.rods.begin; k < b.rods.end; ++k) p.work.back() += of_rods[p.order[k]];
  }
  std::vector<int> place; // of the group of each block
  std::vector<std::int64_t> work;
  for (std::size_t b = 0; b < p.blocks.size(); ++b) {
    const bool is_first = p.group[b] == int(b);
    place.push_back(is_first ? int(work.size()) : place[std::size_t(p.group[b])]);
    if (is_first) work.push_back(0);
    work[std::size_t(place[b])] += p.work[b];
  }
  p.ranks = std::min(ranks, int(work.size()));
  std::vector<int> owner = dealContiguously(work, p.ranks);
  auto mostOf = [&](const std::vector<int> &deal) {
    const std::vector<std::int64_t> of_rank = loads(work, deal, p.ranks);
    return *std::max_element(of_rank.begin(), of_rank.end());
  };
  const std::int64_t all = std::accumulate(p.work.begin(), p.work.end(), std::int64_t(0));
  auto imbalanceOf = [&](const std::vector<int> &deal) { return double(mostOf(deal)) * p.ranks / double(all); };
  if (p.ranks > 1 && kind != PartitionKind::contiguous && (kind == PartitionKind::metis || imbalanceOf(owner) > even)) {
    const std::vector<int> by_metis = dealByMetis(work, p.ranks);
    p.by_metis = !by_metis.empty() && (kind == PartitionKind::metis || mostOf(by_metis) < mostOf(owner));
    if (p.by_metis) owner = by_metis;
  }
  for (const int k : place) p.owner.push_back(owner[std::size_t(k)]);
  const std::vector<std::int64_t> of_rank = loads(work, owner, p.ranks);
  p.most = *std::max_element(of_rank.begin(), of_rank.end());
  p.least = *std::min_element(of_rank.begin(), of_rank.end());
  p.imbalance = imbalanceOf(owner);
  return p;
}

std::vector<std::string> describe(const Partition &p, const Scene &scene, int ranks) {
  constexpr double large = 1.1; // of a rank's share
  std::vector<std::string> lines;
  std::ostringstream line;
  line << "ranks: " << p.ranks << ", " << p.blocks.size()
       << (p.blocks.size() == 1 ? " block of rods " : " blocks of rods ")
       << (p.by_metis ? "by METIS" : "one behind the other") << ", " << p.least << " to " << p.most << " edges a rank"
       << (scene.isJoined() ? " (a coupling counts as " + std::to_string(coupling_edges) + ")" : "") << ", imbalance "
       << std::setprecision(3) << p.imbalance << ", no coupling cut";
  lines.push_back(line.str());
  if (p.ranks < ranks)
    lines.push_back("warning: " + std::to_string(ranks - p.ranks) + " of " + std::to_string(ranks) +
                    " ranks have nothing to do: there " +
                    (p.blocks.size() == 1 ? "is 1 block of rods that are"
                                          : "are " + std::to_string(p.blocks.size()) + " blocks of rods that are") +
                    " solved together; start fewer");
  const double share = double(std::accumulate(p.work.begin(), p.work.end(), std::int64_t(0))) / p.ranks;
  int told = 0;
  for (const Block &b : p.blocks) {
    const std::int64_t edges = p.work[std::size_t(&b - p.blocks.data())];
    const int rods = b.rods.end - b.rods.begin;
    if (p.ranks == 1 || double(edges) <= large * share || (rods > 1 && !b.joined) || ++told > 3) continue;
    std::ostringstream warning;
    warning << "warning: "
            << (rods == 1 ? "rod '" + scene.rods[p.order[b.rods.begin]].name + "'"
                          : "the island of rod '" + scene.rods[p.order[b.rods.begin]].name + "' and " +
                                std::to_string(rods - 1) + " more")
            << " of " << edges << " edges is more than a rank's share of " << std::llround(share)
            << ": it runs whole on one rank, and the others wait for it up to " << std::setprecision(2)
            << 100 * (1 - share / double(edges)) << " % of the time";
    lines.push_back(warning.str());
  }
  return lines;
}

} // namespace tendril
