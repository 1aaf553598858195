#include "tendril/io/mesh_formats.hpp"

#include "tendril/io/text.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>

namespace tendril {
namespace {

constexpr std::string_view spaces = " \t\r\n\v\f";

std::string quotedText(std::string_view word) { return excerpt(std::string(word)); }

/// How a number is stored.
struct NumberType {
  std::string_view name, other;
  int bytes;
  char kind; ///< unsigned, signed or floating point: u, i, f
};

constexpr NumberType number_types[] = {
    {"char", "int8", 1, 'i'}, {"uchar", "uint8", 1, 'u'}, {"short", "int16", 2, 'i'},   {"ushort", "uint16", 2, 'u'},
    {"int", "int32", 4, 'i'}, {"uint", "uint32", 4, 'u'}, {"float", "float32", 4, 'f'}, {"double", "float64", 8, 'f'}};

/// What a property is to a mesh: nothing, a coordinate, or the corners of a face.
enum class Role { none, x, y, z, corners };

struct Property {
  std::string name;
  const NumberType *type;
  const NumberType *count; ///< that of the length of a list; null for a single number
  Role role = Role::none;
};

struct Element {
  std::string name;
  std::size_t count;
  std::vector<Property> properties;
  bool has(Role role) const {
    return std::any_of(properties.begin(), properties.end(), [&](const Property &p) { return p.role == role; });
  }
};

struct Header {
  std::string format;
  std::vector<Element> elements;
  const Element *find(const std::string &name) const {
    const auto is = [&](const Element &e) { return e.name == name; };
    const auto found = std::find_if(elements.begin(), elements.end(), is);
    return found == elements.end() ? nullptr : &*found;
  }
};

Role roleOf(const std::string &element, const std::string &name) {
  if (element == "face") return name == "vertex_indices" || name == "vertex_index" ? Role::corners : Role::none;
  if (element != "vertex") return Role::none;
  return name == "x" ? Role::x : name == "y" ? Role::y : name == "z" ? Role::z : Role::none;
}

const NumberType *typeOf(MeshLines &lines, std::string_view word) {
  for (const NumberType &type : number_types)
    if (word == type.name || word == type.other) return &type;
  lines.fail(quotedText(word) + " is not a type; write char, uchar, short, ushort, int, uint, float or double");
}

void readFormat(MeshLines &lines, Header &header) {
  const std::string_view format = lines.word(), version = lines.word();
  if (!header.format.empty()) lines.fail("says its format twice; write one line 'format'");
  if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian")
    lines.fail(quotedText(format) + " is not a format; write ascii, binary_little_endian or binary_big_endian");
  if (version != "1.0") lines.fail(quotedText(version) + " is not a version that is read; write 1.0");
  header.format = format;
}

void readElement(MeshLines &lines, Header &header) {
  const std::string name(lines.word());
  if (name.empty()) lines.fail("an element has no name; write element NAME COUNT");
  if ((name == "vertex" || name == "face") && header.find(name))
    lines.fail("there is an element '" + name + "' above; write all of them as one");
  header.elements.push_back({name, lines.count("rows of " + quotedText(name)), {}});
}

/// A role that is given twice, to a list of what is one number, or the other way round, is what no reader can follow.
void checkRole(MeshLines &lines, const Element &element, const Property &p) {
  if (p.role == Role::none) return;
  if (element.has(p.role)) lines.fail("'" + p.name + "' is there twice; write it once");
  if (p.role != Role::corners && p.count) lines.fail("'" + p.name + "' is a list; write property float " + p.name);
  if (p.role == Role::corners && (!p.count || p.type->kind == 'f'))
    lines.fail("'" + p.name + "' is not a list of whole numbers; write property list uchar int " + p.name);
}

void readProperty(MeshLines &lines, Header &header) {
  if (header.elements.empty()) lines.fail("a property has no element; write element NAME COUNT above it");
  Element &element = header.elements.back();
  std::string_view word = lines.word();
  Property p{};
  if (word == "list") {
    p.count = typeOf(lines, lines.word());
    if (p.count->kind == 'f') lines.fail("the length of a list is not a whole number; write uchar, ushort or uint");
    word = lines.word();
  }
  p.type = typeOf(lines, word);
  p.name = lines.word();
  if (p.name.empty()) lines.fail("a property has no name; write property TYPE NAME");
  p.role = roleOf(element.name, p.name);
  checkRole(lines, element, p);
  element.properties.push_back(std::move(p));
}

/// Where there are faces, all that they need.
void checkHeader(const MeshLines &lines, const Header &header) {
  if (header.format.empty()) lines.fail("the header says no format; write a line format ascii 1.0");
  const Element *faces = header.find("face"), *vertices = header.find("vertex");
  if (!faces || faces->count == 0) return;
  if (!faces->has(Role::corners)) lines.fail("'face' has no corners; write property list uchar int vertex_indices");
  if (!vertices) lines.fail("there is no element 'vertex'; write element vertex COUNT, and its x, y and z");
  for (const auto &[role, name] : {std::pair(Role::x, "x"), {Role::y, "y"}, {Role::z, "z"}})
    if (!vertices->has(role)) lines.fail("'vertex' has no " + std::string(name) + "; write property float " + name);
}

/// Leaves `lines` at the last line of the header.
Header readHeader(MeshLines &lines) {
  if (!lines.next() || lines.word() != "ply" || lines.hasWords())
    lines.failFile("is no PLY file; write 'ply' alone in its first line");
  Header header;
  while (lines.next()) {
    const std::string_view word = lines.word();
    if (word == "comment" || word == "obj_info") continue;
    if (word == "format")
      readFormat(lines, header);
    else if (word == "element")
      readElement(lines, header);
    else if (word == "property")
      readProperty(lines, header);
    else if (word != "end_header")
      lines.fail(quotedText(word) + " is no word of a header; write format, element, property, comment or end_header");
    if (lines.hasWords()) lines.fail("has more words than " + quotedText(word) + " takes; leave them out");
    if (word == "end_header") return checkHeader(lines, header), header;
  }
  lines.failFile("ends within its header; write 'end_header' below it");
}

/// The numbers of a PLY file, one after the other.
class Numbers {
public:
  virtual ~Numbers() = default;
  virtual void startRow(const Element &element, std::size_t row) = 0;
  virtual double read(const NumberType &type) = 0;
  virtual void skip(const NumberType &type, std::size_t count) = 0;
  virtual void endRow() {}
  virtual void endFile() = 0;
  [[noreturn]] virtual void fail(const std::string &message) const = 0;
};

/// A row is a line.
class TextNumbers : public Numbers {
public:
  explicit TextNumbers(MeshLines &lines) : lines_(lines) {}
  void startRow(const Element &element, std::size_t row) override {
    if (!lines_.next()) lines_.failCutOff("rows of " + quotedText(element.name), row, element.count);
  }
  double read(const NumberType &type) override {
    const std::string_view word = wordOf();
    const double x = numberOf(word, lines_);
    const double span = std::ldexp(1, 8 * type.bytes), lowest = type.kind == 'i' ? -span / 2 : 0;
    if (type.kind != 'f' && !(x >= lowest && x < lowest + span && x == std::floor(x)))
      lines_.fail(quotedText(word) + " is not of the type " + std::string(type.name));
    return x;
  }
  void skip(const NumberType &, std::size_t count) override {
    for (std::size_t k = 0; k < count; ++k) wordOf();
  }
  void endRow() override {
    if (lines_.hasWords()) lines_.fail("has more numbers than its properties; leave them out");
  }
  void endFile() override {
    if (lines_.next()) lines_.fail("is behind the last row that the header counts; correct its counts");
  }
  [[noreturn]] void fail(const std::string &message) const override { lines_.fail(message); }

private:
  std::string_view wordOf() const {
    const std::string_view word = lines_.word();
    if (word.empty()) lines_.fail("has fewer numbers than its properties; write a row in one line");
    return word;
  }
  MeshLines &lines_;
};

class BinaryNumbers : public Numbers {
public:
  BinaryNumbers(const MeshLines &lines, bool big) : lines_(lines), big_(big), at_(lines.end()) {}
  void startRow(const Element &element, std::size_t row) override { element_ = &element, row_ = row; }
  double read(const NumberType &type) override {
    const std::string_view bytes = take(std::size_t(type.bytes));
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < bytes.size(); ++k)
      bits = bits << 8 | static_cast<unsigned char>(bytes[big_ ? k : bytes.size() - 1 - k]);
    if (type.kind == 'u') return double(bits);
    if (type.kind == 'f')
      return type.bytes == 8 ? std::bit_cast<double>(bits) : std::bit_cast<float>(std::uint32_t(bits));
    const double span = std::ldexp(1, 8 * type.bytes);
    return double(bits) < span / 2 ? double(bits) : double(bits) - span;
  }
  void skip(const NumberType &type, std::size_t count) override { take(count * std::size_t(type.bytes)); }
  void endFile() override {
    if (lines_.text().find_first_not_of("\r\n", at_) != std::string_view::npos)
      lines_.failFile("has " + std::to_string(lines_.text().size() - at_) +
                      " bytes behind the last row that the header counts; correct its counts");
  }
  [[noreturn]] void fail(const std::string &message) const override {
    lines_.failFile("row " + std::to_string(row_) + " of " + quotedText(element_->name) + ": " + message);
  }

private:
  std::string_view take(std::size_t size) {
    if (lines_.text().size() - at_ < size)
      lines_.failCutOff("rows of " + quotedText(element_->name), row_, element_->count);
    at_ += size;
    return lines_.text().substr(at_ - size, size);
  }
  const MeshLines &lines_;
  bool big_;
  std::size_t at_;
  const Element *element_ = nullptr;
  std::size_t row_ = 0;
};

/// What a PLY file has of a mesh. Faces may be above the vertices, which are needed before anything is joined.
struct Polygons {
  std::vector<Vec3> points;
  std::vector<int> corners;      ///< those of all faces
  std::vector<std::size_t> ends; ///< behind the last of each face
};

void readCorners(Numbers &in, const NumberType &type, std::size_t size, std::size_t vertices, Polygons &out) {
  if (size < 3) in.fail(too_few_corners);
  for (std::size_t k = 0; k < size; ++k) {
    const double index = in.read(type);
    if (!(index >= 0 && index < double(vertices))) in.fail(namesVertex(std::to_string(std::int64_t(index)), vertices));
    out.corners.push_back(int(index));
  }
  out.ends.push_back(out.corners.size());
}

void readRow(Numbers &in, const Element &element, std::size_t vertices, Polygons &out) {
  Vec3 x = Vec3::Zero();
  for (const Property &p : element.properties) {
    const double size = p.count ? in.read(*p.count) : 1;
    if (size < 0) in.fail("the list " + quotedText(p.name) + " has a length below 0");
    if (p.role == Role::none)
      in.skip(*p.type, std::size_t(size));
    else if (p.role == Role::corners)
      readCorners(in, *p.type, std::size_t(size), vertices, out);
    else if (const double value = in.read(*p.type); isCoordinate(value))
      x[int(p.role) - int(Role::x)] = value;
    else
      in.fail("'" + p.name + "' is " + shortText(value) + ", which is not a coordinate");
  }
  if (element.name == "vertex") out.points.push_back(x);
}

} // namespace

