#include "tendril/model/elements.hpp"

namespace tendril {
namespace {

/// Strains (integrated) that belong to a curvature and twist [1/m] over a cell of length `length`, in the rod's measure.
std::array<double, 3> integratedStrain(const Vec3 &strain, double length, Measure measure) {
  const double bend = std::hypot(strain[0], strain[1]) * length, twist = strain[2] * length;
  const double factor = measure == Measure::tan && bend > 0 ? 2 * std::tan(bend / 2) / bend : 1;
  return {strain[0] * length * factor, strain[1] * length * factor, measure == Measure::tan ? 2 * std::tan(twist / 2) : twist};
}

/// Appends the cells of one rod.
class CellBuilder {
public:
  CellBuilder(const Scene &scene, const DofMap &dofs, int rod, Elements &out)
      : rod_(scene.rods[rod]), range_(dofs.rods()[rod]), out_(out), clamp_(rod_.vertices(), -1), twist_(rod_.vertices(), -1) {
    for (std::size_t s = 0; s < scene.supports.size(); ++s) {
      const Support &support = scene.supports[s];
      if (support.rod != rod) continue;
      frame_of_support_.push_back(support.frame);
      support_.push_back(int(s));
      if (support.kind == Support::Kind::clamp) clamp_[support.vertex] = int(support_.size()) - 1;
      if (support.kind == Support::Kind::fix_twist) twist_[support.vertex] = int(support_.size()) - 1;
    }
  }

  void build() {
    for (int v = 0; v < rod_.vertices(); ++v) {
      const int before = rod_.edgeBefore(v), after = rod_.edgeAfter(v);
      const int s = clamp_[v] >= 0 ? clamp_[v] : twist_[v];
      const bool through = before >= 0 && after >= 0;
      if (through && clamp_[v] < 0) addCell(v, before, after, s >= 0 ? 0.0 : rod_.material.torsional_stiffness);
      if (s >= 0 && before >= 0) addHalfCell(v, before, s, true);
      if (s >= 0 && after >= 0) addHalfCell(v, after, s, false);
    }
  }

private:
  const Rod &rod_;
  const RodRange &range_;
  Elements &out_;
  std::vector<int> clamp_, twist_; ///< support of this rod at each vertex
  std::vector<Frame> frame_of_support_;
  std::vector<int> support_;

  /// Row of x_{i-1} of the cell at vertex v. The cell at vertex 0 of a closed rod lies at the copies behind the last vertex.
  int rowOf(int vertex) const {
    const int v = rod_.closed && vertex == 0 ? rod_.vertices() : vertex;
    return range_.first_row + range_.stride * (v - 1);
  }

  void addCell(int vertex, int before, int after, double torsional_stiffness) {
    const Frame f0 = referenceFrame(rod_, before), f1 = referenceFrame(rod_, after);
    const double length = 0.5 * (f0.length + f1.length);
    add(vertex, range_.first_edge + before, range_.first_edge + after, f0, f1, length, {0.5, 0.5}, {1, 1}, rod_.material.flexural_stiffness,
        torsional_stiffness);
  }

  /// The half cell between an edge and the frame that holds its end (numbers of the plan: Lbar = L/2, lbar = l/2).
  void addHalfCell(int vertex, int edge, int support, bool edge_first) {
    const Frame held = frame_of_support_[support], f = referenceFrame(rod_, edge);
    const int frame = out_.support_frame[support_[support]], own = range_.first_edge + edge;
    const bool clamp = clamp_[vertex] == support;
    const std::array<double, 2> flexural = clamp ? rod_.material.flexural_stiffness : std::array<double, 2>{0, 0};
    if (edge_first)
      add(vertex, own, frame, f, held, 0.5 * f.length, {0.5, 0}, {1, 0}, flexural, rod_.material.torsional_stiffness);
    else
      add(vertex, frame, own, held, f, 0.5 * f.length, {0, 0.5}, {0, 1}, flexural, rod_.material.torsional_stiffness);
  }

  void add(int vertex, int frame0, int frame1, const Frame &f0, const Frame &f1, double length, std::array<double, 2> weight, std::array<double, 2> free,
           std::array<double, 2> flexural, double torsional) {
    CellOf<double> cell{};
    cell.weight = {weight[0] / length, weight[1] / length};
    cell.free = free;
    cell.sign = 1;
    std::array<double, 3> rest;
    if (rod_.natural == Rod::Natural::given)
      rest = integratedStrain(rod_.natural_strain, length, rod_.measure);
    else
      rest = rod_.measure == Measure::tan ? cellStrain<Measure::tan>(f0, f1, cell) : cellStrain<Measure::angle>(f0, f1, cell);
    CellArrays &c = out_.cells;
    c.frame0.push_back(frame0);
    c.frame1.push_back(frame1);
    c.row.push_back(rowOf(vertex));
    c.length.push_back(length);
    for (int k = 0; k < 3; ++k) {
      c.stiffness[k].push_back((k < 2 ? flexural[k] : torsional) / length);
      c.rest[k].push_back(rest[k]);
    }
    for (int k = 0; k < 2; ++k) {
      c.weight[k].push_back(cell.weight[k]);
      c.free[k].push_back(free[k]);
    }
  }
};

} // namespace

void CellArrays::pad() {
  if (frame0.empty()) return;
  const std::size_t n = frame0.size() + Pack::size();
  auto repeat = [n](auto &v) { v.resize(n, v.back()); };
  repeat(frame0), repeat(frame1), repeat(row);
  for (auto &v : stiffness) repeat(v);
  for (auto &v : rest) repeat(v);
  for (auto &v : weight) repeat(v);
  for (auto &v : free) repeat(v);
}

Elements::Elements(const Scene &scene, const DofMap &dofs) : rods(dofs.rods()), mass(dofs.vertices(), 0.0), frames(dofs.edges()) {
  for (const Support &s : scene.supports) support_frame.push_back(s.holdsTwist() && !scene.rods[s.rod].material.isCable() ? frames++ : -1);
  rod_cells.push_back(0);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    const RodRange &range = rods[r];
    measure.push_back(rod.measure);
    for (int v = 0; v < range.vertices; ++v) vertex_row.push_back(dofs.vertexRow(range, v));
    for (int i = 0; i < range.edges; ++i) {
      const double length = rod.edge(i).norm();
      vertex0.push_back(range.first_vertex + i);
      vertex1.push_back(range.first_vertex + rod.next(i));
      edge_row.push_back(dofs.vertexRow(range, i));
      rest_length.push_back(length);
      inverse_rest_length.push_back(1 / length);
      axial_stiffness.push_back(rod.material.axial_stiffness);
      twist_mass.push_back(rod.material.linear_rotational_inertia * length);
      mass[vertex0.back()] += 0.5 * rod.material.linear_density * length;
      mass[vertex1.back()] += 0.5 * rod.material.linear_density * length;
    }
    if (!rod.material.isCable()) CellBuilder(scene, dofs, int(r), *this).build();
    rod_cells.push_back(cells.size());
  }
  cells.pad();
}

} // namespace tendril
