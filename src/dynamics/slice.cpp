#include "tendril/dynamics/slice.hpp"

#include "tendril/energy/work.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {

Slice::Slice(const Scene &whole, const Partition &partition, const Team &team, bool apart) : team_(team) {
  if (team.isAlone() && partition.isOrdered() && !apart) return;
  parts_.resize(team.size());
  std::vector<int> rank_of(whole.rods.size());
  for (int rank = 0; rank < team.size(); ++rank) {
    parts_[rank].rods = partition.rodsOf(rank);
    for (const int r : parts_[rank].rods) rank_of[r] = rank;
  }
  for (const Junction &j : whole.junctions)
    for (int k = 0; k < j.groups; ++k) parts_[rank_of[j.members.front().rod]].groups.push_back(groups_++);
  for (const Body &b : whole.bodies) {
    parts_[rank_of[b.rod]].bodies.push_back(bodies_++);
    parts_[rank_of[b.rod]].groups.push_back(groups_++);
  }
  for (const Joint &j : whole.joints) parts_[rank_of[j.rod]].joints.push_back(joints_++);
  for (const Tendon &t : whole.tendons)
    for (int k = 0; k < t.remembered(); ++k) parts_[rank_of[t.rod]].sticks.push_back(sticks_++);
  for (const Holder &h : movingHolders(whole)) parts_[rank_of[h.rod]].holders.push_back(holders_++);
  std::vector<std::vector<int>> of_rod(whole.rods.size());
  for (const Holder &h : movingObstacles(whole)) of_rod[h.rod].push_back(holders_++);
  for (Part &part : parts_)
    for (const int r : part.rods) part.holders.insert(part.holders.end(), of_rod[r].begin(), of_rod[r].end());
}

Scene Slice::sceneOf(const Scene &whole) const {
  Scene own = withRods(whole, parts_[team_.rank()].rods);
  own.whole = {whole.strainsDissipate(), whole.slides(),        whole.hasCouples(),
               whole.touchesRods(),      whole.touchesBodies(), whole.slidesAmongMoving(),
               whole.tendonsRub(),       whole.edges()};
  return own;
}

/// Arrays of a state, to the leading rank or from it.
class Slice::Transfer {
public:
  Transfer(const Slice &slice, bool collects, const Elements *whole)
      : slice_(slice), team_(slice.team_), collects_(collects), whole_(team_.leads() ? whole : nullptr) {}

  /// First and number of what a rod, a group or a holder of the scene has in an array.
  using Range = std::function<std::pair<int, int>(int)>;
  Range vertices() const {
    return [this](int r) { return std::pair(whole_->rods[r].first_vertex, whole_->rods[r].vertices); };
  }
  Range edges() const {
    return [this](int r) { return std::pair(whole_->rods[r].first_edge, whole_->rods[r].edges); };
  }
  Range cells() const {
    return [this](int r) { return std::pair(whole_->rod_cells[r], whole_->rod_cells[r + 1] - whole_->rod_cells[r]); };
  }
  Range slots() const {
    return [this](int r) { return std::pair(whole_->rods[r].first_slot, whole_->rods[r].slots); };
  }
  static std::pair<int, int> one(int k) { return {k, 1}; }
  static std::pair<int, int> two(int k) { return {2 * k, 2}; }

