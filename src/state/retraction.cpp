#include "tendril/state/retraction.hpp"

#include "tendril/geometry/rotation.hpp"

namespace tendril {
namespace {

using C = Configuration;

/// Lanes in which two edges folded by more than a right angle are on the other side of 180 degrees afterwards: their
/// binormal, seen from the first edge's frame, has turned round.
template <class T> auto crossesFold(const std::array<FrameOf<T>, 2> &before, const std::array<FrameOf<T>, 2> &after) {
  auto binormal = [](const std::array<FrameOf<T>, 2> &f) {
    const Vector3<T> b = f[0].tangent.cross(f[1].tangent);
    return std::array<T, 2>{b.dot(f[0].director), b.dot(f[0].secondDirector())};
  };
  const auto folded =
      before[0].tangent.dot(before[1].tangent) <= T(0.0) && after[0].tangent.dot(after[1].tangent) <= T(0.0);
  const std::array<T, 2> b0 = binormal(before), b1 = binormal(after);
  return folded && b0[0] * b1[0] + b0[1] * b1[1] < T(0.0);
}

bool anyLane(bool b) { return b; }
bool anyLane(const Pack::mask_type &m) { return any_of(m); }

/// As crossesFold, of edges without frames of their own.
bool foldsOver(const Elements &elements, const Configuration &before, const Configuration &after, int rod) {
  bool any = false;
  forCells(elements, rod, [&]<class T>(const LooseCell &cell, int count) {
    auto tangents = [&](const Configuration &c) {
      return std::array{readVector<T>(c.values(), C::tangent, cell.frame0),
                        readVector<T>(c.values(), C::tangent, cell.frame1)};
    };
    const auto was = tangents(before), is = tangents(after);
    auto over = was[0].dot(was[1]) <= T(0.0) && is[0].dot(is[1]) <= T(0.0) &&
                was[0].cross(was[1]).dot(is[0].cross(is[1])) < T(0.0);
    if constexpr (std::is_same_v<T, Pack>) over = over && firstLanes(count);
    any = any || anyLane(over);
  });
  return any;
}

} // namespace

Retraction::Retraction(const Elements &elements) : elements_(elements), work_(work_planes, elements.slots) {
  setInverseTimeSquared(0);
}

void Retraction::setInverseTimeSquared(double value) {
  if (value == inverse_time_squared_) return;
  inverse_time_squared_ = value;
  double *soft = work_[softness];
  for (const RodRange &rod : elements_.rods) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) soft[s] = 0;
    for (int i = 0; i < rod.edges; ++i) // a floor for rods without mass
      for (const int v : {i, (i + 1) % rod.vertices})
        soft[rod.slot(v)] +=
            1e-8 * elements_.axialStiffness()[rod.slot(i)] * elements_.inverseRestLength()[rod.slot(i)];
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      soft[s] = elements_.freedom()[s] / (soft[s] + elements_.mass()[s] * value);
    stiffenNearHeld(rod, elements_.pinsOf(int(&rod - elements_.rods.data())));
  }
}

/// Corrections must not kink the rod where a held vertex stands still beside vertices that move: between two held
/// vertices, at distances a and b, the softness is multiplied by docs/theory.md (21.5), (4ab/(a + b)^2)^2, which leaves
/// position and direction at both as they are. A vertex that a pin makes q times as soft is held but for q: the factor
/// f becomes q + (1 - q) f, q linear from one to the other (21.6).
void Retraction::stiffenNearHeld(const RodRange &rod, const Elements::Pins &pins) {
  double *soft = work_[softness];
  const double *freedom = elements_.freedom(), *length = elements_.restLength();
  std::vector<std::pair<int, double>> held; // with q
  auto pin = pins.begin();
  for (int i = 0; i < rod.vertices; ++i) {
    if (freedom[rod.slot(i)] == 0) held.emplace_back(i, 0.0);
    if (pin == pins.end() || pin->first != rod.slot(i)) continue;
    const double softer = 1 / (1 + soft[rod.slot(i)] * (pin++)->second);
    held.emplace_back(i, softer);
    soft[rod.slot(i)] *= softer;
  }
  if (held.empty()) return;
  if (rod.closed) held.emplace_back(held.front().first + rod.vertices, held.front().second);
  for (std::size_t k = 0; k + 1 < held.size(); ++k) {
    auto slot = [&](int i) { return rod.slot(i % rod.vertices); };
    const auto [begin, q0] = held[k];
    const auto [end, q1] = held[k + 1];
    double span = 0, a = 0;
    for (int i = begin; i < end; ++i) span += length[slot(i)];
    for (int i = begin + 1; i < end; ++i) {
      a += length[slot(i - 1)];
      const double q = q0 + (q1 - q0) * (a / span);
      soft[slot(i)] *= q + (1 - q) * std::pow(4 * a * (span - a) / (span * span), 2);
    }
  }
}

