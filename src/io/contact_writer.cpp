#include "tendril/io/contact_writer.hpp"

namespace tendril {
namespace {

void putVector(const Vec3 &v, double *out) { std::copy(v.data(), v.data() + 3, out); }

constexpr ContactWriter::Column of_obstacles[] = {
    {"rod", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.rod; }},
    {"collider", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.collider; }},
    {"edge", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.edge; }},
    {"at", "1", 1, false, [](const ContactReading &c, double *out) { *out = c.point.by[0].point.at; }},
    {"gap", "m", 1, false, [](const ContactReading &c, double *out) { *out = c.gap; }},
    {"position", "m", 3, false, [](const ContactReading &c, double *out) { putVector(c.place, out); }},
    {"normal", "1", 3, false, [](const ContactReading &c, double *out) { putVector(c.normal, out); }},
    {"normal_force", "N", 3, false, [](const ContactReading &c, double *out) { putVector(c.force, out); }},
    {"friction", "N", 3, false, [](const ContactReading &c, double *out) { putVector(c.friction, out); }}};

constexpr PairWriter::Column of_pairs[] = {
    {"rod", "1", 1, true, [](const PairReading &c, double *out) { *out = c.rod[0]; }},
    {"edge", "1", 1, true, [](const PairReading &c, double *out) { *out = c.edge[0]; }},
    {"body", "1", 1, true, [](const PairReading &c, double *out) { *out = c.body[0]; }},
    {"at", "1", 1, false, [](const PairReading &c, double *out) { *out = c.at[0]; }},
    {"to_rod", "1", 1, true, [](const PairReading &c, double *out) { *out = c.rod[1]; }},
    {"to_edge", "1", 1, true, [](const PairReading &c, double *out) { *out = c.edge[1]; }},
    {"to_body", "1", 1, true, [](const PairReading &c, double *out) { *out = c.body[1]; }},
    {"to_at", "1", 1, false, [](const PairReading &c, double *out) { *out = c.at[1]; }},
    {"gap", "m", 1, false, [](const PairReading &c, double *out) { *out = c.gap; }},
    {"position", "m", 3, false, [](const PairReading &c, double *out) { putVector(c.place, out); }},
    {"normal", "1", 3, false, [](const PairReading &c, double *out) { putVector(c.normal, out); }},
    {"normal_force", "N", 3, false, [](const PairReading &c, double *out) { putVector(c.force, out); }},
    {"friction", "N", 3, false, [](const PairReading &c, double *out) { putVector(c.friction, out); }}};

} // namespace

std::unique_ptr<ContactWriter> makeContactWriter(Hdf5File &file) {
  return std::make_unique<ContactWriter>(file, "contacts", of_obstacles);
}
std::unique_ptr<PairWriter> makePairWriter(Hdf5File &file) {
  return std::make_unique<PairWriter>(file, "touching", of_pairs);
}

} // namespace tendril
