/// What a trajectory says once: topology, materials, supports, where the run came from.
#include "tendril/io/trajectory.hpp"

#include "tendril/io/shape_file.hpp"

namespace tendril {

/// Radius of a tube that stands for a rod: the mean of the half axes, or without a section that of a homogeneous round
/// rod of its stiffnesses; 0 for a cable.
double radiusOf(const Material &m) {
  if (m.section) return (m.section->halfAxes()[0] + m.section->halfAxes()[1]) / 2;
  return 2 * std::sqrt((m.flexural_stiffness[0] + m.flexural_stiffness[1]) / 2 / m.axial_stiffness);
}

static const char *nameOf(SectionShape shape) {
  switch (shape) {
  case SectionShape::circle:
    return "circle";
  case SectionShape::ellipse:
    return "ellipse";
  case SectionShape::rectangle:
    return "rectangle";
  }
  return "none";
}

void TrajectoryWriter::writeHeader(const Scene &scene, const Elements &elements, const Provenance &p) {
  file_.writeAttribute("format", std::string("tendril-trajectory"));
  file_.writeAttribute("format_version", 2);
  file_.writeAttribute("gravity", std::vector<double>(scene.gravity.data(), scene.gravity.data() + 3));
  writeOrigin(p);

  const hsize_t nr = scene.rods.size();
  std::vector<int> vertex_offsets{0}, edge_offsets{0}, closed, ends;
  std::vector<double> position, director, radius;
  for (std::size_t r = 0; r < nr; ++r) {
    const Rod &rod = scene.rods[r];
    vertex_offsets.push_back(vertex_offsets.back() + elements.rods[r].vertices);
    edge_offsets.push_back(edge_offsets.back() + elements.rods[r].edges);
    closed.push_back(rod.closed);
    for (const Vec3 &x : rod.position) position.insert(position.end(), x.data(), x.data() + 3);
    for (const Vec3 &d : rod.director) director.insert(director.end(), d.data(), d.data() + 3);
    radius.insert(radius.end(), rod.position.size(), radiusOf(rod.material));
  }
  for (int i = 0; i < edges_; ++i) ends.insert(ends.end(), {elements.vertex0[i], elements.vertex1[i]});
  file_.createGroup("topology");
  file_.write("topology/rod_vertex_offsets", {nr + 1}, vertex_offsets.data());
  file_.write("topology/rod_edge_offsets", {nr + 1}, edge_offsets.data());
  file_.write("topology/rod_cell_offsets", {nr + 1}, elements.rod_cells.data());
  file_.write("topology/closed", {nr}, closed.data());
  file_.write("topology/edges", {hsize_t(edges_), 2}, ends.data());
  // The rods in XDMF's code for mixed cells: 2 for a polyline, its number of points, the points; a ring ends where it
  // began.
  std::vector<int> polylines;
  for (const RodRange &rod : elements.rods) {
    polylines.insert(polylines.end(), {2, rod.vertices + (rod.closed ? 1 : 0)});
    for (int v = 0; v < rod.vertices; ++v) polylines.push_back(rod.first_vertex + v);
    if (rod.closed) polylines.push_back(rod.first_vertex);
  }
  polyline_entries_ = polylines.size();
  file_.write("topology/polylines", {polyline_entries_}, polylines.data());
  file_.createGroup("reference");
  file_.write("reference/position", {hsize_t(vertices_), 3}, position.data(), "m");
  file_.write("reference/director", {hsize_t(edges_), 3}, director.data(), "1");
  file_.write("reference/radius", {hsize_t(vertices_)}, radius.data(), "m");
  writeRods();
  writeSkins();
  writeSupports();
  writeConstraints();
  writeColliders();
  writeBodies();
  writeJoints();
  writeTendons();
  writeMaterials();
}

void TrajectoryWriter::writeOrigin(const Provenance &p) {
  file_.writeAttribute("tendril_version", p.version);
  file_.writeAttribute("git_commit", p.git_commit);
  file_.writeAttribute("petsc_version", p.petsc_version);
  file_.writeAttribute("command_line", p.command_line);
  file_.writeAttribute("options", p.options);
  file_.writeAttribute("created", p.created);
  file_.writeAttribute("ranks", p.ranks);
  file_.writeText("scene", p.scene.text);
  file_.writeText("options", p.effective_options);
  if (p.scene.files.empty()) return;
  file_.createGroup("scene_files"); // by number: paths have slashes, which HDF5 takes for groups
  for (std::size_t k = 0; k < p.scene.files.size(); ++k) {
    const std::string name = "scene_files/" + std::to_string(k);
    file_.writeText(name, p.scene.files[k].second);
    file_.writeAttribute(name, "path", p.scene.files[k].first);
  }
}

void TrajectoryWriter::writeRods() {
  std::vector<std::string> names, sections, energies;
  std::vector<double> half_axes;
  for (const Rod &rod : scene_.rods) {
    const std::optional<Section> &section = rod.material.section;
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const std::array<double, 2> axes = section ? section->halfAxes() : std::array{nan, nan};
    names.push_back(rod.name);
    sections.push_back(section ? nameOf(section->shape) : "none");
    energies.push_back(rod.energy == Energy::seed ? "seed" : "classical");
    half_axes.insert(half_axes.end(), axes.begin(), axes.end());
  }
  file_.createGroup("rods");
  file_.write("rods/name", names);
  file_.write("rods/section", sections);
  file_.write("rods/energy", energies);
  file_.write("rods/half_axes", {rods_, 2}, half_axes.data(), "m");
}

void TrajectoryWriter::writeSkins() {
  if (std::none_of(scene_.rods.begin(), scene_.rods.end(), [](const Rod &rod) { return bool(rod.skin); })) return;
  write(file_, SkinTables(scene_.rods));
}

void TrajectoryWriter::writeSupports() {
  if (scene_.supports.empty()) return;
  std::vector<int> vertices;
  std::vector<std::string> types;
  for (const Support &support : scene_.supports) {
    vertices.push_back(elements_.rods[support.rod].first_vertex + support.vertex);
    types.push_back(nameOf(support.kind));
  }
  file_.createGroup("supports");
  file_.write("supports/vertex", {vertices.size()}, vertices.data());
  file_.write("supports/type", types);
}

void TrajectoryWriter::writeConstraints() {
  if (scene_.constraints.empty()) return;
  std::vector<int> rods, places, others;
  std::vector<std::string> names, types;
  for (const Constraint &c : scene_.constraints) {
    const RodRange &rod = elements_.rods[c.rod];
    names.push_back(c.name);
    types.push_back(nameOf(c.kind));
    rods.push_back(c.rod);
    places.push_back((c.isPin() ? rod.first_vertex : rod.first_edge) + c.at);
    others.push_back(c.isTie() ? elements_.rods[c.to_rod].first_vertex + c.to_vertex : -1);
  }
  file_.createGroup("constraints");
  file_.write("constraints/name", names);
  file_.write("constraints/type", types);
  file_.write("constraints/rod", {rods.size()}, rods.data());
  file_.write("constraints/place", {places.size()}, places.data());
  file_.write("constraints/to_vertex", {others.size()}, others.data());
}

/// Of a shape, padded with nan: radii, then half lengths.
static std::array<double, 3> parametersOf(const std::string &shape, const Vec3 &size) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (shape == "sphere") return {size[0], nan, nan};
  if (shape == "capsule" || shape == "cylinder") return {size[0], 0.5 * size[1], nan};
  if (shape == "box") return {0.5 * size[0], 0.5 * size[1], 0.5 * size[2]};
  if (shape == "tube") return {size[0], size[1], 0.5 * size[2]};
  return {nan, nan, nan}; // of a plane: z is its normal
}

