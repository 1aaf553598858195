#include "tendril/layout/elements.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Strains (integrated) that belong to a curvature and twist [1/m] over a cell of length `length`, in the rod's
/// measure.
std::array<double, 3> integratedStrain(const Vec3 &strain, double length, Measure measure) {
  const double bend = std::hypot(strain[0], strain[1]) * length, twist = strain[2] * length;
  const double factor = measure == Measure::tan && bend > 0 ? 2 * std::tan(bend / 2) / bend : 1;
  return {strain[0] * length * factor, strain[1] * length * factor,
          measure == Measure::tan ? 2 * std::tan(twist / 2) : twist};
}

} // namespace

/// Makes the cells of one rod.
class CellBuilder {
public:
  CellBuilder(const Scene &scene, int rod, Elements &out)
      : scene_(scene), rod_(scene.rods[rod]), range_(out.rods[rod]), loose_(out.loose[rod]), next_(range_.looseSlot()),
        out_(out), joined_(out.joinedEdges({rod, rod + 1})), holder_(rod_.vertices(), nullptr) {
    for (const int s : out.supportsOf(rod)) {
      const Support &support = scene.supports[s];
      if (!support.holdsTwist()) continue;
      const Support *&holder = holder_[support.vertex];
      if (holder && holder->kind == Support::Kind::clamp) continue; // a clamp holds the twist as well
      if (holder) out.support_slot[holder - scene.supports.data()] = -1;
      holder = &support;
      out.support_slot[s] = frameSlot(support.vertex);
    }
    supports_ = scene.supports.data();
  }

  void build() {
    out_.cell_begin.push_back(range_.slot(rod_.closed || !holder_[0] ? 1 : 0));
    out_.cell_end.push_back(range_.slot(rod_.closed || holder_.back() ? rod_.edges() + 1 : rod_.edges()));
    for (int v = 0; v < rod_.vertices(); ++v) {
      const int before = rod_.edgeBefore(v), after = rod_.edgeAfter(v);
      const Support *holder = holder_[v];
      const bool clamp = holder && holder->kind == Support::Kind::clamp;
      if (isJoined(v)) { // no support turns a frame there
        for (const JoinedEdge &j : joined_)
          if (j.vertex == v) addJoinedCell(j);
        continue;
      }
      if (before >= 0 && after >= 0 && !clamp) {
        const Frame f0 = referenceFrame(rod_, before), f1 = referenceFrame(rod_, after);
        add(place(v), f0, f1, 0.5 * (f0.length + f1.length), {0.5, 0.5}, {1, 1}, rod_.material.flexural_stiffness,
            holder ? 0.0 : rod_.material.torsional_stiffness);
      }
      if (holder && before >= 0) addHalfCell(v, before, *holder, true);
      if (holder && after >= 0) addHalfCell(v, after, *holder, false);
    }
  }

  /// Behind the slots of supports along the rod.
  int freeSlot() const { return next_; }

  /// Couples on the end edges of ends that are free to turn.
  void addEndCouples(const Scene &scene, int rod) {
    for (const bool last : {false, true}) {
      const int v = last ? rod_.edges() : 0, edge = last ? rod_.edges() - 1 : 0;
      if (rod_.closed || holder_[v] || isJoined(v)) continue;
      const int cell = range_.slot(last ? edge : 1);
      EndCouple end{last, range_.slot(edge), rod_.energy == Energy::seed, {}, {}, Vec3::Zero(), 0};
      for (const int k : out_.momentsOf(rod)) {
        const EdgeMoment &m = scene.moments[k];
        if (m.edge != edge) continue;
        end.moment += m.moment;
        end.torque += m.torque;
      }
      if (end.moment.isZero(0) && end.torque == 0) continue;
      const double half = 0.5 * rod_.edge(edge).norm();
      const auto [k1, k2] = rod_.material.flexural_stiffness;
      const std::array<double, 3> stiffness{k1, k2, rod_.material.torsional_stiffness};
      for (int a = 0; a < 3; ++a) end.compliance[a] = stiffness[a] > 0 ? half / stiffness[a] : 0;
      if (const double length = out_.constants_[6][cell]; length != 0)
        for (int a = 0; a < 2; ++a) end.rest[a] = (last ? half : -half) * out_.cells()[cell_rest + a][cell] / length;
      out_.end_couples[rod].push_back(end);
    }
  }

private:
  const Scene &scene_;
  const Rod &rod_;
  const RodRange &range_;
  std::vector<LooseCell> &loose_;
  int next_; ///< slot of a frame or cell along the rod
  Elements &out_;
  std::span<const JoinedEdge> joined_;
  std::vector<const Support *> holder_; ///< of the twist at each vertex
  const Support *supports_;