bool Retraction::apply(const C &from, const Planes &increment, double scale, int r, RetractionKind kind, C &to) {
  const RodRange &rod = elements_.rods[r];
  for (int a = 0; a < 3; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); s += lanes) {
      Pack high = read<Pack>(from[C::Plane(C::position + a)] + s),
           low = read<Pack>(from[C::Plane(C::position_low + a)] + s);
      addTwoWords(high, low, Pack(Pack(scale) * read<Pack>(increment[a] + s)));
      write(to[C::Plane(C::position + a)] + s, high);
      write(to[C::Plane(C::position_low + a)] + s, low);
    }
  for (const JoinedVertex &j : elements_.joinedVertices({r, r + 1}))
    if (j.isOnBody()) turnArm(from, increment, scale, j, to);
  if (kind != RetractionKind::additive && !restoreLengths(from, r, kind, to)) return false;
  return updateFrames(from, increment, scale, r, to);
}

/// A vertex goes with its body: (exp(d) - 1 - d x) arm beyond what its increment says; and so does its frame.
void Retraction::turnArm(const C &from, const Planes &increment, double scale, const JoinedVertex &j, C &to) const {
  const Vec3 turn = scale * increment.vector(0, j.frame);
  const Frame before = from.frameAt(j.frame);
  const Mat3 rotation = rotationBy(turn);
  const Vec3 arm = from.rotationAt(j.frame) * elements_.armAsDrawn(j);
  to.setFrame(j.frame, {rotation * before.tangent, rotation * before.director, 1});
  to.setPosition(j.frame, from.positionAt(j.frame) + turn, Vec3::Zero());
  const Vec3 beyond = rotation * arm - arm - turn.cross(arm);
  const Configuration &moved = j.isVertex() ? to : from; // vertices have gone by their increments already
  Vec3 high = moved.positionAt(j.slot), low = moved.values().vector(C::position_low, j.slot);
  for (int a = 0; a < 3; ++a) {
    if (!j.isVertex()) addTwoWords(high[a], low[a], scale * increment[a][j.slot]);
    addTwoWords(high[a], low[a], beyond[a]);
  }
  to.setPosition(j.slot, high, low);
  to.closeRing(elements_.rods[j.rod]);
}

/// Lengths that edges shall have, docs/theory.md (21.1) or (21.2), and their directions, by the additive positions in
/// `to`; false when an edge vanishes or turns back on itself.
[[gnu::flatten]] bool Retraction::aim(const C &from, const RodRange &rod, RetractionKind kind, const C &to) {
  using std::sqrt;
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Vector3<Pack> edge = to.edges<Pack>(s); // e + scale de
    const FrameOf<Pack> before = from.frames<Pack>(s);
    Pack want = before.tangent.dot(edge);
    if (kind == RetractionKind::continued)
      want -= (edge - before.tangent * before.length).squaredNorm() / (Pack(2.0) * before.length);
    if (kind == RetractionKind::kept) want = before.length;
    const Pack length = sqrt(edge.squaredNorm());
    if (any_of(!(want > Pack(0.0) && length > Pack(0.0)) && firstLanes(rod.edgeEnd() - s))) return false;
    write(work_[target] + s, want);
    writeVector<Pack>(work_, direction, s, edge / length);
  }
  return true;
}

/// Lays the edges of a chain one after the other, from the vertex at the slot `begin` to that at `end`.
void Retraction::lay(int begin, int end, C &to) const {
  const int way = end > begin ? 1 : -1;
  std::array<double *, 3> x, low;
  std::array<const double *, 3> d;
  for (int a = 0; a < 3; ++a) {
    x[a] = to[C::Plane(C::position + a)];
    low[a] = to[C::Plane(C::position_low + a)];
    d[a] = work_[direction + a];
  }
  for (int at = begin; at != end; at += way) {
    const int edge = way > 0 ? at : at - 1, next = at + way;
    for (int a = 0; a < 3; ++a) { // as addTwoWords, but the words are put in order later, off the chain of dependencies
      const double e = way * work_[target][edge] * d[a][edge], sum = x[a][at] + e, added = sum - x[a][at];
      low[a][next] = low[a][at] + ((x[a][at] - (sum - added)) + (e - added));
      x[a][next] = sum;
    }
  }
}

