#include "tendril/contact/obstacles.hpp"

#include <algorithm>

namespace tendril {

using C = Configuration;

std::vector<SamplePoint> samplePoints(int quadrature, double longest_edge, double spacing) {
  const double outer = 0.5 * std::sqrt(0.6), middle = 0.5 / std::sqrt(3.0);
  if (quadrature == 1) return {{0.5, 1}};
  if (quadrature == 2) return {{0.5 - middle, 0.5}, {0.5 + middle, 0.5}};
  if (quadrature == 3) return {{0.5 - outer, 5.0 / 18}, {0.5, 4.0 / 9}, {0.5 + outer, 5.0 / 18}};
  constexpr double most = 64;
  const int parts = int(std::clamp(std::ceil(longest_edge / spacing), 1.0, most));
  std::vector<SamplePoint> points;
  for (int k = 0; k <= parts; ++k) points.push_back({double(k) / parts, (k == 0 || k == parts ? 0.5 : 1.0) / parts});
  return points;
}

double sampleSpacing(const Shape &shape, const ContactSettings &contact) {
  const NormalLaw law(contact, contact.stiffness);
  const double reach = law.reach() > 0 ? law.reach() : contact.smoothing; // of a penalty that begins inside
  return 0.56 * std::sqrt(2 * (shape.curvatureRadius() + contact.radius) * 2 * reach);
}

double freeWay(const Shape &shape, const Vec3 &from, const Vec3 &way, double radius, double gap, double wall,
               double width) {
  constexpr int most_steps = 200;
  constexpr double safety = 0.9, near = 0.2;
  const bool convex = shape.isConvex();
  gap -= wall;
  double done = 0;
  const double stop = near * std::min(gap, width);
  for (int step = 0; step < most_steps; ++step) {
    const double closing = convex ? -shape.at(from + done * way).gradient.dot(way) : way.norm();
    if (!(closing > 0)) return 1;
    if (gap <= stop && done > 0) return done;
    done += safety * std::max(gap, 0.0) / closing;
    if (done >= 1) return 1;
    gap = shape.at(from + done * way).value - radius - wall;
  }
  return done;
}

RodContacts::RodContacts(const Scene &scene, const Elements &elements, int rod)
    : scene_(scene), elements_(elements), settings_(scene.rods[rod].contact), rod_(elements.rods[rod]), index_(rod),
      law_(settings_, settings_.stiffness), away_(chunks() * scene.colliders.size(), HUGE_VAL), nearest_(chunks(), 0) {
  for (int k = 0; k < int(scene.colliders.size()); ++k)
    if (std::find(settings_.passes.begin(), settings_.passes.end(), k) == settings_.passes.end()) met_.push_back(k);
  double longest = 0;
  for (int s = rod_.first_slot; s < rod_.edgeEnd(); ++s) longest = std::max(longest, elements.restLength()[s]);
  for (const Collider &collider : scene.colliders)
    points_.push_back(samplePoints(settings_.quadrature, longest, sampleSpacing(*collider.shape, settings_)));
  for (const Collider &collider : scene.colliders) walls_.push_back(settings_.wall(*collider.shape));
  for (AlignedVector &x : seen_) x.assign(seenOf(chunks()) + lanes, 0.0);
  if (settings_.on_surface) skin_ = SkinSamples(scene.rods[rod], rod_);
}

double RodContacts::movedSince(const Configuration &c, int chunk) const {
  const int slot = rod_.slot(chunk * chunk_edges), count = verticesOf(chunk);
  Pack most(0.0);
  for (int i = 0; i < count; i += lanes) {
    Pack sum(0.0);
    for (int a = 0; a < 3; ++a) {
      const Pack d =
          read<Pack>(c[C::Plane(C::position + a)] + slot + i) - read<Pack>(seen_[a].data() + seenOf(chunk) + i);
      sum += d * d;
    }
    most = max(most, count - i < lanes ? select(firstLanes(count - i), sum, Pack(0.0)) : sum);
  }
  return skin_.gain() * std::sqrt(hmax(most));
}

void RodContacts::look(const Configuration &c, bool all) {
  const int colliders = int(scene_.colliders.size());
  const double time = c.obstacleTime(index_);
  all = all || time != seen_time_;
  seen_time_ = time;
  for (int chunk = 0; chunk < chunks(); ++chunk) {
    if (!all && movedSince(c, chunk) <= 0.5 * nearest_[chunk]) continue;
    const int slot = rod_.slot(chunk * chunk_edges), seen = seenOf(chunk), count = verticesOf(chunk);
    double longest = 0;
    for (int i = 0; i < count; ++i) {
      const Vec3 x = c.positionAt(slot + i);
      for (int a = 0; a < 3; ++a) seen_[a][seen + i] = x[a];
      if (i + 1 < count) longest = std::max(longest, c[C::length][slot + i]);
    }
    nearest_[chunk] = HUGE_VAL;
    for (const int k : met_) {
      const Collider::Pose pose = scene_.colliders[k].poseAt(time);
      std::array<std::array<double, chunk_edges + 2>, 3> local;
      std::array<double, chunk_edges + 2> distance;
      for (int i = 0; i < count; ++i) {
        const Vec3 x = pose.toLocal(Vec3(seen_[0][seen + i], seen_[1][seen + i], seen_[2][seen + i]));
        for (int a = 0; a < 3; ++a) local[a][i] = x[a];
      }
      const double *const points[3] = {local[0].data(), local[1].data(), local[2].data()};
      scene_.colliders[k].shape->distances(points, count, distance.data());
      const double least = *std::min_element(distance.begin(), distance.begin() + count);
      away_[chunk * colliders + k] = least - settings_.padding() - law_.reach() - skin_.apart() * longest - skin_.arm();
      nearest_[chunk] = std::min(nearest_[chunk], away_[chunk * colliders + k]);
    }
  }
}

void RodContacts::placeSamples(const Configuration &c, Samples &out) const {
  const int begin = out.chunk * chunk_edges;
  if (!skin_.empty()) return placeOnSkin(c, begin, out);
  const std::vector<SamplePoint> &points = points_[out.collider];
  const int n = int(points.size());
  for (int k = 0; k < out.count; ++k) {
    out.slot[k] = rod_.slot(begin + (out.first + k) / n);
    out.point[k] = (out.first + k) % n;
    const Vec3 from = c.positionAt(out.slot[k]);
    const Vec3 x = out.pose.toLocal(from + points[out.point[k]].at * (c.positionAt(out.slot[k] + 1) - from));
    for (int a = 0; a < 3; ++a) out.local[a][k] = x[a];
  }
}

/// Each edge goes to the axes of the obstacle once, and all of its samples follow.
void RodContacts::placeOnSkin(const Configuration &c, int begin, Samples &out) const {
  using Axes = Eigen::Matrix<double, 3, 4>; // of an edge: its first vertex, its vector, both directors
  const Mat3 turn = out.pose.rotation.transpose();
  auto axesOf = [&](int edge) {
    Axes axes = Axes::Zero();
    if (edge + 1 >= verticesOf(out.chunk)) return axes; // nothing is carried by it
    const int slot = rod_.slot(begin + edge);           // behind a ring a copy
    const Frame frame = c.frameAt(slot);
    axes << c.positionAt(slot) - out.pose.position, c.edges<double>(slot), frame.director, frame.secondDirector();
    return Axes(turn * axes);
  };
  const int first = firstOnSkin(out.chunk) + out.first;
  int done = 0;
  for (int edge = onSkin(out, 0).point.slot() - rod_.slot(begin); done < out.count; ++edge) {
    const int end = std::min(skin_.first(begin + edge + 1) - first, out.count);
    if (end <= done) continue;
    const Axes one = axesOf(edge), other = axesOf(edge + 1);
    const auto part = skin_.partsFrom(first);
    for (int a = 0; a < 3; ++a) {
      double *const to = out.local[a].data();
      const double f0 = one(a, 0), f1 = one(a, 1), f2 = one(a, 2), f3 = one(a, 3), g0 = other(a, 0), g1 = other(a, 1),
                   g2 = other(a, 2), g3 = other(a, 3);
      for (int k = done; k < end; ++k)
        to[k] = part[0][k] * f0 + part[1][k] * f1 + part[2][k] * f2 + part[3][k] * f3 + part[4][k] * g0 +
                part[5][k] * g1 + part[6][k] * g2 + part[7][k] * g3;
    }
    for (int k = done; k < end; ++k) {
      out.slot[k] = rod_.slot(begin + edge);
      out.point[k] = first + k - skin_.first(begin + edge);
    }
    done = end;
  }
}

Samples RodContacts::samplesOf(const Configuration &c, int chunk, int collider, int first) const {
  Samples out;
  out.collider = collider;
  out.chunk = chunk;
  out.first = first;
  out.pose = scene_.colliders[collider].poseAt(c.obstacleTime(index_));
  out.count = std::min(Samples::most, samplesIn(chunk, collider) - first);
  placeSamples(c, out);
  const double *const local[3] = {out.local[0].data(), out.local[1].data(), out.local[2].data()};
  scene_.colliders[collider].shape->distances(local, out.count, out.distance.data());
  for (int k = 0; k < out.count; ++k) out.distance[k] -= settings_.padding();
  return out;
}

double RodContacts::smallestGap(const Configuration &c) const {
  const int colliders = int(scene_.colliders.size());
  const bool stood = c.obstacleTime(index_) == seen_time_;
  double least = HUGE_VAL;
  for (int chunk = 0; chunk < chunks(); ++chunk) {
    const double moved = movedSince(c, chunk);
    for (const int k : met_) {
      if (stood && away_[chunk * colliders + k] - moved + law_.reach() >= least) continue;
      for (int first = 0; first < samplesIn(chunk, k); first += Samples::most) {
        const Samples samples = samplesOf(c, chunk, k, first);
        least = std::min(least, *std::min_element(samples.distance.begin(), samples.distance.begin() + samples.count));
      }
    }
  }
  return least;
}

double RodContacts::freeFraction(const Configuration &from, const Configuration &to) const {
  constexpr int most_steps = 200;
  constexpr double safety = 0.9, near = 0.2;
  double free = 1;
  visitNear(to, &from, [&](const Samples &there) {
    const double wall = walls_[there.collider];
    if (!std::isfinite(wall)) return;
    const Samples here = samplesOf(from, there.chunk, there.collider, there.first);
    struct Way {
      Vec3 from, way;
      double closing, gap, stop, done; // the gap falls by no more than `closing` times the part of the way
    };
    std::array<Way, Samples::most> ways;
    const Shape &shape = *scene_.colliders[there.collider].shape;
    const bool convex = shape.isConvex();
    auto approaches = [&](Way *w) {
      if (convex) w->closing = -shape.at(w->from + w->done * w->way).gradient.dot(w->way);
      return w->closing > 0;
    };
    int count = 0;
    for (int k = 0; k < there.count; ++k) {
      Way w;
      w.from = here.at(k);
      w.way = there.at(k) - w.from;
      w.closing = w.way.norm();
      w.gap = here.distance[k] - wall;
      w.stop = near * std::min(w.gap, settings_.isBarrier() ? settings_.distance : -wall);
      if (w.gap > w.closing + w.stop) continue;
      w.done = 0;
      if (approaches(&w)) ways[count++] = w;
    }
    for (int step = 0; step < most_steps && count > 0; ++step) {
      std::array<std::array<double, Samples::most>, 3> x;
      std::array<double, Samples::most> distance;
      int going = 0;
      for (int k = 0; k < count; ++k) {
        Way w = ways[k];
        w.done += safety * std::max(w.gap, 0.0) / w.closing;
        if (w.done >= free) continue;
        for (int a = 0; a < 3; ++a) x[a][going] = w.from[a] + w.done * w.way[a];
        ways[going++] = w;
      }
      const double *const points[3] = {x[0].data(), x[1].data(), x[2].data()};
      shape.distances(points, going, distance.data());
      count = 0;
      for (int k = 0; k < going; ++k) {
        ways[k].gap = distance[k] - settings_.padding() - wall;
        if (ways[k].gap <= ways[k].stop)
          free = std::min(free, ways[k].done);
        else if (approaches(&ways[k]))
          ways[count++] = ways[k];
      }
    }
    for (int k = 0; k < count; ++k) free = std::min(free, ways[k].done);
  });
  return free;
}

} // namespace tendril