  bool isJoined(int v) const {
    return std::any_of(joined_.begin(), joined_.end(), [=](const JoinedEdge &j) { return j.vertex == v; });
  }

  bool isEnd(int v) const { return !rod_.closed && (v == 0 || v + 1 == rod_.vertices()); }
  /// Slot of a vertex as cells see it: the first vertex of a ring lies behind its last.
  int place(int v) const { return range_.slot(rod_.closed && v == 0 ? rod_.vertices() : v); }
  /// A support's frame takes the place of the edge that is missing at an end; along a rod it gets a slot of its own.
  int frameSlot(int v) {
    if (isEnd(v)) return range_.slot(v == 0 ? -1 : v);
    return next_++;
  }

  /// The half cell between an edge and the frame that holds its end: Lbar = L/2, lbar = l/2.
  void addHalfCell(int v, int edge, const Support &holder, bool edge_first) {
    const Frame &held = holder.frame, f = referenceFrame(rod_, edge);
    const std::array<double, 2> flexural =
        holder.kind == Support::Kind::clamp ? rod_.material.flexural_stiffness : std::array<double, 2>{0, 0};
    int slot = range_.slot(v);
    if (!isEnd(v)) {
      slot = next_++;
      const int frame = out_.support_slot[&holder - supports_], middle = place(v);
      loose_.push_back(edge_first ? LooseCell{slot, middle - 1, frame, middle}
                                  : LooseCell{slot, frame, middle, middle});
    }
    if (edge_first)
      add(slot, f, held, 0.5 * f.length, {0.5, 0}, {1, 0}, flexural, rod_.material.torsional_stiffness);
    else
      add(slot, held, f, 0.5 * f.length, {0, 0.5}, {0, 1}, flexural, rod_.material.torsional_stiffness);
  }

  /// Between an edge and the frame of a junction. A rod that is stress-free as drawn is so at any angle; one of given
  /// natural strains turns at its vertices along the rod, too.
  void addJoinedCell(const JoinedEdge &j) {
    const Frame f = referenceFrame(rod_, j.edge);
    Frame at = rod_.natural == Rod::Natural::as_drawn || isEnd(j.vertex) ? f : frameAtVertex(rod_, j.vertex);
    if (j.of_body && isEnd(j.vertex))
      for (const JoinedVertex &v : out_.joinedVertices({j.rod, j.rod + 1}))
        if (v.vertex == j.vertex) at = scene_.attachments[v.attachment].frame;
    const Frame drawn{at.tangent, orthonormalised(at.director, at.tangent), 1};
    out_.joined_frame_[&j - out_.joined_edges_.items.data()] = drawn;
    const int edge = range_.slot(j.edge), middle = place(j.vertex);
    loose_.push_back(j.ends ? LooseCell{j.cell, edge, j.frame, middle, 1}
                            : LooseCell{j.cell, j.frame, edge, middle, 0});
    const auto &[flexural, torsional] = std::pair(rod_.material.flexural_stiffness, rod_.material.torsional_stiffness);
    if (j.ends)
      add(j.cell, f, drawn, 0.5 * f.length, {0.5, 0}, {1, 0}, flexural, torsional);
    else
      add(j.cell, drawn, f, 0.5 * f.length, {0, 0.5}, {0, 1}, flexural, torsional);
  }

  void add(int slot, const Frame &f0, const Frame &f1, double length, std::array<double, 2> weight,
           std::array<double, 2> free, std::array<double, 2> flexural, double torsional) {
    CellOf<double> cell{};
    if (rod_.energy == Energy::seed)
      cell.weight = {weight[0] / length, weight[1] / length};
    else
      cell.base = 1;
    cell.free = free;
    cell.sign = 1;
    std::array<double, 3> rest;
    if (rod_.natural == Rod::Natural::given)
      rest = integratedStrain(rod_.natural_strain, length, rod_.measure);
    else
      rest = rod_.measure == Measure::tan ? cellStrain<Measure::tan>(f0, f1, cell)
                                          : cellStrain<Measure::angle>(f0, f1, cell);
    out_.cell_slot.push_back(slot);
    out_.constants_[6][slot] = length;
    for (int k = 0; k < 3; ++k) {
      out_.cells_[cell_stiffness + k][slot] = (k < 2 ? flexural[k] : torsional) / length;
      out_.cells_[cell_rest + k][slot] = rest[k];
    }
    for (int k = 0; k < 2; ++k) {
      out_.cells_[cell_weight + k][slot] = cell.weight[k];
      out_.cells_[cell_free + k][slot] = free[k];
    }
    out_.cells_[cell_base][slot] = cell.base;
  }
};

