#include "tendril/io/estimate_writer.hpp"

#include "tendril/io/hdf5.hpp"

namespace tendril {

void writeEstimate(const std::string &path, const Estimate &e) {
  Hdf5File file = Hdf5File::reopen(path);
  file.createGroup("estimate");
  file.writeAttribute("estimate", "valid", int(e.none.empty()));
  if (!e.critical.empty()) {
    file.write("estimate/critical_load_factor", {e.critical.size()}, e.critical.data(), "1");
    file.write("estimate/critical_error", {e.critical.size()}, e.critical_error.data(), "1");
  }
  if (!e.none.empty()) return file.writeAttribute("estimate", "reason", e.none);
  const hsize_t n = e.position.size();
  file.write("estimate/position", {n, 3}, e.position[0].data(), "m");
  file.write("estimate/error", {n}, e.error.data(), "m");
  const RodEstimate &worst = e.rods[e.worstRod()];
  file.writeAttribute("estimate", "position_error", worst.error);
  file.writeAttribute("estimate", "relative_position_error", worst.error / worst.length);
  for (const auto &[name, member] : estimated_energies)
    file.writeAttribute("estimate", std::string(name) + "_energy_error", std::abs(e.energy_error.*member));
}

void writeTimeError(const std::string &path, double error) {
  Hdf5File file = Hdf5File::reopen(path);
  file.createGroup("estimate");
  file.writeAttribute("estimate", "time_error", error);
}

} // namespace tendril
