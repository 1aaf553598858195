/// Polylines from every kind of file, and where their errors point. Numbers are read exactly: no tolerances.
#include "tendril/io/hdf5.hpp"
#include "tendril/io/polyline_reader.hpp"

#include "support/files.hpp"

namespace tendril::test {
namespace {

TEST(PolylineReader, ReadsPointsWithCommentsAndSeveralRods) {
  const Folder folder;
  const std::string text =
      "# x, y, z\n0, 0.5, 0\n1 0 -2e-1   # the end of a line\n# between points\n2,0,0\r\n\n\n  \n3 0 0\n4\t0\t0\n";
  for (const char *name : {"a.csv", "a.txt", "a.CSV"}) {
    const auto lines = readPolylines(folder.write(name, text));
    ASSERT_EQ(lines.size(), 2u) << name;
    ASSERT_EQ(lines[0].points.size(), 3u);
    EXPECT_EQ(lines[0].points[0], Vec3(0, 0.5, 0));
    EXPECT_EQ(lines[0].points[1], Vec3(1, 0, -0.2));
    ASSERT_EQ(lines[1].points.size(), 2u);
    EXPECT_EQ(lines[1].points[1], Vec3(4, 0, 0));
    EXPECT_FALSE(lines[0].closed);
  }
}

TEST(PolylineReader, ReadsLinesOfObj) {
  const Folder folder;
  const auto lines =
      readPolylines(folder.write("a.obj", "o ring and rods\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nl 1 2 3 1\nv 1 0 0\nv "
                                          "0 1 0\nl -2/1 -1/2\nv 0 0 0\nv 5 0 0\nl 6 7\n"));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_TRUE(lines[0].closed);
  ASSERT_EQ(lines[0].points.size(), 3u); // the first is not repeated
  EXPECT_EQ(lines[0].points[2], Vec3(0, 1, 0));
  EXPECT_FALSE(lines[1].closed);
  EXPECT_EQ(lines[1].points,
            (std::vector<Vec3>{{1, 0, 0}, {0, 1, 0}})); // counted from the end, with texture coordinates
  EXPECT_EQ(lines[2].points, (std::vector<Vec3>{{0, 0, 0}, {5, 0, 0}}));
}

/// x of the vertices of every polyline of an .obj file whose vertex k is at x = k.
std::vector<std::vector<int>> chainsOf(const std::string &elements, std::vector<bool> *closed = nullptr) {
  const Folder folder;
  std::string text;
  for (int k = 1; k <= 9; ++k) text += "v " + std::to_string(k) + " 0 0\n";
  std::vector<std::vector<int>> chains;
  for (const Polyline &line : readPolylines(folder.write("a.obj", text + elements))) {
    std::vector<int> &chain = chains.emplace_back();
    for (const Vec3 &x : line.points) chain.push_back(int(x[0]));
    if (closed) closed->push_back(line.closed);
  }
  return chains;
}

TEST(PolylineReader, JoinsLinesOfObjThatShareVertices) {
  using Chains = std::vector<std::vector<int>>;
  EXPECT_EQ(chainsOf("l 1 2\nl 2 3\nl 3 4\n"), (Chains{{1, 2, 3, 4}}));
  EXPECT_EQ(chainsOf("l 3 4\nl 7 8\nl 2 1\nl 3 2\nl 8 9\n"),
            (Chains{{1, 2, 3, 4}, {7, 8, 9}})); // in any order, the way of the first edge
  EXPECT_EQ(chainsOf("l 4 3\nl 2 3 \nl 1 2\n"), (Chains{{4, 3, 2, 1}}));
  EXPECT_EQ(chainsOf("l 1 2 3\nl 5 4 3\n"), (Chains{{1, 2, 3, 4, 5}}));
  std::vector<bool> closed;
  EXPECT_EQ(chainsOf("l 5 6\nl 2 3\nl 1 2\nl 3 1\n", &closed), (Chains{{5, 6}, {2, 3, 1}}));
  EXPECT_EQ(closed, (std::vector<bool>{false, true}));
  EXPECT_TRUE(says(messageOf([] { chainsOf("l 1 2\nl 2 3\nl 2 4\n"); }), "a.obj:12: vertex 2 has a third edge here"));
  EXPECT_TRUE(says(messageOf([] { chainsOf("l 1 2 3 4 2\n"); }), "a.obj:10: vertex 2 has a third edge here"));
  EXPECT_TRUE(says(messageOf([] { chainsOf("l 1 1\n"); }), "a.obj:10: an edge from vertex 1 to itself"));
}

TEST(PolylineReader, ByteOrderMarksAreNoText) {
  const Folder folder;
  EXPECT_EQ(readPolylines(folder.write("a.csv", "\xEF\xBB\xBF"
                                                "0,0,0\n1,0,0\n"))[0]
                .points,
            (std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}}));
  EXPECT_EQ(readPolylines(folder.write("a.obj", "\xEF\xBB\xBFv 5 5 5\nv 0 0 0\nv 1 0 0\nl 2 3\n"))[0].points,
            (std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}}));
}