Elements::Elements(const Scene &scene, const DofMap &dofs)
    : rods(dofs.rods()), slots(dofs.slots()), loose(rods.size()), end_couples(rods.size()),
      support_slot(scene.supports.size(), -1), tendon_slot(dofs.tendonSlots()), rod_cells{0}, groups(dofs.groups()),
      supports_(scene.supports, rods.size()), forces_(scene.forces, rods.size()), moments_(scene.moments, rods.size()),
      tendons_(scene.tendons, rods.size()), joined_edges_(dofs.joinedEdges()), joined_vertices_(dofs.joinedVertices()),
      ties_(dofs.ties()), bodies_(dofs.bodies()), pairs_(dofs.pairs()), place_of_joint_(scene.joints.size()),
      place_of_contact_(scene.bodies.size(), -1) {
  std::vector<int> free_slots; ///< per rod, behind those of its supports
  for (const Tendon &t : scene.tendons) tendon_slots_.push_back(t.slots());
  constants_ = Planes(7, slots);
  joined_frame_.resize(joined_edges_.items.size());
  cells_ = Planes(cell_planes, slots);
  for (const int plane : {1, 2}) std::fill_n(constants_[plane], slots, 1.0);
  double *mass = constants_[0];
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    const RodRange &range = rods[r];
    measure.push_back(rod.measure);
    energy.push_back(rod.energy);
    for (int v = 0; v < range.vertices; ++v) {
      vertex_slot.push_back(range.slot(v));
      constants_[5][range.slot(v)] = dofs.isHeld(range.first_vertex + v) ? 0 : 1;
    }
    length_.push_back(rod.length());
    for (int i = 0; i < range.edges; ++i) {
      const double length = rod.edge(i).norm();
      const int slot = range.slot(i);
      vertex0.push_back(range.first_vertex + i);
      vertex1.push_back(range.first_vertex + rod.next(i));
      edge_slot.push_back(slot);
      constants_[1][slot] = length;
      constants_[2][slot] = 1 / length;
      constants_[3][slot] = rod.material.axial_stiffness;
      constants_[4][slot] = range.twist ? rod.material.linear_rotational_inertia * length : 0;
      mass[slot] += 0.5 * rod.material.linear_density * length;
      mass[range.slot(rod.next(i))] += 0.5 * rod.material.linear_density * length;
    }
    for (const int k : forcesOf(int(r))) mass[range.slot(scene.forces[k].vertex)] += scene.forces[k].mass;
    if (range.bends) {
      CellBuilder builder(scene, int(r), *this);
      builder.build();
      if (!scene.moments.empty()) builder.addEndCouples(scene, int(r));
      free_slots.push_back(builder.freeSlot());
    } else {
      free_slots.push_back(range.looseSlot());
      cell_begin.push_back(range.first_slot);
      cell_end.push_back(range.first_slot);
    }
    rod_cells.push_back(int(cell_slot.size()));
  }
  placeFollowers(scene);
  if (!scene.constraints.empty()) placeConstraints(scene, std::move(free_slots));
  weighBodies(scene);
}

void Elements::placeFollowers(const Scene &scene) {
  if (scene.followers.empty()) return;
  for (const FollowerForce &f : scene.followers) {
    const Rod &rod = scene.rods[f.rod];
    const int before = rod.edgeBefore(f.vertex), after = rod.edgeAfter(f.vertex);
    for (const int edge : {before, after})
      if (edge >= 0)
        followers_.items.push_back({f.rod, rods[f.rod].slot(f.vertex), rods[f.rod].slot(edge),
                                    (before >= 0 && after >= 0 ? 0.5 : 1) * f.force});
  }
  followers_.sort(scene.rods.size());
}

