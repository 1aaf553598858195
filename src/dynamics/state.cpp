#include "tendril/dynamics/state.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril {

State initialState(const Scene &scene, const Elements &elements) {
  State s;
  for (const Rod &rod : scene.rods) {
    s.position.insert(s.position.end(), rod.position.begin(), rod.position.end());
    double length = 0, along = 0;
    for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
    for (int i = 0; i < rod.edges(); ++i) {
      const Frame f = referenceFrame(rod, i);
      if (i > 0) along += 0.5 * f.length;
      s.director.push_back(rotateAbout<double>(f.director, f.tangent, 2 * pi * rod.initial_turns * along / length));
      along += 0.5 * f.length;
    }
    s.velocity.insert(s.velocity.end(), rod.position.size(), rod.initial_velocity);
  }
  s.twist_rate.assign(s.director.size(), 0.0);
  s.axial_force.assign(s.director.size(), 0.0);
  s.turns.assign(elements.cells.size(), 0.0);
  const Configuration c = configurationOf(s, scene, elements, 0);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    if (rod.measure != Measure::angle || rod.initial_turns == 0) continue;
    double length = 0;
    for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n) {
      const double expected = 2 * pi * rod.initial_turns * elements.cells.length[n] / length;
      s.turns[n] = 2 * pi * std::round((expected - c.twist[n]) / (2 * pi));
    }
  }
  for (const Support &support : scene.supports)
    if (support.holdsPosition()) s.velocity[elements.rods[support.rod].first_vertex + support.vertex].setZero();
  return s;
}

Frame supportFrame(const Support &support, double motion_time) {
  const Mat3 r = support.motion.rotationAt(motion_time);
  return {r * support.frame.tangent, r * support.frame.director, 1.0};
}

Configuration configurationOf(const State &state, const Scene &scene, const Elements &elements, double motion_time) {
  Configuration c;
  const std::size_t ne = state.director.size();
  c.position = state.position;
  c.frame.resize(elements.frames);
  c.strain.resize(ne);
  for (std::size_t i = 0; i < ne; ++i) {
    const Vec3 e = state.position[elements.vertex1[i]] - state.position[elements.vertex0[i]];
    const double length = e.norm();
    c.frame[i] = {e / length, state.director[i], length};
    c.strain[i] = axialStrain(length, elements.inverse_rest_length[i]);
  }
  for (std::size_t s = 0; s < scene.supports.size(); ++s)
    if (elements.support_frame[s] >= 0) c.frame[elements.support_frame[s]] = supportFrame(scene.supports[s], motion_time);
  c.spin.assign(ne, 0.0);
  c.turns = state.turns;
  c.twist.assign(state.turns.size(), 0.0);
  for (int n = 0; n < elements.cells.size(); ++n)
    c.twist[n] = halfAngleBetween(c.frame[elements.cells.frame0[n]], c.frame[elements.cells.frame1[n]]).angle() + c.turns[n];
  c.axial_force = state.axial_force;
  return c;
}

} // namespace tendril
