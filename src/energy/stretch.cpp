/// Stretching of the edges, docs/theory.md (2.1) and (2.2), with the axial force optionally an unknown of its own
/// (Hellinger-Reissner), condensed edge by edge (23.1).
#include "tendril/energy/edge.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class Stretch final : public Term {
public:
  Stretch(const Elements &elements, const AxialLaw &law) : elements_(elements), law_(law) {}

  void beginStep(const State &, const Configuration &, const Step &step, int) override { mixed_ = step.mixed; }

  double energy(const Configuration &configuration, int r) const override {
    const RodRange &rod = elements_.rods[r];
    Pack total(0.0);
    for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
      const Pack s = read<Pack>(configuration[Configuration::strain] + i) - read<Pack>(law_.rest() + i);
      total += read<Pack>(law_.stiffness() + i) * s * s * read<Pack>(elements_.restLength() + i);
    }
    return 0.5 * reduce(total);
  }

  void addEnergies(const State &, const Configuration &c, double, int r, EnergyBudget &out) const override {
    const RodRange &rod = elements_.rods[r];
    Pack total(0.0);
    for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
      const Pack strain = read<Pack>(c[Configuration::strain] + s);
      total += read<Pack>(elements_.axialStiffness() + s) * strain * strain * read<Pack>(elements_.restLength() + s);
    }
    out.stretch += 0.5 * reduce(total);
  }

  void addDerivatives(const Configuration &configuration, int r, Derivatives &out, HessianKind hessian) const override {
    elements_.energy[r] == Energy::seed ? assemble<Energy::seed>(configuration, r, out, hessian)
                                        : assemble<Energy::classical>(configuration, r, out, hessian);
  }

private:
  const Elements &elements_;
  const AxialLaw &law_;
  bool mixed_ = true;

  template <Energy law>
  [[gnu::flatten]] void assemble(const Configuration &configuration, int r, Derivatives &out,
                                 HessianKind hessian) const {
    const RodRange &rod = elements_.rods[r];
    const BlockPlanes blocks(out.blocks, rod);
    for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
      const Pack::mask_type live = firstLanes(rod.edgeEnd() - i); // the copies behind a ring have forces, too
      const Pack stiffness = read<Pack>(law_.stiffness() + i), inverse = read<Pack>(elements_.inverseRestLength() + i);
      const Pack primal =
          stiffness * (read<Pack>(configuration[Configuration::strain] + i) - read<Pack>(law_.rest() + i));
      const Pack force =
          select(live, mixed_ ? read<Pack>(configuration[Configuration::axial_force] + i) : primal, Pack(0.0));
      const FrameOf<Pack> f = configuration.frames<Pack>(i);
      const Pack slope = strainSlope<Pack>(law, f.length, inverse);
      const Vector3<Pack> e = stretchGradient(f, force, slope),
                          g = stretchGradient<Pack>(f, select(live, primal - force, Pack(0.0)), slope);
      // What belongs to the first vertex of the edges before what belongs to the second, whose memory overlaps: the
      // store has left the pipeline by then.
      for (int a = 0; a < 3; ++a) {
        addTo<Pack>(out.equilibrium[a] + i, -e[a]);
        addTo<Pack>(out.gradient[a] + i, -g[a]);
      }
      if (hessian != HessianKind::none) {
        const Matrix3<Pack> h = stretchHessian<Pack>(
            law, f, stiffness, hessian == HessianKind::exact ? force : max(force, Pack(0.0)), inverse, slope);
        for (int a = 0; a < 3; ++a)
          for (int b = a; b < 3; ++b) addTo(blocks.own(a, b) + i, h(a, b));
      }
      for (int a = 0; a < 3; ++a) {
        addTo(out.equilibrium[a] + i + 1, e[a]);
        addTo(out.gradient[a] + i + 1, g[a]);
      }
    }
  }
};

} // namespace

AxialLaw::AxialLaw(const Scene &scene, const Elements &elements)
    : scene_(scene), elements_(elements), planes_(2, elements.slots) {
  std::copy_n(elements.axialStiffness(), elements.slots, planes_[0]);
}

/// Dissipation as in the bending term: a second quadratic around the strain at the start (dampedRest), docs/theory.md
/// (14.2). For a force that does the work which the edge stores, a step takes the mean of the strains at its ends and
/// the slope of the strain between them. Known from a solve before, in which the edge moves by de on either side of its
/// middle m, what the mean has on top of the strain in the middle is a rest strain with the opposite sign: |de|^2/(2
/// L^2) for `seed` (15.12); for `classical`, with the mean l of the lengths at the ends, (l - |m|)/L, and the force is
/// along m/l, not m/|m| (15.13).
void AxialLaw::beginStep(const Configuration &start, const Step &step, int r) {
  const double beta = scene_.rods[r].material.stiffness_damping_coefficient;
  const Rates *half = step.rule ? step.rule->half : nullptr;
  moved_ = moved_ || half;
  if (beta == 0 && !moved_) return;
  const double q = step.isStatic() ? 0 : beta / step.dampingDt();
  const RodRange &rod = elements_.rods[r];
  for (int k = 0; k < rod.edges; ++k) {
    const int i = rod.slot(k), v = rod.first_vertex;
    planes_[0][i] = elements_.axialStiffness()[i] * (1 + q);
    planes_[1][i] = q / (1 + q) * dampedRest(step, start[Configuration::strain][i], i);
    if (!half) continue;
    const Vec3 de = half->vertex[v + (k + 1) % rod.vertices] - half->vertex[v + k];
    const double inverse = elements_.inverseRestLength()[i];
    if (elements_.energy[r] == Energy::seed) {
      planes_[1][i] -= 0.5 / (1 + q) * de.squaredNorm() * std::pow(inverse, 2);
      continue;
    }
    const Vec3 before = start.edges<double>(i), m = before + de;
    const double middle = m.norm(), across = 2 * m.dot(de);
    const double beyond = 0.5 * ((de.squaredNorm() - across) / (before.norm() + middle) +
                                 (de.squaredNorm() + across) / ((m + de).norm() + middle));
    planes_[0][i] *= middle / (middle + beyond);
    planes_[1][i] -= beyond * inverse / (1 + q);
  }
}

std::unique_ptr<Term> makeStretch(const Elements &elements, const AxialLaw &law) {
  return std::make_unique<Stretch>(elements, law);
}

} // namespace tendril