/// The mass of a vertex that is a point of a body is a part of the body.
void Elements::weighBodies(const Scene &scene) {
  place_of_body_.resize(scene.bodies.size());
  for (std::size_t k = 0; k < bodies_.items.size(); ++k) place_of_body_[bodies_.items[k].body] = int(k);
  for (const Body &body : scene.bodies) body_mass_.push_back(body.own);
  arm_.assign(joined_vertices_.items.size(), Vec3::Zero());
  for (const JoinedVertex &j : joined_vertices_.items) {
    if (!j.isOnBody() || !j.isVertex()) continue;
    double &mass = constants_[0][j.slot];
    body_mass_[j.body].add({mass, scene.rods[j.rod].position[j.vertex], Mat3::Zero()});
    mass = 0;
  }
  for (const JoinedVertex &j : joined_vertices_.items)
    if (j.isOnBody())
      arm_[j.number] = (j.isVertex() ? scene.rods[j.rod].position[j.vertex] : scene.constraints[j.attachment].point) -
                       body_mass_[j.body].centre;
  for (const MassProperties &all : body_mass_) {
    inverse_inertia_.push_back(all.inertia.ldlt().solve(Mat3::Identity()));
    body_size_.push_back(std::sqrt(all.inertia.trace() / all.mass));
  }
  auto reach = [&](int body, const Vec3 &arm) { body_size_[body] = std::max(body_size_[body], arm.norm()); };
  for (const JoinedVertex &j : joined_vertices_.items)
    if (j.isOnBody()) reach(j.body, arm_[j.number]);
  for (std::size_t k = 0; k < pairs_.items.size(); ++k) {
    if (pairs_.items[k].joint < 0) {
      place_of_contact_[pairs_.items[k].body] = int(k);
      continue;
    }
    const Joint &joint = scene.joints[pairs_.items[k].joint];
    place_of_joint_[pairs_.items[k].joint] = int(k);
    for (const int body : {joint.child, joint.parent})
      if (body >= 0) reach(body, joint.point - body_mass_[body].centre);
  }
}

/// Slots behind those of supports along a rod.
void Elements::placeConstraints(const Scene &scene, std::vector<int> free_slots) {
  constraints_.resize(rods.size());
  pins_.resize(rods.size());
  std::vector<int> to_bodies(rods.size(), 0); // rotations to bodies so far, in the order of their edges' ties
  for (std::size_t k = 0; k < scene.constraints.size(); ++k) {
    const Constraint &c = scene.constraints[k];
    constraints_[c.rod].push_back(int(k));
    if (c.isToBody() && !c.isPin()) {
      const auto edges = joinedEdges({c.rod, c.rod + 1});
      auto isNext = [n = to_bodies[c.rod]](const JoinedEdge &j) mutable { return j.vertex < 0 && n-- == 0; };
      ++to_bodies[c.rod];
      const JoinedEdge &j = *std::find_if(edges.begin(), edges.end(), isNext);
      constraint_slot.push_back(j.frame);
      joined_frame_[&j - joined_edges_.items.data()] = c.frame;
      continue;
    }
    if (!c.isToWorld()) {
      const auto tied = ties({c.rod, c.rod + 1});
      constraint_slot.push_back(
          std::find_if(tied.begin(), tied.end(), [&](const Tie &t) { return t.constraint == int(k); })->copy);
      continue;
    }
    constraint_slot.push_back(free_slots[c.rod]);
    free_slots[c.rod] += c.slots();
    if (!c.isPin()) continue;
    const int slot = rods[c.rod].slot(c.at);
    Pins &pins = pins_[c.rod];
    const auto place = std::lower_bound(pins.begin(), pins.end(), std::pair(slot, 0.0));
    if (place != pins.end() && place->first == slot)
      place->second += c.stiffness;
    else
      pins.insert(place, {slot, c.stiffness});
  }
}

std::vector<LooseCell> cellsOf(const Elements &elements, int rod) {
  std::vector<LooseCell> cells;
  auto loose = elements.loose[rod].begin(); // in scene order, too
  for (int n = elements.rod_cells[rod]; n < elements.rod_cells[rod + 1]; ++n) {
    const int slot = elements.cell_slot[n];
    const bool held = loose != elements.loose[rod].end() && loose->slot == slot;
    cells.push_back(held ? *loose++ : LooseCell{slot, slot - 1, slot, slot});
  }
  return cells;
}

std::vector<LooseCell> heldCells(const Elements &elements, int r, int frame) {
  const RodRange &rod = elements.rods[r];
  if (frame == rod.slot(-1)) return {{frame + 1, frame, frame + 1, frame + 1}};
  if (frame == rod.slot(rod.edges)) return {{frame, frame - 1, frame, frame}};
  std::vector<LooseCell> cells;
  for (const LooseCell &cell : elements.loose[r])
    if (cell.frame0 == frame || cell.frame1 == frame) cells.push_back(cell);
  return cells;
}

int edgeAt(const RodRange &rod, int slot) {
  const int i = slot - rod.first_slot;
  if (i >= 0 && i < rod.edges) return i;
  return rod.closed && i == rod.edges ? 0 : -1;
}

} // namespace tendril
