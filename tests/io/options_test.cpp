/// What the command line puts in the place of the scene, and what it refuses. tests/apps/bad_input.py has the rest of
/// the refusals, with exit codes.
#include "support/rods.hpp"

#include "tendril/io/options.hpp"

namespace tendril::test {
namespace {

RunSettings settingsFrom(const std::string &mode) {
  RunSettings run;
  run.mode = mode;
  run.dt = 0.02;
  run.t_end = 3;
  run.load_steps = 4;
  return run;
}

TEST(Options, OfTheCommandLineGoBeforeThoseOfTheScene) {
  Options o;
  resolve(settingsFrom("dynamic"), o);
  EXPECT_TRUE(o.loop.dynamic);
  EXPECT_EQ(o.loop.dt, 0.02);
  EXPECT_EQ(o.loop.t_end, 3);
  Options given;
  given.dt = 0.01;
  resolve(settingsFrom("dynamic"), given);
  EXPECT_EQ(given.loop.dt, 0.01);
  EXPECT_EQ(given.loop.t_end, 3);
  Options statics;
  statics.mode = "static";
  resolve(settingsFrom("dynamic"), statics);
  EXPECT_FALSE(statics.loop.dynamic);
  EXPECT_EQ(statics.loop.dt, 0.25);
  EXPECT_EQ(statics.loop.t_end, 1);
  statics = {};
  statics.given_load_steps = 10;
  resolve(settingsFrom("static"), statics);
  EXPECT_EQ(statics.loop.dt, 0.1);
}

/// The message, empty where nothing is refused.
std::string refusalOf(const std::string &mode, Options o) {
  try {
    resolve(settingsFrom(mode), o);
  } catch (const SceneError &e) {
    return e.what();
  }
  return "";
}

TEST(Options, ThatMeanNothingAreRefusedByName) {
  Options o;
  o.dt = 0.1;
  EXPECT_NE(refusalOf("static", o).find("-dt"), std::string::npos);
  EXPECT_EQ(refusalOf("dynamic", o), "");
  o = {};
  o.arclength_steps = 5;
  EXPECT_NE(refusalOf("dynamic", o).find("-arclength_steps"), std::string::npos);
  o = {};
  o.loop.dt_min = 0.5;
  EXPECT_NE(refusalOf("dynamic", o).find("-dt_min"), std::string::npos);
  o = {};
  o.t_end = 1e90;
  const std::string never = refusalOf("dynamic", o);
  EXPECT_NE(never.find("never reaches the end at 1e+90 s"), std::string::npos) << never;
}

TEST(Options, ForEdgesGoByNamesInTheirOrder) {
  Scene scene;
  scene.rods = {straightRod(4), straightRod(5), straightRod(6)};
  scene.rods[0].name = "hair#0";
  scene.rods[1].name = "hair#1";
  scene.rods[2].name = "rope";
  Options o;
  EXPECT_EQ(edgesAsked(scene, o), (std::vector<int>{4, 5, 6}));
  o.rod_edges = {{"all", 8}, {"hair", 10}, {"1", 12}};
  EXPECT_EQ(edgesAsked(scene, o), (std::vector<int>{10, 12, 8}));
  o.rod_edges = {{"beard", 8}};
  EXPECT_THROW(edgesAsked(scene, o), SceneError);
}

} // namespace
} // namespace tendril::test
