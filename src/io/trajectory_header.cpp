/// What a trajectory says once: topology, materials, supports, where the run came from.
#include "tendril/io/trajectory.hpp"

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
  writeSupports();
  writeConstraints();
  writeColliders();
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

/// Radii, then half lengths.
static std::vector<double> parametersOf(const Collider &c) {
  if (c.kind == "sphere") return {c.size[0]};
  if (c.kind == "capsule" || c.kind == "cylinder") return {c.size[0], 0.5 * c.size[1]};
  if (c.kind == "box") return {0.5 * c.size[0], 0.5 * c.size[1], 0.5 * c.size[2]};
  if (c.kind == "tube") return {c.size[0], c.size[1], 0.5 * c.size[2]};
  return {}; // of a plane: z is its normal
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
    const std::vector<double> p = parametersOf(c);
    for (std::size_t k = 0; k < 3; ++k) parameters.push_back(k < p.size() ? p[k] : std::nan(""));
    positions.insert(positions.end(), c.position.data(), c.position.data() + 3);
    rotations.insert(rotations.end(), {q.w(), q.x(), q.y(), q.z()});
  }
  file_.createGroup("colliders");
  file_.createGroup("colliders/meshes");
  for (std::size_t k = 0; k < n; ++k) {
    if (!scene_.colliders[k].mesh) continue;
    const TriangleMesh &mesh = *scene_.colliders[k].mesh;
    const std::string group = "colliders/meshes/" + std::to_string(k);
    file_.createGroup(group);
    file_.write(group + "/vertices", {mesh.vertices.size(), 3}, mesh.vertices[0].data(), "m");
    file_.write(group + "/triangles", {mesh.triangles.size(), 3}, mesh.triangles[0].data());
  }
  file_.write("colliders/name", names);
  file_.write("colliders/shape", shapes);
  file_.write("colliders/parameters", {n, 3}, parameters.data(), "m");
  file_.write("colliders/position", {n, 3}, positions.data(), "m");
  file_.write("colliders/rotation", {n, 4}, rotations.data(), "1");
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