  /// `sets` arrays one behind the other, in `mine` of this rank's items and in `all` of all, of which each has `count`.
  template <class T>
  void move(std::vector<T> &mine, std::vector<T> *all, std::vector<int> Part::*items, const Range &range,
            std::size_t count, std::size_t sets = 1) const {
    constexpr std::size_t width = sizeof(T) / sizeof(double);
    std::vector<int> counts;
    if (team_.leads()) {
      if (collects_) all->resize(sets * count);
      for (const Part &part : slice_.parts_) {
        std::size_t of_rank = 0;
        for (const int k : part.*items) of_rank += std::size_t(range(k).second);
        counts.push_back(int(sets * of_rank * width));
      }
    }
    auto *own = reinterpret_cast<double *>(mine.data());
    std::vector<double> packed;
    if (collects_) packed = team_.gather({own, mine.size() * width}, counts);
    if (team_.leads()) {
      auto *values = reinterpret_cast<double *>(all->data());
      packed.resize(std::size_t(std::accumulate(counts.begin(), counts.end(), std::int64_t(0))));
      double *next = packed.data();
      for (const Part &part : slice_.parts_)
        for (std::size_t set = 0; set < sets; ++set)
          for (const int k : part.*items) {
            const auto [begin, number] = range(k);
            double *const here = values + (set * count + std::size_t(begin)) * width;
            const std::size_t n = std::size_t(number) * width;
            if (collects_)
              std::copy_n(next, n, here);
            else
              std::copy_n(here, n, next);
            next += n;
          }
    }
    if (!collects_) team_.scatter(packed, counts, {own, mine.size() * width});
  }

  /// All of a state, both ways; sizes of arrays that depend on more than the elements are those of `mine` already.
  void moveAll(const Elements &own, State &mine, State *all) const {
    auto of = [&](auto State::*array) { return all ? &(all->*array) : nullptr; };
    const std::size_t nv = whole_ ? std::size_t(whole_->vertices()) : 0, ne = whole_ ? std::size_t(whole_->edges()) : 0,
                      rods = whole_ ? whole_->rods.size() : 0;
    for (auto array : {&State::position, &State::position_low, &State::velocity})
      move(mine.*array, of(array), &Part::rods, vertices(), nv);
    move(mine.director, of(&State::director), &Part::rods, edges(), ne);
    for (auto array : {&State::twist_rate, &State::axial_force}) move(mine.*array, of(array), &Part::rods, edges(), ne);
    move(mine.winding, of(&State::winding), &Part::rods, cells(), whole_ ? whole_->cell_slot.size() : 0);
    if (all && collects_) all->memory.resize(mine.memory.size());
    for (std::size_t n = 0; n < mine.memory.size(); ++n) {
      move(mine.memory[n].vertex, all ? &all->memory[n].vertex : nullptr, &Part::rods, vertices(), nv);
      move(mine.memory[n].edge, all ? &all->memory[n].edge : nullptr, &Part::rods, edges(), ne);
      move(mine.memory[n].body, all ? &all->memory[n].body : nullptr, &Part::bodies, one, std::size_t(slice_.bodies_));
    }
    for (auto array : {&State::body_position, &State::body_position_low})
      move(mine.*array, of(array), &Part::bodies, one, std::size_t(slice_.bodies_));
    move(mine.body_rate, of(&State::body_rate), &Part::bodies, one, std::size_t(slice_.bodies_));
    move(mine.joints, of(&State::joints), &Part::joints, one, std::size_t(slice_.joints_));
    move(mine.tendon_memory, of(&State::tendon_memory), &Part::sticks, one, std::size_t(slice_.sticks_));
    moveStrains(own, mine, all);
    moveActions(mine, all);
    for (auto array : {&State::contact_stiffness, &State::rod_contact_stiffness})
      if (!(mine.*array).empty())
        move(mine.*array, of(array), &Part::rods, one, rods);
      else if (all && collects_)
        (all->*array).clear();
    if (!mine.contacts.empty())
      moveContacts(mine, all, rods);
    else if (all && collects_)
      all->contacts.clear();
    if (!mine.pairs.empty())
      movePairs(mine, all, rods);
    else if (all && collects_)
      all->pairs.clear();
    move(mine.junction_axes, of(&State::junction_axes), &Part::groups, one, std::size_t(slice_.groups_));
  }

private:
  const Slice &slice_;
  const Team &team_;
  bool collects_;
  const Elements *whole_; ///< null but on the leading rank

