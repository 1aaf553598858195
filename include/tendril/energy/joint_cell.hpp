#pragma once
/// \file joint_cell.hpp
/// The half cell between an edge and the frame of a junction: a cell whose one frame is no edge, but turns by a spin.

#include "tendril/energy/bend_twist.hpp"

namespace tendril {

/// Derivatives of a half cell by the spin of the frame, R -> Exp(spin) R with spatial components, and by the vector and
/// the twist of the edge.
struct JointCellDerivatives {
  Vec3 spin; ///< [N m]
  Eigen::Vector4d edge;
  Mat3 spin_spin;
  Eigen::Matrix<double, 3, 4> spin_edge;
  Eigen::Matrix4d edge_edge;
};

/// Frame as an edge of unit length: by its spin its tangent t moves by spin x t + spin x (spin x t)/2, and it twists by
/// t.spin, up to third order (docs/theory.md (8.1)). With T these first derivatives, g those of the energy by the
/// vector of that edge and H its Hessian the Hessian by the spin is T'HT + (g t' + t g')/2 - (g.t) 1, (8.2).
///
/// \param cell the frame has no weight in its length
///
/// \param frame whether the first or the second of the two is the frame: 0 or 1
template <Measure measure>
JointCellDerivatives jointCellDerivatives(const Frame &f0, const Frame &f1, CellOf<double> cell, int frame) {
  CellDerivatives<double> d;
  cell.free = {1, 1};
  cellDerivatives<measure>(f0, f1, cell, d);
  Eigen::Matrix<double, cell_variables, cell_variables> h;
  for (int r = 0, k = 0; r < cell_variables; ++r)
    for (int c = r; c < cell_variables; ++c, ++k) h(r, c) = h(c, r) = d.hessian[k];
  const std::array<double, cell_size> &g = d.gradient;
  const std::array<Eigen::Vector4d, 2> by{Eigen::Vector4d(-g[0], -g[1], -g[2], g[3]),
                                          Eigen::Vector4d(g[8], g[9], g[10], g[7])};
  const Vec3 t = frame == 0 ? f0.tangent : f1.tangent, force = by[frame].head<3>();
  Eigen::Matrix<double, 4, 3> turn;
  turn << -crossMatrix<double>(t), t.transpose();
  const int first = 4 * frame, other = 4 - first;
  JointCellDerivatives out;
  out.spin = turn.transpose() * by[frame];
  out.edge = by[1 - frame];
  out.spin_spin = turn.transpose() * h.block<4, 4>(first, first) * turn +
                  0.5 * (force * t.transpose() + t * force.transpose()) - force.dot(t) * Mat3::Identity();
  out.spin_edge = turn.transpose() * h.block<4, 4>(first, other);
  out.edge_edge = h.block<4, 4>(other, other);
  return out;
}

} // namespace tendril