/// An HDF5 file of five points, with what else is asked for.
std::string writeHdf5(const Folder &folder, const std::vector<int> &offsets, const std::vector<int> &closed) {
  const std::string path = folder.path("a.h5");
  const double x[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 7, 0, 0, 8, 0, 0};
  Hdf5File file = Hdf5File::create(path);
  file.write("position", {5, 3}, x);
  if (!offsets.empty()) file.write("rod_vertex_offsets", {offsets.size()}, offsets.data());
  if (!closed.empty()) file.write("closed", {closed.size()}, closed.data());
  return path;
}

TEST(PolylineReader, ReadsHdf5WithOffsetsAndRings) {
  const Folder folder;
  const auto lines = readPolylines(writeHdf5(folder, {0, 3, 5}, {1, 0}));
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_TRUE(lines[0].closed);
  EXPECT_EQ(lines[0].points.size(), 3u);
  EXPECT_FALSE(lines[1].closed);
  EXPECT_EQ(lines[1].points, (std::vector<Vec3>{{7, 0, 0}, {8, 0, 0}}));
  const auto one = readPolylines(writeHdf5(folder, {}, {}));
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].points.size(), 5u);
}

TEST(PolylineReader, ErrorsNameFileAndLine) {
  const Folder folder;
  const struct {
    const char *name, *text, *place, *finding;
  } rows[] = {
      {"word.csv", "0 0 0\n1 x 0\n", "word.csv:2: ", "'x' is not a number"},
      {"tail.csv", "0 0 0\n1 0.5mm 0\n", "tail.csv:2: ", "'0.5mm'"},
      {"nan.csv", "nan 0 0\n", "nan.csv:1: ", "not finite"},
      {"inf.csv", "0 0 0\n\n0 0 -inf\n", "inf.csv:2: ", "one point"},
      {"short.csv", "0 0 0\n# comment\n1 0\n", "short.csv:3: ", "three numbers"},
      {"long.csv", "0 0 0 0\n", "long.csv:1: ", "found more"},
      {"lonely.csv", "0 0 0\n1 0 0\n\n2 0 0\n", "lonely.csv:4: ", "one point"},
      {"empty.csv", "# nothing\n\n", "empty.csv: ", "no polyline"},
      {"range.obj", "v 0 0 0\nv 1 0 0\nl 1 2 3\n", "range.obj:3: ", "'3'"},
      {"early.obj", "v 0 0 0\nl 1 2\nv 1 0 0\n", "early.obj:2: ", "'2'"},
      {"zero.obj", "v 0 0 0\nv 1 0 0\nl 0 1\n", "zero.obj:3: ", "'0'"},
      {"back.obj", "v 0 0 0\nv 1 0 0\nl -3 -1\n", "back.obj:3: ", "'-3'"},
      {"word.obj", "v 0 0 0\nv 1 0 0\nl 1 b\n", "word.obj:3: ", "'b'"},
      {"point.obj", "v 0 0 0\nl 1\n", "point.obj:2: ", "two vertices"},
      {"vertex.obj", "v 0 0\n", "vertex.obj:1: ", "three numbers"},
      {"bare.obj", "v 0 0 0\n", "bare.obj: ", "no polyline"},
      {"text.h5", "text", "text.h5: ", "not a readable HDF5"},
      {"rod.ply", "ply", "rod.ply: ", "'.ply'"},
  };
  for (const auto &row : rows) {
    const std::string message = messageOf([&] { readPolylines(folder.write(row.name, row.text)); });
    EXPECT_TRUE(says(message, row.place));
    EXPECT_TRUE(says(message, row.finding));
  }
  EXPECT_TRUE(says(messageOf([&] { readPolylines(folder.path("none.csv")); }), "none.csv: cannot be opened"));
  EXPECT_TRUE(says(messageOf([&] { readPolylines(writeHdf5(folder, {0, 9}, {})); }), "rise from 0 to 5"));
  EXPECT_TRUE(says(messageOf([&] { readPolylines(writeHdf5(folder, {0, 4, 5}, {})); }), "two or more a rod"));
  EXPECT_TRUE(says(messageOf([&] { readPolylines(writeHdf5(folder, {0, 3, 5}, {1})); }), "one number per rod (2)"));
}

} // namespace
} // namespace tendril::test