static void writeMesh(Hdf5File &file, const std::string &group, const TriangleMesh &mesh) {
  file.createGroup(group);
  file.write(group + "/vertices", {mesh.vertices.size(), 3}, mesh.vertices[0].data(), "m");
  file.write(group + "/triangles", {mesh.triangles.size(), 3}, mesh.triangles[0].data());
}

void TrajectoryWriter::writeColliders() {
  if (scene_.colliders.empty()) return;
  const std::size_t n = scene_.colliders.size();
  std::vector<std::string> names, shapes;
  std::vector<double> parameters, positions, rotations;
  for (const Collider &c : scene_.colliders) {
    const Eigen::Quaterniond q(c.rotation);
    names.push_back(c.name);
    shapes.push_back(c.kind);
    const std::array<double, 3> p = parametersOf(c.kind, c.size);
    parameters.insert(parameters.end(), p.begin(), p.end());
    positions.insert(positions.end(), c.position.data(), c.position.data() + 3);
    rotations.insert(rotations.end(), {q.w(), q.x(), q.y(), q.z()});
  }
  file_.createGroup("colliders");
  file_.createGroup("colliders/meshes");
  for (std::size_t k = 0; k < n; ++k)
    if (scene_.colliders[k].mesh) writeMesh(file_, "colliders/meshes/" + std::to_string(k), *scene_.colliders[k].mesh);
  file_.write("colliders/name", names);
  file_.write("colliders/shape", shapes);
  file_.write("colliders/parameters", {n, 3}, parameters.data(), "m");
  file_.write("colliders/position", {n, 3}, positions.data(), "m");
  file_.write("colliders/rotation", {n, 4}, rotations.data(), "1");
}