bool MeshLines::next() {
  while (end_ < text_.size()) {
    const std::size_t start = end_, newline = text_.find('\n', start);
    end_ = newline == std::string_view::npos ? text_.size() : newline + 1;
    rest_ = text_.substr(start, end_ - start);
    rest_ = rest_.substr(0, rest_.find(comment_));
    ++number_;
    if (hasWords()) return true;
  }
  return false;
}

bool MeshLines::hasWords() const { return rest_.find_first_not_of(spaces) != std::string_view::npos; }

std::string_view MeshLines::word() {
  rest_.remove_prefix(std::min(rest_.find_first_not_of(spaces), rest_.size()));
  const std::string_view word = rest_.substr(0, rest_.find_first_of(spaces));
  rest_.remove_prefix(word.size());
  return word;
}

Vec3 MeshLines::point() {
  Vec3 x;
  for (int k = 0; k < 3; ++k) {
    const std::string_view next = word();
    if (next.empty()) fail("expected three coordinates");
    x[k] = numberOf(next, *this);
    if (!isCoordinate(x[k])) fail(quotedText(next) + " is not a coordinate");
  }
  return x;
}

std::size_t MeshLines::count(const std::string &what) {
  const std::string_view next = word();
  const auto count = wholeNumber(next);
  if (!count)
    fail(next.empty() ? "has no count of " + what + "; write how many there are"
                      : quotedText(next) + " is not a count of " + what + "; write a whole number, 0 or more");
  if (*count > text_.size())
    fail("says that there are " + std::to_string(*count) + " " + what + ", and the file has " +
         std::to_string(text_.size()) + " bytes: is it cut off?");
  return std::size_t(*count);
}

