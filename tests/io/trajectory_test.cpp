/// What a trajectory tells of the scene, besides its frames: rods, supports, and where it came from.
#include "support/files.hpp"
#include "support/rods.hpp"

#include "tendril/io/trajectory.hpp"

#include <cmath>

namespace tendril::test {
namespace {

/// A strip held at both ends, a ring, and a cable of which only the stiffness is known.
Scene mixedScene() {
  Rod strip = straightRod(4, Measure::angle), ring, cable = straightRod(3);
  strip.name = "strip";
  strip.material = homogeneousMaterial({SectionShape::rectangle, {0.02, 0.004}}, 1e9, 4e8, 1000);
  ring.name = "r\xc3\xadng"; // UTF-8
  ring.closed = true;
  ring.energy = Energy::classical;
  ring.position = ringShape(Vec3(0, 2, 0), Vec3::UnitZ(), 0.3, 5).points;
  ring.material = homogeneousMaterial({SectionShape::circle, {0.01, 0}}, 1e7, 4e6, 1000);
  setBishopDirectors(ring);
  cable.name = "cable";
  cable.material.flexural_stiffness = {0, 0};
  Scene scene;
  scene.rods = {strip, ring, cable};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 2, 3, Support::Kind::pin),
                    hold(scene, 0, 4, Support::Kind::fix_twist)};
  return scene;
}

/// A file with one frame, opened with HDF5.
class Written {
public:
  explicit Written(Scene scene, const Provenance &origin = {}) {
    Simulation run;
    EXPECT_EQ(run.setUp(std::move(scene), dynamics(0.1, 1)), PetscErrorCode(0));
    const std::set<std::string> fields(TrajectoryWriter::fieldNames().begin(), TrajectoryWriter::fieldNames().end());
    TrajectoryWriter(folder_.path(""), run.scene, *run.elements, origin, fields, true).writeFrame(run.state);
    file_ = std::make_unique<Hdf5File>(Hdf5File::open(folder_.path("trajectory.h5")));
  }
  const Hdf5File &file() const { return *file_; }
  /// A list of strings, or a text.
  std::vector<std::string> strings(const std::string &name) const {
    const Hdf5Dataset data = H5Dopen2(file_->id(), name.c_str(), H5P_DEFAULT);
    const Hdf5Type type = H5Dget_type(data);
    const Hdf5Space space = H5Dget_space(data);
    EXPECT_EQ(H5Tget_cset(type), H5T_CSET_UTF8) << name;
    return split(H5Tget_size(type), std::size_t(H5Sget_simple_extent_npoints(space)),
                 [&](char *to) { H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, to); });
  }
  std::string attribute(const std::string &object, const std::string &name) const {
    const Hdf5Attribute a = H5Aopen_by_name(file_->id(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    if (a < 0) return "(none)";
    const Hdf5Type type = H5Aget_type(a);
    return split(H5Tget_size(type), 1, [&](char *to) { H5Aread(a, type, to); })[0];
  }
  int version() const {
    int version = 0;
    const Hdf5Attribute a = H5Aopen_by_name(file_->id(), "/", "format_version", H5P_DEFAULT, H5P_DEFAULT);
    H5Aread(a, H5T_NATIVE_INT, &version);
    return version;
  }

private:
  Folder folder_;
  std::unique_ptr<Hdf5File> file_;

  template <class Read> static std::vector<std::string> split(std::size_t width, std::size_t count, Read read) {
    std::string all(width * count, ' ');
    read(all.data());
    std::vector<std::string> out;
    for (std::size_t k = 0; k < count; ++k) out.emplace_back(all.substr(k * width, width).c_str());
    return out;
  }
};

TEST(Trajectory, TellsNamesSectionsAndHalfAxesOfRods) {
  const Written written(mixedScene());
  EXPECT_EQ(written.version(), 2);
  EXPECT_EQ(written.strings("rods/name"), (std::vector<std::string>{"strip", "r\xc3\xadng", "cable"}));
  EXPECT_EQ(written.strings("rods/energy"), (std::vector<std::string>{"seed", "classical", "seed"}));
  EXPECT_EQ(written.strings("rods/section"), (std::vector<std::string>{"rectangle", "circle", "none"}));
  const Hdf5Dataset data = H5Dopen2(written.file().id(), "rods/half_axes", H5P_DEFAULT);
  double axes[3][2];
  H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, axes);
  EXPECT_EQ(axes[0][0], 0.01);
  EXPECT_EQ(axes[0][1], 0.002);
  EXPECT_EQ(axes[1][0], 0.01);
  EXPECT_EQ(axes[1][1], 0.01);
  EXPECT_TRUE(std::isnan(axes[2][0]) && std::isnan(axes[2][1]));
  const std::vector<double> radius = written.file().read("reference/radius", 1);
  EXPECT_EQ(radius, (std::vector<double>{0.006, 0.006, 0.006, 0.006, 0.006, 0.01, 0.01, 0.01, 0.01, 0.01, 0, 0, 0, 0}));
}