  /// Rows over slots, with room before the first rod and behind the last.
  void moveStrains(const Elements &own, State &mine, State *all) const {
    const std::size_t row = strainRow(own), rows = mine.strains.size() / row,
                      used = std::size_t(own.slots - own.rods.front().first_slot);
    std::vector<double> packed;
    for (std::size_t k = 0; k < rows; ++k) {
      const auto begin = mine.strains.begin() + std::ptrdiff_t(k * row + std::size_t(own.rods.front().first_slot));
      packed.insert(packed.end(), begin, begin + std::ptrdiff_t(used));
    }
    std::vector<double> none;
    move(packed, all ? &all->strains : &none, &Part::rods, slots(), whole_ ? strainRow(*whole_) : 0, rows);
    for (std::size_t k = 0; k < rows && !collects_; ++k)
      std::copy_n(packed.begin() + std::ptrdiff_t(k * used), used,
                  mine.strains.begin() + std::ptrdiff_t(k * row + std::size_t(own.rods.front().first_slot)));
  }

  /// Ranks without holders that move know nothing of how often actions are remembered.
  void moveActions(State &mine, State *all) const {
    const std::size_t own = 2 * slice_.parts_[team_.rank()].holders.size();
    double sets = own > 0 ? double(mine.support_actions.size() / own) : 0;
    Tally tally;
    team_.combine(tally.largest(sets));
    move(mine.support_actions, all ? &all->support_actions : nullptr, &Part::holders, two,
         2 * std::size_t(slice_.holders_), std::size_t(sets));
  }

  /// First how many rows each rod has, then the rows.
  template <std::size_t width, class Memory, class Flatten, class Unfold>
  void moveRows(std::vector<std::vector<Memory>> &mine, std::vector<std::vector<Memory>> *all, std::size_t rods,
                Flatten flatten, Unfold unfold) const {
    using Row = std::array<double, width>;
    std::vector<double> counts, all_counts;
    std::vector<Row> rows, all_rows;
    auto flattenAll = [&](const std::vector<std::vector<Memory>> &from, std::vector<double> &n, std::vector<Row> &out) {
      for (const auto &of_rod : from) {
        n.push_back(double(of_rod.size()));
        for (const Memory &m : of_rod) out.push_back(flatten(m));
      }
    };
    auto unfoldAll = [&](const std::vector<double> &n, const std::vector<Row> &from,
                         std::vector<std::vector<Memory>> &to) {
      to.assign(n.size(), {});
      std::size_t next = 0;
      for (std::size_t r = 0; r < n.size(); ++r)
        for (double k = 0; k < n[r]; ++k) to[r].push_back(unfold(from[next++]));
    };
    if (collects_)
      flattenAll(mine, counts, rows);
    else
      counts.resize(mine.size());
    if (!collects_ && all) flattenAll(*all, all_counts, all_rows);
    move(counts, &all_counts, &Part::rods, one, rods);
    std::vector<int> begin{0};
    for (const double n : all_counts) begin.push_back(begin.back() + int(n));
    if (!collects_) rows.resize(std::size_t(std::accumulate(counts.begin(), counts.end(), 0.0)));
    move(
        rows, &all_rows, &Part::rods, [&](int r) { return std::pair(begin[r], int(all_counts[r])); },
        std::size_t(begin.back()));
    if (collects_ && all)
      unfoldAll(all_counts, all_rows, *all);
    else if (!collects_)
      unfoldAll(counts, rows, mine);
  }

  void moveContacts(State &mine, State *all, std::size_t rods) const {
    auto flatten = [](const ContactMemory &m) {
      return std::array<double, 9>{double(m.edge), double(m.point), double(m.collider), m.stick[0],   m.stick[1],
                                   m.stick[2],     m.friction[0],   m.friction[1],      m.friction[2]};
    };
    auto unfold = [](const std::array<double, 9> &m) {
      return ContactMemory{int(m[0]), int(m[1]), int(m[2]), {m[3], m[4], m[5]}, {m[6], m[7], m[8]}};
    };
    moveRows<9>(mine.contacts, all ? &all->contacts : nullptr, rods, flatten, unfold);
  }