/// Moves all of a rod, and puts the two words of its positions in order.
static void moveAll(const RodRange &rod, const Vec3 &by, C &to) {
  for (int a = 0; a < 3; ++a) {
    double *x = to[C::Plane(C::position + a)], *low = to[C::Plane(C::position_low + a)];
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
      Pack high = read<Pack>(x + s), rest = read<Pack>(low + s);
      addTwoWords(high, rest, Pack(by[a]));
      write(x + s, high);
      write(low + s, rest);
    }
  }
}

/// Lays a rod that nothing holds from the vertex at the slot `anchor` both ways, and moves it so that a weighted mean
/// of the additive update is kept: by the masses, or where a pin draws that vertex by 1/softness, which counts it, too.
[[gnu::flatten]] void Retraction::layFree(const C &from, const RodRange &rod, int anchor, bool pinned, C &to) const {
  Vec3 before = Vec3::Zero(), after = Vec3::Zero();
  double total = 0;
  auto weight = [&](int s) { return pinned ? 1 / work_[softness][s] : elements_.mass()[s]; };
  auto mean = [&](Vec3 &sum) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) sum += weight(s) * to.displacementAt(s, from);
  };
  mean(before);
  lay(anchor, rod.first_slot, to);
  lay(anchor, rod.edgeEnd(), to);
  mean(after);
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) total += weight(s);
  moveAll(rod, total > 0 ? Vec3((before - after) / total) : Vec3::Zero(), to);
}

/// Replaces the additive positions of a rod: chains where an end is free, corrections between held vertices and around
/// rings.
[[gnu::flatten]] bool Retraction::restoreLengths(const C &from, int r, RetractionKind kind, C &to) {
  const RodRange &rod = elements_.rods[r];
  if (!aim(from, rod, kind, to)) return false;
  const int begin = rod.first_slot, end = rod.edgeEnd(); // end vertices of an open rod
  const double *freedom = elements_.freedom();
  int first = -1, last = -1; // held vertices of the rod
  for (int s = begin; s < rod.vertexEnd(); ++s)
    if (freedom[s] == 0) {
      if (first < 0) first = s;
      last = s;
    }
  if (rod.closed) {
    projectSpan(rod, begin, end, to);
    return true;
  }
  // From the first and the last vertex that is held or pinned, ends hang by chains; between are spans.
  const Elements::Pins &pins = elements_.pinsOf(r);
  int low = first, high = last;
  if (!pins.empty()) {
    low = first < 0 ? pins.front().first : std::min(first, pins.front().first);
    high = std::max(last, pins.back().first);
  }
  if (first < 0 && low == high) {
    layFree(from, rod, std::max(low, begin), low >= 0, to);
    return true;
  }
  lay(low, begin, to);
  lay(high, end, to);
  moveAll(rod, Vec3::Zero(), to);
  for (int s = low; s < high;) {
    int next = s + 1;
    while (next < high && freedom[next] != 0) ++next;
    if (next > s + 1) projectSpan(rod, s, next, to);
    s = next;
  }
  return true;
}