TEST(Trajectory, RadiusWithoutASectionIsThatOfARoundRodOfTheSameStiffness) {
  Rod rod = straightRod(2);
  rod.material = homogeneousMaterial({SectionShape::circle, {0.003, 0}}, 1e9, 4e8, 1000);
  rod.material.section.reset();
  const std::vector<double> radius = Written(clampedScene(rod)).file().read("reference/radius", 1);
  for (const double r : radius) EXPECT_NEAR(r, 0.003, 1e-17);
}

TEST(Trajectory, NumbersSupportedVerticesOverAllRods) {
  {
    const Written written(mixedScene());
    EXPECT_EQ(written.file().read("supports/vertex", 1), (std::vector<double>{0, 13, 4}));
    EXPECT_EQ(written.strings("supports/type"), (std::vector<std::string>{"clamp", "pin", "fix_twist"}));
    EXPECT_EQ(written.file().read("topology/rod_cell_offsets", 1),
              (std::vector<double>{0, 5, 10, 10})); // half cells at both ends of the strip
  }
  Scene free = mixedScene();
  free.supports.clear();
  EXPECT_FALSE(Written(free).file().has("supports"));
}

TEST(Trajectory, HoldsTheSceneWithItsFilesAndTheOptions) {
  Provenance origin;
  origin.scene = {"rods: [] # \xc3\xa9\n", {{"../a.csv", "0 0 0\n"}, {"/b/c.obj", ""}}};
  origin.effective_options = "dt: 0.1\n";
  const Written written(mixedScene(), origin);
  EXPECT_EQ(written.strings("scene"), std::vector<std::string>{origin.scene.text});
  EXPECT_EQ(written.strings("options"), std::vector<std::string>{origin.effective_options});
  EXPECT_EQ(written.strings("scene_files/0"), std::vector<std::string>{"0 0 0\n"});
  EXPECT_EQ(written.attribute("scene_files/0", "path"), "../a.csv");
  EXPECT_EQ(written.strings("scene_files/1"), std::vector<std::string>{""});
  EXPECT_EQ(written.attribute("scene_files/1", "path"), "/b/c.obj");
  EXPECT_FALSE(written.file().has("scene_files/2"));
}

TEST(Trajectory, EveryFieldHasAUnitAndAPlace) {
  Scene scene = mixedScene();
  for (Rod &rod : scene.rods) rod.contact.on = false;
  Collider &ball = scene.colliders.emplace_back();
  ball.kind = "sphere";
  ball.shape = makeSphere(1);
  ball.motion.velocity = Vec3(1, 0, 0);
  Body &body = scene.bodies.emplace_back();
  body.own = sphereMass(0.1, 1000);
  Tendon &tendon = scene.tendons.emplace_back();
  tendon.name = "tendon";
  tendon.points.resize(2);
  tendon.points[0].body = 0;
  tendon.points[1].point = {1, 0, 0};
  tendon.segments = {{0, 1}};
  const Written written(scene);
  for (const std::string &name : TrajectoryWriter::fieldNames()) {
    EXPECT_NE(written.attribute("state/" + name, "unit"), "(none)") << name;
    EXPECT_NE(written.attribute("state/" + name, "place"), "(none)") << name;
  }
  for (const DiagnosticsColumn &column : diagnosticsColumns())
    EXPECT_EQ(written.attribute("diagnostics/" + column.name, "unit"), column.unit);
  EXPECT_EQ(written.attribute("state/turns", "place"), "cells");
  EXPECT_EQ(written.attribute("time", "unit"), "s");
}

} // namespace
} // namespace tendril::test