  /// Pairs name rods and bodies by the numbers of the scene on the way; on a rank those that it does not have come
  /// behind its own.
  void movePairs(State &mine, State *all, std::size_t rods) const {
    const Part &part = slice_.parts_[team_.rank()];
    auto rename = [&](PairMemory &m, auto numberIn) {
      m.to_rod = numberIn(part.rods, m.to_rod);
      for (int *edge : {&m.edge, &m.to_edge})
        if (*edge < 0) *edge = TouchingPair::ofBody(numberIn(part.bodies, -1 - *edge));
    };
    auto whole = [](const std::vector<int> &items, int k) {
      const int count = int(items.size());
      return k < count ? items[std::size_t(k)] : k - count;
    };
    auto own = [](const std::vector<int> &items, int k) {
      const auto found = std::find(items.begin(), items.end(), k);
      return int(found - items.begin()) + (found == items.end() ? k : 0);
    };
    auto flatten = [](const PairMemory &m) { return m.numbers(); };
    auto unfold = [](const std::array<double, PairMemory::width> &m) { return PairMemory::of(m.data()); };
    for (auto &of_rod : mine.pairs)
      for (PairMemory &m : of_rod)
        if (collects_) rename(m, whole);
    moveRows<PairMemory::width>(mine.pairs, all ? &all->pairs : nullptr, rods, flatten, unfold);
    for (auto &of_rod : mine.pairs)
      for (PairMemory &m : of_rod)
        if (!collects_) rename(m, own);
  }
};

void Slice::collect(const Elements &own, const State &part, const Elements *whole, State *state) const {
  State mine = part;
  State *const all = team_.leads() ? state : nullptr;
  Transfer(*this, true, whole).moveAll(own, mine, all);
  if (!all) return;
  all->time = part.time;
  all->step = part.step;
  all->last_dt = part.last_dt;
  all->dt_before = part.dt_before;
}

void Slice::spread(const Elements &own, State *part, const Elements *whole, const State *state) const {
  State copy;
  State *const all = team_.leads() ? &copy : nullptr;
  double facts[11] = {};
  if (all) {
    copy = *state;
    const std::size_t action = 2 * std::size_t(holders_);
    const double here[] = {copy.time,
                           double(copy.step),
                           copy.last_dt,
                           copy.dt_before,
                           double(copy.memory.size()),
                           double(copy.strains.size() / strainRow(*whole)),
                           double(action > 0 ? copy.support_actions.size() / action : 0),
                           double(!copy.contact_stiffness.empty()),
                           double(!copy.contacts.empty()),
                           double(!copy.rod_contact_stiffness.empty()),
                           double(!copy.pairs.empty())};
    std::copy(std::begin(here), std::end(here), facts);
  }
  team_.share(facts);
  part->time = facts[0];
  part->step = std::int64_t(facts[1]);
  part->last_dt = facts[2];
  part->dt_before = facts[3];
  const std::size_t nv = part->position.size(), ne = part->director.size(), rods = own.rods.size();
  part->memory.assign(std::size_t(facts[4]), {std::vector<Vec3>(nv, Vec3::Zero()), std::vector<double>(ne, 0.0),
                                              std::vector<BodyRate>(part->body_rate.size())});
  part->strains.assign(std::size_t(facts[5]) * strainRow(own), 0.0);
  part->support_actions.assign(std::size_t(facts[6]) * 2 * parts_[team_.rank()].holders.size(), Vec3::Zero());
  part->contact_stiffness.assign(facts[7] != 0 ? rods : 0, 0.0);
  part->contacts.assign(facts[8] != 0 ? rods : 0, {});
  part->rod_contact_stiffness.assign(facts[9] != 0 ? rods : 0, 0.0);
  part->pairs.assign(facts[10] != 0 ? rods : 0, {});
  Transfer(*this, false, whole).moveAll(own, *part, all);
}

} // namespace tendril