/// The system of projectSpan, and what it is to correct; the farthest that a length is from its target, over its own.
[[gnu::flatten]] inline Pack Retraction::measureSpan(const RodRange &rod, int first, int last, C &to) {
  using std::sqrt, std::abs;
  // Of a length: its last bits are no reason to move vertices, many times as far where a span is nearly straight.
  constexpr double rounding = 4 * std::numeric_limits<double>::epsilon();
  double *soft = work_[softness], *diag = work_[diagonal], *up = work_[upper], *rhs = work_[right];
  Pack farthest(0.0);
  if (rod.closed) {
    to.closeRing(rod);
    soft[last] = soft[first];
  }
  for (int s = first; s < last; s += lanes) {
    const Pack::mask_type live = firstLanes(last - s);
    const Vector3<Pack> e = to.edges<Pack>(s);
    const Pack length = sqrt(e.squaredNorm());
    for (int a = 0; a < 3; ++a) write(work_[direction + a] + s, select(live, Pack(e[a] / length), Pack(0.0)));
    const Pack wrong = length - read<Pack>(work_[target] + s);
    write(rhs + s, select(live && Pack(abs(wrong)) > length * Pack(rounding), wrong, Pack(0.0)));
    farthest = max(farthest, Pack(abs(read<Pack>(rhs + s)) * read<Pack>(elements_.inverseRestLength() + s)));
    const Pack compliance = read<Pack>(elements_.restLength() + s) / read<Pack>(elements_.axialStiffness() + s);
    write(diag + s, select(live, Pack(read<Pack>(soft + s) + read<Pack>(soft + s + 1) + compliance), Pack(1.0)));
  }
  for (int s = first; s < last - 1; s += lanes)
    write(up + s, Pack(-read<Pack>(soft + s + 1) *
                       readVector<Pack>(work_, direction, s).dot(readVector<Pack>(work_, direction, s + 1))));
  return farthest;
}

/// Newton sweeps, two or more, that move the vertices between the slots `first` and `last` the least, in the norm of
/// the softness, towards the target lengths: docs/theory.md (21.3), (21.4). The compliance of the edges keeps the
/// system regular where the lengths cannot be met. A closed rod is one span whose last edge meets its first; the corner
/// of its cyclic system enters as a rank-one change (Sherman and Morrison 1950).
[[gnu::flatten]] void Retraction::projectSpan(const RodRange &rod, int first, int last, C &to) {
  double *soft = work_[softness], *diag = work_[diagonal], *up = work_[upper], *rhs = work_[right], *z = work_[corner];
  const int end = last - 1;
  constexpr int most_sweeps = 10;
  double before = HUGE_VAL;
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    const Pack farthest = measureSpan(rod, first, last, to);
    double cyclic = 0, gamma = 0;
    if (rod.closed) {
      cyclic = -soft[first] * work_.vector(direction, first).dot(work_.vector(direction, end));
      gamma = -diag[first];
      diag[first] -= gamma;
      diag[end] -= cyclic * cyclic / gamma;
      std::fill(z + first, z + last, 0.0);
      z[first] = gamma;
      z[end] = cyclic;
    }
    auto solve = [&](double *y) {
      for (int s = first + 1; s < last; ++s) y[s] -= up[s - 1] * diag[s - 1] * y[s - 1];
      for (int s = end; s >= first; --s) y[s] = (s < end ? y[s] - up[s] * y[s + 1] : y[s]) * diag[s];
    };
    diag[first] = 1 / diag[first]; // inverse pivots from here on
    for (int s = first + 1; s < last; ++s) diag[s] = 1 / (diag[s] - up[s - 1] * up[s - 1] * diag[s - 1]);
    solve(rhs);
    if (rod.closed) {
      solve(z);
      const double factor = (rhs[first] + cyclic / gamma * rhs[end]) / (1 + z[first] + cyclic / gamma * z[end]);
      for (int s = first; s < last; ++s) rhs[s] -= factor * z[s];
    }
    for (int a = 0; a < 3; ++a) {
      double *x = to[C::Plane(C::position + a)], *low = to[C::Plane(C::position_low + a)], *d = work_[direction + a];
      for (int s = first; s < last; ++s) d[s] *= rhs[s];
      for (int s = last - 1; s > first; --s) addTwoWords(x[s], low[s], soft[s] * (d[s] - d[s - 1]));
      addTwoWords(x[first], low[first], soft[first] * (d[first] - (rod.closed ? d[end] : 0.0)));
      if (!rod.closed) addTwoWords(x[last], low[last], -soft[last] * d[end]);
    }
    const double error = hmax(farthest);
    if (sweep > 0 && (error < 1e-5 || error > 0.5 * before)) break;
    before = error;
  }
  if (rod.closed) to.closeRing(rod);
}