void MeshLines::fail(const std::string &message) const {
  throw SceneError(path_ + ":" + std::to_string(number_) + ": " + message);
}

void MeshLines::failFile(const std::string &message) const { throw SceneError(path_ + ": " + message); }

void MeshLines::failCutOff(const std::string &what, std::size_t found, std::size_t count) const {
  failFile("ends behind " + std::to_string(found) + " of " + std::to_string(count) + " " + what +
           ": is the file cut off?");
}

double numberOf(std::string_view word, const MeshLines &lines) {
  const std::string text(word);
  char *end = nullptr;
  const double x = std::strtod(text.c_str(), &end); // std::stod refuses what is smaller than a normal double
  if (text.empty() || end != text.c_str() + text.size()) lines.fail(quotedText(word) + " is not a number");
  return x;
}

std::optional<std::uint64_t> wholeNumber(std::string_view word) {
  std::uint64_t n = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), n);
  if (word.empty() || error != std::errc() || end != word.data() + word.size()) return {};
  return n;
}

bool isCoordinate(double x) { return std::abs(x) <= 1e100; }

std::string namesVertex(std::string_view word, std::size_t vertices) {
  return "a face names vertex " + quotedText(word) + ", and there are " + std::to_string(vertices) +
         ", with numbers from 0";
}

TriangleMesh readPly(const std::string &bytes, const std::string &path) {
  MeshLines lines(bytes, path);
  const Header header = readHeader(lines);
  std::unique_ptr<Numbers> in;
  if (header.format == "ascii")
    in = std::make_unique<TextNumbers>(lines);
  else
    in = std::make_unique<BinaryNumbers>(lines, header.format == "binary_big_endian");
  const Element *vertices = header.find("vertex");
  Polygons found;
  for (const Element &element : header.elements) {
    if (element.properties.empty()) continue; // its rows have nothing, whatever their count
    for (std::size_t row = 0; row < element.count; ++row) {
      in->startRow(element, row);
      readRow(*in, element, vertices ? vertices->count : 0, found);
      in->endRow();
    }
  }
  in->endFile();
  TriangleMesh mesh;
  MeshCorners corners(mesh);
  for (std::size_t begin = 0; const std::size_t end : found.ends) {
    corners.add(found.points, found.corners.data() + begin, end - begin);
    begin = end;
  }
  return mesh;
}

} // namespace tendril
