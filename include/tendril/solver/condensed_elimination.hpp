#pragma once
/// \file condensed_elimination.hpp
/// How `condensed` eliminates a group of runs, one by one or a pack at once.

#include "tendril/solver/condensed.hpp"
#include "tendril/solver/elimination.hpp"

#include <algorithm>

namespace tendril {

template <class T>
void CondensedFactor::addEntries(const Group &group, const Block<T> &near, const Block<T> &between,
                                 const Block<T> &far) {
  for (int l = 0; l < group.count; ++l) {
    const Run &run = runs_[group.run[l]];
    double *to = entries_.data() + group.entry[l];
    if (run.near_point || run.far_point) {
      addBodyEntries(run, near, between, far, l, to);
      continue;
    }
    auto put = [&](const Places &row, const Places &column, auto value) {
      for (int r = 0; r < state_size; ++r)
        for (int c = 0; c < state_size; ++c)
          if (row[r] >= 0 && column[c] >= 0) {
            if constexpr (std::is_same_v<T, Pack>)
              *to++ = value(r, c)[l];
            else
              *to++ = value(r, c);
          }
    };
    put(run.near, run.near, [&](int r, int c) { return near[std::min(r, c)][std::max(r, c)]; });
    put(run.near, run.far, [&](int r, int c) { return between[r][c]; });
    put(run.far, run.near, [&](int r, int c) { return between[c][r]; });
    put(run.far, run.far, [&](int r, int c) { return far[std::min(r, c)][std::max(r, c)]; });
  }
}

/// What a run adds where its ends are points of bodies: x = d + spin x arm.
template <class T>
void CondensedFactor::addBodyEntries(const Run &run, const Block<T> &near, const Block<T> &between, const Block<T> &far,
                                     int lane, double *to) {
  using Wide = Eigen::Matrix<double, state_size, places_size>;
  auto of = [&](const T &v) {
    if constexpr (std::is_same_v<T, Pack>)
      return double(v[lane]);
    else
      return v;
  };
  auto wide = [&](const JoinedVertex *point) {
    Wide by = Wide::Zero();
    by.template leftCols<state_size>().setIdentity();
    by.template topRightCorner<3, 3>() = -crossMatrix<double>(armOf(point));
    return by;
  };
  const Wide of_near = wide(run.near_point), of_far = wide(run.far_point);
  auto put = [&](const Places &row, const Places &column, const Wide &left, const Wide &right, auto value) {
    Eigen::Matrix<double, state_size, state_size> block;
    for (int r = 0; r < state_size; ++r)
      for (int c = 0; c < state_size; ++c) block(r, c) = value(r, c);
    const Eigen::Matrix<double, places_size, places_size> all = left.transpose() * block * right;
    for (int r = 0; r < places_size; ++r)
      for (int c = 0; c < places_size; ++c)
        if (row[r] >= 0 && column[c] >= 0) *to++ = all(r, c);
  };
  put(run.near, run.near, of_near, of_near, [&](int r, int c) { return of(near[std::min(r, c)][std::max(r, c)]); });
  put(run.near, run.far, of_near, of_far, [&](int r, int c) { return of(between[r][c]); });
  put(run.far, run.near, of_far, of_near, [&](int r, int c) { return of(between[c][r]); });
  put(run.far, run.far, of_far, of_far, [&](int r, int c) { return of(far[std::min(r, c)][std::max(r, c)]); });
}

template <class T> void CondensedFactor::factorGroup(const Group &group, const BandedSystem &system) {
  const Run &first = runs_[group.run[0]];
  const int end = first.edges;
  std::array<const double *, lanes> source{}, mass{}, spin{}, edge{};
  std::array<std::ptrdiff_t, lanes> stride{};
  std::array<bool, lanes> cable{};
  std::array<std::array<const double *, lanes>, 2> tie{}; // of the first and the last edge to frames
  const double shift = (*system.shift)[rods_.begin];
  constexpr int width = std::is_same_v<T, Pack> ? lanes : 1;
  for (int l = 0; l < width; ++l) {
    const Run &run = runs_[group.run[l]];
    const RodRange &rod = dofs_.rods()[run.rod];
    source[l] = system.blocks->entry(rod, 0) + run.begin;
    stride[l] = rod.slots;
    mass[l] = (*system.metric)[0] + rod.slot(run.begin);
    spin[l] = (*system.metric)[3] + rod.slot(run.begin);
    edge[l] = system.edge_metric ? system.edge_metric + rod.slot(run.begin) : nullptr;
    cable[l] = !rod.twist;
    for (const int k : {0, 1})
      if (const JoinedEdge *frame = k == 0 ? run.near_frame : run.far_frame)
        tie[k][l] = system.blocks->entry(rod, 0) + (frame->cell - rod.first_slot);
  }
  auto make = [&](auto of_lane) {
    if constexpr (std::is_same_v<T, Pack>)
      return Pack([&](auto lane) { return of_lane(int(lane)); });
    else
      return of_lane(0);
  };
  auto isAcross = [](int plane) { return plane >= EdgeBlocks::across(0, 0) && plane < EdgeBlocks::vertex(0, 0); };
  auto atEnds = [&](int plane, int i) {
    return isAcross(plane) && ((i == 0 && first.from_separator && !first.from_through) ||
                               (i == end && first.to_separator && !first.to_through));
  };
  auto fromTie = [&](int plane, int i) {
    const int row = (plane - edge_pairs) / edge_size, column = (plane - edge_pairs) % edge_size,
              turn = i == 0 ? row : column, variable = i == 0 ? column : row;
    return make([&](int l) {
      const double *from = tie[i == 0 ? 0 : 1][l];
      return from && turn < 3 ? from[EdgeBlocks::across(turn, variable) * stride[l]] : 0.0;
    });
  };
  auto plain = [&](int plane, int i) {
    if (atEnds(plane, i)) return fromTie(plane, i);
    return make([&](int l) { return source[l][plane * stride[l] + i]; });
  };
  auto rare = [&](int plane, int i) { // with shifts, and cables, whose twist is no unknown
    if (atEnds(plane, i)) return fromTie(plane, i);
    return make([&](int l) {
      double v = source[l][plane * stride[l] + i];
      if (plane == EdgeBlocks::own(3, 3))
        v += cable[l] ? 1.0 : shift * spin[l][i];
      else if (plane == EdgeBlocks::vertex(0, 0) || plane == EdgeBlocks::vertex(1, 1) ||
               plane == EdgeBlocks::vertex(2, 2))
        v += shift * mass[l][i];
      else if (edge[l] && i < end &&
               (plane == EdgeBlocks::own(0, 0) || plane == EdgeBlocks::own(1, 1) || plane == EdgeBlocks::own(2, 2)))
        v += shift * edge[l][i];
      return v;
    });
  };
  T *const vertex = reinterpret_cast<T *>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T negative(0.0), zero(0.0);
  auto eliminate = [&]<Border border, bool joins>(const auto &read) {
    Elimination<T, border, joins, std::decay_t<decltype(read)>> elimination({0, end, first.from_through}, first.held,
                                                                            read, records);
    Block<T> near{}, between{}, far{};
    if (first.from_separator)
      elimination.runTo(near, between, far, vertex);
    else
      elimination.run(far, vertex);
    addEntries<T>(group, near, between, far);
    negative = elimination.negative;
    zero = elimination.zero;
  };
  const bool is_rare = shift != 0 || std::any_of(cable.begin(), cable.begin() + width, [](bool c) { return c; });
  auto choose = [&]<Border border>() {
    if (system.blocks->joins())
      eliminate.template operator()<border, true>(rare);
    else if (is_rare || std::is_same_v<T, double>) // few runs are alone
      eliminate.template operator()<border, false>(rare);
    else if constexpr (!std::is_same_v<T, double>)
      eliminate.template operator()<border, false>(plain);
  };
  first.to_separator ? choose.template operator()<Border::separator>() : choose.template operator()<Border::none>();
  for (int l = 0; l < group.count; ++l)
    if constexpr (std::is_same_v<T, Pack>) {
      negative_ += int(negative[l]);
      zero_ += int(zero[l]);
    } else {
      negative_ += int(negative);
      zero_ += int(zero);
    }
}

} // namespace tendril