/// Frames, lengths and strains of edges by the positions in `to`; false when one vanishes or turns back on itself.
[[gnu::flatten]] inline bool Retraction::turnEdges(const C &from, const Planes &increment, double scale, int r,
                                                   C &to) const {
  using std::sqrt;
  const RodRange &rod = elements_.rods[r];
  const Energy energy = elements_.energy[r];
  const bool turns = rod.twist;
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Pack::mask_type live = firstLanes(rod.edgeEnd() - s);
    const Vector3<Pack> e = to.edges<Pack>(s);
    const Pack length = sqrt(e.squaredNorm());
    const FrameOf<Pack> f = from.frames<Pack>(s);
    const Vector3<Pack> t = e / length;
    if (any_of(!(length > Pack(0.0) && Pack(1.0) + f.tangent.dot(t) > Pack(1e-8)) && live)) return false;
    Vector3<Pack> director = transport<Pack>(f.director, f.tangent, t);
    if (turns) {
      const Pack angle = Pack(scale) * read<Pack>(increment[3] + s);
      director = rotateAbout<Pack>(director, t, angle);
      write(to[C::spin] + s, Pack(read<Pack>(from[C::spin] + s) + angle));
    }
    for (int a = 0; a < 3; ++a) {
      write(to[C::Plane(C::tangent + a)] + s, select(live, t[a], f.tangent[a]));
      write(to[C::Plane(C::director + a)] + s, select(live, director[a], f.director[a]));
    }
    const Pack kept = select(live, length, f.length);
    write(to[C::length] + s, kept);
    write(to[C::strain] + s, axialStrain<Pack>(energy, kept, read<Pack>(elements_.inverseRestLength() + s)));
  }
  to.closeRing(rod);
  return true;
}

[[gnu::flatten]] bool Retraction::updateFrames(const C &from, const Planes &increment, double scale, int r,
                                               C &to) const {
  using std::floor;
  if (!turnEdges(from, increment, scale, r, to)) return false;
  auto move = [&](int slot) {
    Vec3 high = from.positionAt(slot), low = from.values().vector(C::position_low, slot);
    for (int a = 0; a < 3; ++a) addTwoWords(high[a], low[a], scale * increment[a][slot]);
    to.setPosition(slot, high, low);
  };
  auto turnFrame = [&](int slot, const Vec3 &turn) {
    const Frame before = from.frameAt(slot);
    const Mat3 rotation = rotationBy(turn);
    const Frame after{rotation * before.tangent, rotation * before.director, 1};
    to.setFrame(slot, after);
    to.setPosition(slot, from.positionAt(slot) + turn, Vec3::Zero());
    return std::pair(before, after);
  };
  for (const JoinedBody &b : elements_.bodies({r, r + 1})) {
    turnFrame(b.rotation, scale * increment.vector(0, b.rotation));
    move(b.position);
  }
  for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1})) {
    const Vec3 turn = scale * increment.vector(0, j.frame);
    const auto [before, after] = turnFrame(j.frame, turn);
    // About its tangent, with the whole turns that the spin has.
    const double principal = halfAngleBetween(before, after).angle(),
                 about = 0.5 * turn.dot(before.tangent + after.tangent);
    to[C::spin][j.frame] = from[C::spin][j.frame] + principal + 2 * pi * std::round((about - principal) / (2 * pi));
  }
  for (const Tie &t : elements_.ties({r, r + 1}))
    if (!t.isToBody()) move(t.copy);
  // Whole turns of the twist angle by continuity: the angle moves by the difference of the two spins, and by a little
  // holonomy. Half a turn is a barrier of the measure `tan`: no step leads across it.
  bool possible = true;
  const bool barrier = elements_.measure[r] == Measure::tan;
  if (elements_.rods[r].isReduced()) return !barrier || !foldsOver(elements_, from, to, r);
  forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
    auto turned = [&](int frame) { return T(read<T>(to[C::spin] + frame) - read<T>(from[C::spin] + frame)); };
    const T expected = read<T>(from[C::twist] + cell.slot) + turned(cell.frame1) - turned(cell.frame0);
    const auto frames = cellFrames<T>(to, cell, count);
    const T principal = halfAngleBetween(frames[0], frames[1]).angle();
    const T turns = T(2 * pi) * floor((expected - principal) * T(0.5 / pi) + T(0.5));
    write(to[C::winding] + cell.slot, turns);
    write(to[C::twist] + cell.slot, T(principal + turns));
    if (!barrier) return;
    auto crossed = turns != T(0.0) || crossesFold(cellFrames<T>(from, cell, count), frames);
    if constexpr (std::is_same_v<T, Pack>) crossed = crossed && firstLanes(count);
    possible = possible && !anyLane(crossed);
  });
  return possible;
}

} // namespace tendril
