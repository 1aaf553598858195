#include "tendril/io/xdmf.hpp"

#include "tendril/io/hdf5.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace tendril {
namespace {

/// One frame of a block, in which the mark '@' stands for its number and '#' for its time.
std::string frameOf(const XdmfBlock &block, std::size_t frames) {
  std::ostringstream out;
  auto dataset = [&](const std::string &name, const std::string &shape, const char *type, int bytes) {
    out << "<DataItem Dimensions=\"" << shape << "\" NumberType=\"" << type << "\" Precision=\"" << bytes
        << "\" Format=\"HDF\">trajectory.h5:/" << name << "</DataItem>\n";
  };
  // One frame out of a dataset (nt, n[, c]), or one of its components. ParaView takes the first text in here as the
  // geometry's name: it keeps what it read under that name, and complains when there is none.
  auto slab = [&](const XdmfField &f, const std::string &name, int component = -1) {
    const std::string n = std::to_string(f.rows);
    std::string shape = n;
    if (f.components > 1) shape.append(" ").append(std::to_string(f.components));
    const std::string part = component < 0 ? shape : n + " 1";
    out << "     <DataItem ItemType=\"HyperSlab\" Dimensions=\"" << (component < 0 ? shape : n) << "\"><!-- " << name
        << " @ --><DataItem Dimensions=\"3 " << (f.components > 1 ? 3 : 2) << "\" Format=\"XML\">@ 0 ";
    if (f.components > 1) out << std::max(component, 0) << " 1 ";
    out << "1 1 1 " << part << "</DataItem>";
    dataset("state/" + f.name, std::to_string(frames) + " " + shape, "Float", 8);
    out << "     </DataItem>\n";
  };
  auto attribute = [&](const XdmfField &f, int component = -1) {
    out << "    <Attribute Name=\"" << f.name;
    if (component >= 0) out << "_" << component + 1;
    out << "\" AttributeType=\"" << (f.components == 3 ? "Vector" : "Scalar") << "\" Center=\""
        << (f.of_cells ? "Cell" : "Node") << "\">\n";
    slab(f, "frame", component);
    out << "    </Attribute>\n";
  };
  out << "   <Grid GridType=\"Uniform\">\n    <Time Value=\"#\"/>\n    <Topology TopologyType=" << block.cell_type
      << ">";
  dataset(block.cells, block.cells_shape, "Int", 4);
  out << "    </Topology>\n    <Geometry GeometryType=\"XYZ\">\n";
  slab(block.position, block.geometry);
  out << "    </Geometry>\n";
  if (block.has_radius) {
    out << "    <Attribute Name=\"radius\" AttributeType=\"Scalar\" Center=\"Node\">\n     ";
    dataset("reference/radius", std::to_string(block.position.rows), "Float", 8);
    out << "    </Attribute>\n";
  }
  for (const XdmfField &f : block.fields)
    if (f.components == 1 || f.components == 3)
      attribute(f);
    else
      for (int component = 0; component < f.components; ++component) attribute(f, component);
  out << "   </Grid>\n";
  return out.str();
}

} // namespace

/// In the form of ParaView's "XDMF Reader".
void writeXdmf(const std::string &path, const std::vector<XdmfBlock> &blocks, const std::vector<double> &times) {
  std::ofstream out(path + ".part");
  out << "<?xml version=\"1.0\"?>\n<!-- In ParaView choose \"XDMF Reader\"; its Xdmf3 readers do not know HyperSlab. "
         "-->\n<Xdmf Version=\"3.0\">\n <Domain>\n";
  for (const XdmfBlock &block : blocks) {
    out << "  <Grid Name=\"" << block.name << "\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
    const std::string pattern = frameOf(block, times.size());
    std::string text;
    for (std::size_t frame = 0; frame < times.size(); ++frame) {
      char time[32];
      std::snprintf(time, sizeof time, "%.17g", times[frame]);
      const std::string number = std::to_string(frame);
      text.clear();
      for (std::size_t at = 0; at < pattern.size();) {
        const std::size_t mark = std::min(pattern.find_first_of("@#", at), pattern.size());
        text.append(pattern, at, mark - at);
        if (mark < pattern.size()) text += pattern[mark] == '@' ? number.c_str() : time;
        at = mark + 1;
      }
      out << text;
    }
    out << "  </Grid>\n";
  }
  out << " </Domain>\n</Xdmf>\n";
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(path + ".part", path, error);
  if (out && !error) return;
  std::filesystem::remove(path + ".part", error);
  throw WriteError(path + ": cannot be written; is the disk full?");
}

} // namespace tendril
