#include "tendril/contact/neighbours.hpp"

#include "tendril/contact/segments.hpp"

#include <algorithm>
#include <cstdint>

namespace tendril {

NormalLaw lawBetween(const ContactSettings &a, double stiffness_a, const ContactSettings &b, double stiffness_b) {
  ContactSettings both = a;
  both.distance = 0.5 * (a.distance + b.distance);
  both.threshold = 0.5 * (a.threshold + b.threshold);
  both.smoothing = 0.5 * (a.smoothing + b.smoothing);
  both.stiffness = std::sqrt(a.stiffness * b.stiffness);
  return {both, std::max(stiffness_a, stiffness_b)};
}

double wallBetween(const ContactSettings &a, const ContactSettings &b) {
  const double radii = a.radius + b.radius;
  return a.isBarrier() ? radii - 0.25 * (a.distance + b.distance) : 0.2 * radii;
}

bool nearlyTouch(const Scene &scene, const TouchingPair &p, const std::array<Vec3, 4> &x) {
  const ContactSettings &a = scene.rods[std::size_t(p.rod)].contact, &b = scene.rods[std::size_t(p.to_rod)].contact;
  const double reach = lawBetween(a, 1, b, 1).reach();
  return closest(x[0], x[1], x[2], x[3]).distance < a.radius + b.radius + 3 * reach;
}

Neighbours::Neighbours(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements) {
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    double arc = 0;
    for (int i = 0; i < rod.vertices; ++i) {
      arc_.push_back(arc);
      if (i < rod.edges) arc += elements.restLength()[rod.slot(i)];
    }
    const ContactSettings &c = scene.rods[r].contact;
    width_.push_back(c.isBarrier() ? c.distance : 2 * c.threshold);
  }
  for (const Junction &j : scene.junctions)
    for (std::size_t a = 0; a < j.members.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        addJoint(j.members[a].rod, j.members[a].vertex, j.members[b].rod, j.members[b].vertex);
  for (const Constraint &c : scene.constraints)
    if (c.isTie()) addJoint(c.rod, c.at, c.to_rod, c.to_vertex);
  for (std::size_t a = 0; a < scene.attachments.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (const Attachment &one = scene.attachments[a], &other = scene.attachments[b]; one.body == other.body)
        addJoint(one.rod, one.vertex, other.rod, other.vertex);
}

void Neighbours::addJoint(int rod, int vertex, int to_rod, int to_vertex) {
  if (rod == to_rod) return;
  if (rod > to_rod) {
    std::swap(rod, to_rod);
    std::swap(vertex, to_vertex);
  }
  const double apart = (scene_.rods[std::size_t(rod)].position[std::size_t(vertex)] -
                        scene_.rods[std::size_t(to_rod)].position[std::size_t(to_vertex)])
                           .norm();
  joints_[{rod, to_rod}].push_back({arc(rod, vertex), arc(to_rod, to_vertex), apart});
}

double Neighbours::lengthOf(int rod, int edge) const {
  return elements_.restLength()[elements_.rods[std::size_t(rod)].slot(edge)];
}

/// Rest length between two edges of a rod, the shorter way round a ring [m].
double Neighbours::alongRod(int rod, int edge, int to_edge) const {
  if (edge > to_edge) std::swap(edge, to_edge);
  if (edge == to_edge) return 0;
  const double between = arc(rod, to_edge) - arc(rod, edge) - lengthOf(rod, edge);
  if (!elements_.rods[std::size_t(rod)].closed) return between;
  return std::min(between, elements_.length(rod) - (arc(rod, to_edge) + lengthOf(rod, to_edge) - arc(rod, edge)));
}

/// Rest length from an edge to a place along its rod, the shorter way round a ring [m].
double Neighbours::toArc(int rod, int edge, double place) const {
  const double begin = arc(rod, edge), end = begin + lengthOf(rod, edge), all = elements_.length(rod);
  auto from = [&](double x) { return std::max({begin - x, x - end, 0.0}); };
  return elements_.rods[std::size_t(rod)].closed ? std::min({from(place), from(place - all), from(place + all)})
                                                 : from(place);
}

bool Neighbours::mayTouch(int rod, int edge, int to_rod, int to_edge) const {
  const ContactSettings &a = scene_.rods[std::size_t(rod)].contact, &b = scene_.rods[std::size_t(to_rod)].contact;
  if (!a.touchesRods() || !b.touchesRods() || a.isApartFrom(b)) return false;
  const double radii = a.radius + b.radius,
               least =
                   std::max(0.5 * pi * radii, radii + 0.5 * (width_[std::size_t(rod)] + width_[std::size_t(to_rod)]));
  if (rod == to_rod) // points of a cloud are told apart one by one
    return a.rods == ContactSettings::Rods::all && (a.point_cloud || alongRod(rod, edge, to_edge) > least);
  if (rod > to_rod) {
    std::swap(rod, to_rod);
    std::swap(edge, to_edge);
  }
  const auto found = joints_.find({rod, to_rod});
  return found == joints_.end() || std::none_of(found->second.begin(), found->second.end(), [&](const Joint &j) {
           return toArc(rod, edge, j.arc) + toArc(to_rod, to_edge, j.to_arc) + j.apart <= least;
         });
}

/// How far from the ways of its vertices a rod may touch another, with half of what its law reaches [m].
double Neighbours::reachOf(const Room &room, int rod) const {
  const std::size_t r = std::size_t(rod);
  return scene_.rods[r].contact.radius + 0.25 * width_[r] + room.beyond[r];
}

Box Neighbours::boxOf(const Room &room, int rod, int edge) const {
  const RodRange &range = elements_.rods[std::size_t(rod)];
  Box box;
  for (const int s : {range.slot(edge), range.slot((edge + 1) % range.vertices)}) {
    box.include(room.startOf(s));
    box.include(room.endOf(s));
  }
  return box.widened(reachOf(room, rod));
}

bool Neighbours::isNear(const Room &room, int rod, int edge, int to_rod, int to_edge) const {
  std::array<Vec3, 4> x, way;
  double away = scene_.rods[std::size_t(rod)].contact.radius + scene_.rods[std::size_t(to_rod)].contact.radius +
                0.25 * (width_[std::size_t(rod)] + width_[std::size_t(to_rod)]),
         beyond = 0;
  const bool together = rod == to_rod; // else each is anywhere on its way: about the middle of that
  for (const int side : {0, 1}) {
    const RodRange &range = elements_.rods[std::size_t(side == 0 ? rod : to_rod)];
    const int e = side == 0 ? edge : to_edge;
    double most = 0;
    for (const int end : {0, 1}) {
      const int s = range.slot((e + end) % range.vertices);
      const std::size_t k = std::size_t(2 * side + end);
      way[k] = room.wayOf(s);
      x[k] = room.startOf(s) + (together ? 0 : 0.5) * way[k];
      most = std::max(most, together ? 0 : 0.5 * way[k].norm());
    }
    beyond += room.beyond[std::size_t(side == 0 ? rod : to_rod)] + most;
  }
  if (together) { // the one from the other no farther than the edges between let it
    const double between = alongRod(rod, edge, to_edge) + lengthOf(rod, edge) + lengthOf(rod, to_edge);
    beyond = std::min(beyond, room.bend[std::size_t(rod)] * between);
  }
  away += beyond;
  if (closest(x[0], x[1], x[2], x[3]).distance < away) return true;
  return together && freePart(x, way, away, 1e-3 * away) < 1;
}

TouchingPair Neighbours::pairOf(int rod, int edge, int to_rod, int to_edge) const {
  if (std::pair(rod, edge) < std::pair(to_rod, to_edge)) {
    std::swap(rod, to_rod);
    std::swap(edge, to_edge);
  }
  const RodRange &a = elements_.rods[std::size_t(rod)], &b = elements_.rods[std::size_t(to_rod)];
  return {rod,
          edge,
          to_rod,
          to_edge,
          {a.slot(edge), a.slot((edge + 1) % a.vertices), b.slot(to_edge), b.slot((to_edge + 1) % b.vertices)}};
}

/// Whether the edges of a rod from one to another, [begin, end), keep so near to one direction, all along their ways,
/// that none of them touches another: what lies between two of them keeps their nearest points apart.
bool Neighbours::isStraight(const Room &room, int rod, int begin, int end) const {
  const RodRange &range = elements_.rods[std::size_t(rod)];
  const ContactSettings &contact = scene_.rods[std::size_t(rod)].contact;
  const auto at = [&](int i) { return range.slot(i % range.vertices); };
  const Vec3 along = room.startOf(at(end)) - room.startOf(at(begin));
  const double length = along.norm();
  if (!(length > 0)) return false;
  const double closest_ends = 2 * contact.radius + 0.5 * width_[std::size_t(rod)],
               apart = std::max(pi * contact.radius, 2 * contact.radius + width_[std::size_t(rod)]),
               least = room.bend[std::size_t(rod)] + closest_ends / apart;
  if (least > 1) return false;
  for (int i = begin; i < end; ++i) {
    const Vec3 edge = room.startOf(at(i + 1)) - room.startOf(at(i)), more = room.wayOf(at(i + 1)) - room.wayOf(at(i));
    const double now = edge.dot(along), then = now + more.dot(along);
    if (!(std::min(now, then) > least * length * lengthOf(rod, i % range.edges))) return false;
  }
  return true;
}

namespace {

constexpr int chunk_edges = 8;

/// A chunk in one cell of the grid.
struct InCell {
  std::uint64_t cell;
  int chunk;
  bool operator<(const InCell &other) const { return std::pair(cell, chunk) < std::pair(other.cell, other.chunk); }
};

/// Cells about as large as most of some boxes, the chunks'.
class Grid {
public:
  explicit Grid(const std::vector<Box> &boxes) {
    std::vector<double> sizes;
    for (const Box &box : boxes) {
      sizes.push_back((box.high - box.low).maxCoeff());
      all_.include(box);
    }
    std::nth_element(sizes.begin(), sizes.begin() + std::ptrdiff_t(sizes.size() / 2), sizes.end());
    size_ = std::max(sizes[sizes.size() / 2], (all_.high - all_.low).maxCoeff() / most_cells);
  }
  std::uint64_t keyOf(const Vec3 &x) const {
    const auto at = cellAt(x);
    return keyOf(at[0], at[1], at[2]);
  }
  /// All that a box meets, of every box, by cell.
  std::vector<InCell> cellsOf(const std::vector<Box> &boxes) const;

private:
  static constexpr int bits = 21, most_cells = 1 << (bits - 1); // along an axis
  Box all_;
  double size_; ///< of a cell [m]

  std::array<std::uint64_t, 3> cellAt(const Vec3 &x) const {
    std::array<std::uint64_t, 3> at;
    for (int a = 0; a < 3; ++a) at[std::size_t(a)] = std::uint64_t((x[a] - all_.low[a]) / size_);
    return at;
  }
  static std::uint64_t keyOf(std::uint64_t x, std::uint64_t y, std::uint64_t z) {
    return (x << 2 * bits) | (y << bits) | z;
  }
};

std::vector<InCell> Grid::cellsOf(const std::vector<Box> &boxes) const {
  std::vector<InCell> cells;
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    const auto low = cellAt(boxes[k].low), high = cellAt(boxes[k].high);
    for (std::uint64_t x = low[0]; x <= high[0]; ++x)
      for (std::uint64_t y = low[1]; y <= high[1]; ++y)
        for (std::uint64_t z = low[2]; z <= high[2]; ++z) cells.push_back({keyOf(x, y, z), int(k)});
  }
  std::sort(cells.begin(), cells.end());
  return cells;
}

/// Of the ways of some vertices that follow each other.
Box boxAbout(const Room &room, int first_slot, int count) {
  Box box;
  for (int a = 0; a < 3; ++a) {
    Pack low(HUGE_VAL), high(-HUGE_VAL);
    for (int i = 0; i < count; i += lanes) {
      const Pack start = read<Pack>(room.start[a] + first_slot + i),
                 end = start + read<Pack>(room.way[a] + first_slot + i);
      const Pack::mask_type counts = firstLanes(count - i);
      low = select(counts, min(low, min(start, end)), low);
      high = select(counts, max(high, max(start, end)), high);
    }
    box.low[a] = hmin(low);
    box.high[a] = hmax(high);
  }
  return box;
}

bool isBefore(const TouchingPair &a, const TouchingPair &b) {
  return std::tuple(a.rod, a.edge, a.to_rod, a.to_edge) < std::tuple(b.rod, b.edge, b.to_rod, b.to_edge);
}

} // namespace

/// Of one rod whose chunks follow each other, what is straight does not touch itself.
bool Neighbours::isApart(const Room &room, int rod, int edge, int to_edge) const {
  if (scene_.rods[std::size_t(rod)].contact.point_cloud) return false;
  const RodRange &range = elements_.rods[std::size_t(rod)];
  const int chunks = (range.edges + chunk_edges - 1) / chunk_edges, a = std::max(edge, to_edge) / chunk_edges,
            b = std::min(edge, to_edge) / chunk_edges;
  if (a - b <= 1) return isStraight(room, rod, b * chunk_edges, std::min((a + 1) * chunk_edges, range.edges));
  return range.closed && b == 0 && a == chunks - 1 &&
         isStraight(room, rod, a * chunk_edges, range.edges + std::min(chunk_edges, range.edges));
}

/// Rods that may touch: themselves, or others whose boxes meet theirs.
std::vector<char> Neighbours::meeting(const Room &room) const {
  struct OfRod {
    int rod;
    Box box;
  };
  std::vector<char> meets(elements_.rods.size(), false);
  std::vector<OfRod> rods;
  Box middles;
  for (int r = 0; r < int(elements_.rods.size()); ++r) {
    const ContactSettings &contact = scene_.rods[std::size_t(r)].contact;
    if (!contact.touchesRods()) continue;
    meets[std::size_t(r)] = contact.rods == ContactSettings::Rods::all;
    const RodRange &rod = elements_.rods[std::size_t(r)];
    rods.push_back({r, boxAbout(room, rod.first_slot, rod.vertices).widened(reachOf(room, r))});
    middles.include(Vec3(0.5 * (rods.back().box.low + rods.back().box.high)));
  }
  Eigen::Index axis = 0; // along which they are farthest apart
  if (!rods.empty()) (middles.high - middles.low).maxCoeff(&axis);
  std::stable_sort(rods.begin(), rods.end(),
                   [&](const OfRod &a, const OfRod &b) { return a.box.low[axis] < b.box.low[axis]; });
  for (std::size_t i = 0; i < rods.size(); ++i)
    for (std::size_t j = i + 1; j < rods.size() && rods[j].box.low[axis] <= rods[i].box.high[axis]; ++j) {
      char &one = meets[std::size_t(rods[i].rod)], &other = meets[std::size_t(rods[j].rod)];
      if (!(one && other) && rods[i].box.overlaps(rods[j].box)) one = other = true;
    }
  return meets;
}

/// The edges of the rods that may touch, and where they may be.
std::vector<Neighbours::Chunk> Neighbours::chunksOf(const Room &room) const {
  const std::vector<char> meets = meeting(room);
  std::vector<Chunk> chunks;
  for (int r = 0; r < int(elements_.rods.size()); ++r) {
    const RodRange &rod = elements_.rods[std::size_t(r)];
    if (!meets[std::size_t(r)]) continue;
    for (int i = 0; i < rod.edges; i += chunk_edges) {
      const int end = std::min(i + chunk_edges, rod.edges), last = std::min(end, rod.vertices - 1);
      Box box = boxAbout(room, rod.slot(i), last - i + 1);
      if (last < end) box.include(boxAbout(room, rod.first_slot, 1)); // round a ring
      chunks.push_back({r, i, end, box.widened(reachOf(room, r))});
    }
  }
  return chunks;
}

/// Adds the pairs that two chunks have, or one by itself.
void Neighbours::addPairs(const Room &room, const Chunk &a, const Chunk &b, std::vector<TouchingPair> &pairs) const {
  const bool same = a.rod == b.rod, itself = same && a.begin == b.begin;
  if (same && (scene_.rods[std::size_t(a.rod)].contact.rods != ContactSettings::Rods::all ||
               isApart(room, a.rod, a.begin, b.begin)))
    return;
  std::array<Box, chunk_edges> boxes;
  for (int j = b.begin; j < b.end; ++j) boxes[std::size_t(j - b.begin)] = boxOf(room, b.rod, j);
  for (int i = a.begin; i < a.end; ++i) {
    const Box box = boxOf(room, a.rod, i);
    if (!box.overlaps(b.box)) continue;
    for (int j = b.begin; j < (itself ? i : b.end); ++j) {
      if (box.overlaps(boxes[std::size_t(j - b.begin)]) && mayTouch(a.rod, i, b.rod, j) &&
          isNear(room, a.rod, i, b.rod, j))
        pairs.push_back(pairOf(a.rod, i, b.rod, j));
    }
  }
}

std::vector<TouchingPair> Neighbours::find(const Room &room) const {
  const std::vector<Chunk> chunks = chunksOf(room);
  if (chunks.empty()) return {};
  std::vector<Box> boxes;
  for (const Chunk &c : chunks) boxes.push_back(c.box);
  const Grid grid(boxes);
  const std::vector<InCell> cells = grid.cellsOf(boxes);
  std::vector<TouchingPair> pairs;
  for (std::size_t begin = 0, end; begin < cells.size(); begin = end) {
    end = begin + 1;
    while (end < cells.size() && cells[end].cell == cells[begin].cell) ++end;
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t j = begin; j <= i; ++j) {
        const Chunk &a = chunks[std::size_t(cells[i].chunk)], &b = chunks[std::size_t(cells[j].chunk)];
        if (!a.box.overlaps(b.box)) continue;
        // They meet in other cells, too.
        if (grid.keyOf(a.box.low.cwiseMax(b.box.low)) == cells[begin].cell) addPairs(room, a, b, pairs);
      }
  }
  std::sort(pairs.begin(), pairs.end(), isBefore);
  return pairs;
}

std::vector<TouchingPair> Neighbours::findByAll(const Room &room) const {
  std::vector<TouchingPair> pairs;
  const int rods = int(elements_.rods.size());
  for (int r = 0; r < rods; ++r)
    for (int i = 0; i < elements_.rods[std::size_t(r)].edges; ++i)
      for (int q = 0; q <= r; ++q)
        for (int j = 0; j < (q == r ? i : elements_.rods[std::size_t(q)].edges); ++j) {
          if (boxOf(room, r, i).overlaps(boxOf(room, q, j)) && mayTouch(r, i, q, j) && isNear(room, r, i, q, j) &&
              !(q == r && isApart(room, r, i, j)))
            pairs.push_back(pairOf(r, i, q, j));
        }
  return pairs;
}

} // namespace tendril
