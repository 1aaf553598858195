#include "tendril/solver/retraction.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril {
namespace {

/// Whether two edges folded by more than a right angle are on the other side of 180 degrees afterwards: their binormal, seen from the first edge's
/// frame, has turned round.
bool crossesFold(const Frame &a0, const Frame &b0, const Frame &a1, const Frame &b1) {
  if (a0.tangent.dot(b0.tangent) > 0 || a1.tangent.dot(b1.tangent) > 0) return false;
  const Vec3 before = a0.tangent.cross(b0.tangent), after = a1.tangent.cross(b1.tangent);
  return before.dot(a0.director) * after.dot(a1.director) + before.dot(a0.secondDirector()) * after.dot(a1.secondDirector()) < 0;
}

} // namespace

Retraction::Retraction(const Elements &elements, const DofMap &dofs) : elements_(elements) {
  held_.resize(dofs.vertices());
  for (int v = 0; v < dofs.vertices(); ++v) held_[v] = dofs.isHeld(v);
  setInverseTimeSquared(0);
}

void Retraction::setInverseTimeSquared(double value) {
  inverse_time_squared_ = value;
  softness_.assign(held_.size(), 0.0);
  for (std::size_t i = 0; i < elements_.vertex0.size(); ++i)
    for (const int v : {elements_.vertex0[i], elements_.vertex1[i]})
      softness_[v] += 1e-8 * elements_.axial_stiffness[i] * elements_.inverse_rest_length[i]; // a floor for rods without mass
  for (std::size_t v = 0; v < held_.size(); ++v) softness_[v] = held_[v] ? 0.0 : 1 / (softness_[v] + elements_.mass[v] * value);
}

bool Retraction::apply(const Configuration &from, const std::vector<double> &increment, double scale, int r, Configuration &to) {
  const RodRange &rod = elements_.rods[r];
  for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v)
    to.position[v] = from.position[v] + scale * Eigen::Map<const Vec3>(&increment[elements_.vertex_row[v]]);
  if (kind == RetractionKind::length && !restoreLengths(from, r, to.position)) return false;
  return updateFrames(from, increment, scale, r, to);
}

/// Replaces the additive positions of a rod: chains where an end is free, corrections between held vertices and around rings.
bool Retraction::restoreLengths(const Configuration &from, int r, std::vector<Vec3> &x) {
  const RodRange &rod = elements_.rods[r];
  target_.resize(rod.edges);
  direction_.resize(rod.edges);
  for (int i = 0; i < rod.edges; ++i) {
    const int e = rod.first_edge + i;
    const Vec3 edge = x[elements_.vertex1[e]] - x[elements_.vertex0[e]]; // e + scale de
    const Frame &before = from.frame[e];
    target_[i] = before.tangent.dot(edge);
    if (continues) target_[i] -= (edge - before.length * before.tangent).squaredNorm() / (2 * before.length);
    const double length = edge.norm();
    if (!(target_[i] > 0) || !(length > 0)) return false;
    direction_[i] = edge / length;
  }
  const int v0 = rod.first_vertex;
  int first = -1, last = -1; // held vertices of the rod
  for (int v = 0; v < rod.vertices; ++v)
    if (held_[v0 + v]) {
      if (first < 0) first = v;
      last = v;
    }
  if (rod.closed) {
    projectSpan(r, 0, rod.vertices, x);
    return true;
  }
  if (first < 0) { // a free rod keeps the mass-weighted mean of the additive update
    Vec3 before = Vec3::Zero(), after = Vec3::Zero();
    double mass = 0;
    auto mean = [&](Vec3 &sum) {
      for (int v = 0; v < rod.vertices; ++v) sum += elements_.mass[v0 + v] * x[v0 + v];
    };
    mean(before);
    for (int v = 0; v + 1 < rod.vertices; ++v) x[v0 + v + 1] = x[v0 + v] + target_[v] * direction_[v];
    mean(after);
    for (int v = 0; v < rod.vertices; ++v) mass += elements_.mass[v0 + v];
    if (mass > 0)
      for (int v = 0; v < rod.vertices; ++v) x[v0 + v] += (before - after) / mass;
    return true;
  }
  for (int v = first; v > 0; --v) x[v0 + v - 1] = x[v0 + v] - target_[v - 1] * direction_[v - 1];
  for (int v = last; v + 1 < rod.vertices; ++v) x[v0 + v + 1] = x[v0 + v] + target_[v] * direction_[v];
  for (int v = first; v < last;) {
    int end = v + 1;
    while (!held_[v0 + end]) ++end;
    if (end > v + 1) projectSpan(r, v, end, x);
    v = end;
  }
  return true;
}

