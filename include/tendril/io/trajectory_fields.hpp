#pragma once
/// \file trajectory_fields.hpp
/// The fields of a state in a trajectory, by name: a new one is a row of the table.

#include "tendril/contact/contact.hpp"
#include "tendril/energy/derived.hpp"

#include <hdf5.h>
#include <span>

namespace tendril {

enum class On {
  vertices,
  edges,
  cells,
  supports,
  constraints,
  colliders,
  bodies,
  attachments,
  joints,
  tendons,
  tendon_points
};
inline constexpr const char *places[] = {"vertices", "edges",       "cells",  "supports", "constraints",  "colliders",
                                         "bodies",   "attachments", "joints", "tendons",  "tendon_points"};

/// Bodies by their origins and axes: places, quaternions, velocities, spins, and angular momenta about the centres of
/// mass.
struct BodyMotion {
  std::vector<Vec3> position, velocity, spin, momentum;
  std::vector<Eigen::Vector4d> rotation;
};

/// A frame about to be written: a state and what is derived from it, as far as some field needs it.
struct Snapshot {
  const State &state;
  RodStrains strains;
  RodActions actions;
  std::vector<double> constraint_deviation = {}, constraint_force = {}, joint_coordinate = {};
  std::vector<Vec3> joint_distance = {}, joint_force = {}, joint_moment = {};
  std::vector<double> tendon_displacement = {}, tendon_length = {}, tendon_rate = {}, tendon_tension = {},
                      tendon_point_tension = {};
  std::vector<Vec3> tendon_position = {};
  std::vector<ContactReading> contacts = {};
  std::vector<Vec3> contact_force = {}, collider_force = {}, collider_moment = {}, collider_position = {};
  std::vector<Eigen::Vector4d> collider_rotation = {};
  BodyMotion body = {};
};
enum class From { state, second_word, strains, actions, contact, motion, bodies, tendons };

struct Field {
  const char *name, *unit;
  On place;
  hsize_t components;
  From source;
  const double *(*data)(const Snapshot &);
};

extern const std::span<const Field> fields;
/// Whether they are written where nothing else is said.
bool isUsual(From source);
/// Rows of a frame, by places.
std::array<int, std::size(places)> sizes(const Scene &scene, const Elements &elements);
/// w, x, y, z
Eigen::Vector4d quaternionOf(const Mat3 &rotation);
BodyMotion motionOfBodies(const Scene &scene, const Elements &elements, const State &state);

} // namespace tendril