void TrajectoryWriter::writeBodies() {
  const std::size_t free = scene_.bodies.size(), n = free + scene_.held_bodies.size();
  if (n == 0) return;
  std::vector<std::string> names, shapes;
  std::vector<double> parameters, mass, inertia, centre;
  std::vector<int> points;
  file_.createGroup("bodies");
  file_.createGroup("bodies/meshes");
  for (std::size_t b = 0; b < n; ++b) {
    const Body &body = b < free ? scene_.bodies[b] : scene_.held_bodies[b - free];
    const MassProperties &all = b < free ? elements_.bodyMass(int(b)) : body.own;
    const std::array<double, 3> p = parametersOf(body.shape, body.size);
    points.push_back(int(b));
    names.push_back(body.name);
    shapes.push_back(body.shape);
    parameters.insert(parameters.end(), p.begin(), p.end());
    mass.push_back(all.mass);
    inertia.insert(inertia.end(), all.inertia.data(), all.inertia.data() + 9); // symmetric
    centre.insert(centre.end(), all.centre.data(), all.centre.data() + 3);
    if (body.mesh) writeMesh(file_, "bodies/meshes/" + std::to_string(b), *body.mesh);
  }
  file_.write("topology/bodies", {n}, points.data()); // cells of XDMF
  file_.write("bodies/name", names);
  file_.write("bodies/shape", shapes);
  file_.write("bodies/parameters", {n, 3}, parameters.data(), "m");
  file_.write("bodies/mass", {n}, mass.data(), "kg");
  file_.write("bodies/inertia", {n, 3, 3}, inertia.data(), "kg m^2");
  file_.write("bodies/centre", {n, 3}, centre.data(), "m");
  if (scene_.attachments.empty()) return;
  std::vector<std::string> attachments, types;
  std::vector<int> bodies, vertices;
  for (const Attachment &a : scene_.attachments) {
    attachments.push_back(a.name);
    types.push_back(a.weld ? "weld" : "pin");
    bodies.push_back(a.body);
    vertices.push_back(elements_.rods[a.rod].first_vertex + a.vertex);
  }
  file_.write("bodies/attachment_name", attachments);
  file_.write("bodies/attachment_body", {bodies.size()}, bodies.data());
  file_.write("bodies/attachment_vertex", {vertices.size()}, vertices.data());
  file_.write("bodies/attachment_type", types);
}

void TrajectoryWriter::writeJoints() {
  if (scene_.joints.empty()) return;
  std::vector<std::string> names, types;
  std::vector<int> children, parents;
  std::vector<double> points, axes;
  for (const Joint &j : scene_.joints) {
    names.push_back(j.name);
    types.emplace_back(nameOf(j.type));
    children.push_back(j.child);
    parents.push_back(j.parent);
    points.insert(points.end(), j.point.data(), j.point.data() + 3);
    const Vec3 axis = j.axes.col(2);
    axes.insert(axes.end(), axis.data(), axis.data() + 3);
  }
  const std::size_t n = names.size();
  file_.createGroup("joints");
  file_.write("joints/name", names);
  file_.write("joints/type", types);
  file_.write("joints/child", {n}, children.data());
  file_.write("joints/parent", {n}, parents.data()); // -1: the world, or a body that no step moves
  file_.write("joints/point", {n, 3}, points.data(), "m");
  file_.write("joints/axis", {n, 3}, axes.data(), "1");
}

void TrajectoryWriter::writeTendons() {
  if (scene_.tendons.empty()) return;
  std::vector<std::string> names, actuators;
  std::vector<int> first{0}, segments;
  for (const Tendon &t : scene_.tendons) {
    names.push_back(t.name);
    actuators.emplace_back(nameOf(t.actuator.kind));
    int at = first.back();
    for (int k = 0; k < int(t.points.size()); ++k) {
      int next = at + 1;
      for (const Tendon::Segment &s : t.segments) {
        if (s.from != k) continue;
        next += s.wrap < 0 ? 0 : Tendon::drawn_points;
        for (int p = at; p < next; ++p) segments.insert(segments.end(), {p, p + 1});
      }
      at = next;
    }
    first.push_back(at);
  }
  file_.createGroup("tendons");
  file_.write("tendons/name", names);
  file_.write("tendons/actuator", actuators);
  file_.write("tendons/first_point", {first.size()}, first.data()); // of the rows of state/tendon_position, and the end
  tendon_segments_ = int(segments.size() / 2);
  if (tendon_segments_ > 0) file_.write("tendons/segments", {segments.size() / 2, 2}, segments.data());
}

void TrajectoryWriter::writeMaterials() {
  file_.createGroup("material");
  auto write = [&](const char *name, const char *unit, auto get) {
    std::vector<double> values;
    for (const Rod &rod : scene_.rods) values.push_back(get(rod.material));
    file_.write(std::string("material/") + name, {rods_}, values.data(), unit);
  };
  write("linear_density", "kg/m", [](const Material &m) { return m.linear_density; });
  write("linear_rotational_inertia", "kg m", [](const Material &m) { return m.linear_rotational_inertia; });
  write("axial_stiffness", "N", [](const Material &m) { return m.axial_stiffness; });
  write("torsional_stiffness", "N m^2", [](const Material &m) { return m.torsional_stiffness; });
  write("mass_damping_coefficient", "1/s", [](const Material &m) { return m.mass_damping_coefficient; });
  write("stiffness_damping_coefficient", "s", [](const Material &m) { return m.stiffness_damping_coefficient; });
  std::vector<double> flexural;
  for (const Rod &rod : scene_.rods)
    flexural.insert(flexural.end(), rod.material.flexural_stiffness.begin(), rod.material.flexural_stiffness.end());
  file_.write("material/flexural_stiffness", {rods_, 2}, flexural.data(), "N m^2");
}

} // namespace tendril