/// Two Newton sweeps that move the vertices between `first` and `last` the least, in the norm of the softness, towards the target lengths.
/// The compliance of the edges keeps the system regular where the lengths cannot be met. A closed rod is one span whose last edge
/// meets its first; the corner of its cyclic system enters as a rank-one change (Sherman and Morrison 1950).
void Retraction::projectSpan(int r, int first, int last, std::vector<Vec3> &x) {
  const RodRange &rod = elements_.rods[r];
  const int n = last - first;
  diagonal_.resize(n);
  upper_.resize(n);
  right_.resize(2 * n);
  auto edge = [&](int k) { return rod.first_edge + first + k; };
  for (int sweep = 0; sweep < 2; ++sweep) {
    for (int k = 0; k < n; ++k) {
      const int a = elements_.vertex0[edge(k)], b = elements_.vertex1[edge(k)];
      const Vec3 e = x[b] - x[a];
      const double length = e.norm();
      direction_[k] = e / length;
      right_[k] = length - target_[first + k];
      right_[n + k] = 0;
      diagonal_[k] = softness_[a] + softness_[b] + elements_.rest_length[edge(k)] / elements_.axial_stiffness[edge(k)];
    }
    for (int k = 0; k + 1 < n; ++k) upper_[k] = -softness_[elements_.vertex1[edge(k)]] * direction_[k].dot(direction_[k + 1]);
    double corner = 0, gamma = 0;
    if (rod.closed) {
      corner = -softness_[elements_.vertex0[edge(0)]] * direction_[0].dot(direction_[n - 1]);
      gamma = -diagonal_[0];
      diagonal_[0] -= gamma;
      diagonal_[n - 1] -= corner * corner / gamma;
      right_[n] = gamma;
      right_[2 * n - 1] = corner;
    }
    for (int k = 1; k < n; ++k) {
      const double factor = upper_[k - 1] / diagonal_[k - 1];
      diagonal_[k] -= factor * upper_[k - 1];
      right_[k] -= factor * right_[k - 1];
      right_[n + k] -= factor * right_[n + k - 1];
    }
    for (int k = n - 1; k >= 0; --k)
      for (double *y : {&right_[0], &right_[n]}) y[k] = (y[k] - (k + 1 < n ? upper_[k] * y[k + 1] : 0.0)) / diagonal_[k];
    if (rod.closed) {
      const double *z = &right_[n];
      const double factor = (right_[0] + corner / gamma * right_[n - 1]) / (1 + z[0] + corner / gamma * z[n - 1]);
      for (int k = 0; k < n; ++k) right_[k] -= factor * z[k];
    }
    for (int k = 0; k < n; ++k) {
      const int a = elements_.vertex0[edge(k)], b = elements_.vertex1[edge(k)];
      x[a] += softness_[a] * right_[k] * direction_[k];
      x[b] -= softness_[b] * right_[k] * direction_[k];
    }
  }
}

bool Retraction::updateFrames(const Configuration &from, const std::vector<double> &increment, double scale, int r, Configuration &to) const {
  const RodRange &rod = elements_.rods[r];
  const bool twist = rod.stride == 4;
  for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
    const Vec3 e = to.position[elements_.vertex1[i]] - to.position[elements_.vertex0[i]];
    const double length = e.norm();
    const Frame &f = from.frame[i];
    const Vec3 t = e / length;
    if (!(length > 0) || !(1 + f.tangent.dot(t) > 1e-8)) return false;
    const double angle = twist ? scale * increment[elements_.edge_row[i] + 3] : 0.0;
    Vec3 director = transport<double>(f.director, f.tangent, t);
    if (angle != 0) director = rotateAbout<double>(director, t, angle);
    to.frame[i] = {t, director, length};
    to.strain[i] = axialStrain(length, elements_.inverse_rest_length[i]);
    to.spin[i] = from.spin[i] + angle;
  }
  // Whole turns of the twist angle by continuity: the angle moves by the difference of the two spins, and by a little holonomy. Half a turn
  // is a barrier of the measure `tan`: no step leads across it.
  const CellArrays &cells = elements_.cells;
  const int ne = int(to.spin.size());
  auto turning = [&](int frame) { return frame < ne ? to.spin[frame] - from.spin[frame] : 0.0; };
  for (int c = elements_.rod_cells[r]; c < elements_.rod_cells[r + 1]; ++c) {
    const double expected = from.twist[c] + turning(cells.frame1[c]) - turning(cells.frame0[c]);
    const double principal = halfAngleBetween(to.frame[cells.frame0[c]], to.frame[cells.frame1[c]]).angle();
    to.turns[c] = 2 * pi * std::round((expected - principal) / (2 * pi));
    if (elements_.measure[r] != Measure::tan) continue;
    if (to.turns[c] != 0 || crossesFold(from.frame[cells.frame0[c]], from.frame[cells.frame1[c]], to.frame[cells.frame0[c]], to.frame[cells.frame1[c]])) return false;
    to.twist[c] = principal + to.turns[c];
  }
  return true;
}

} // namespace tendril
