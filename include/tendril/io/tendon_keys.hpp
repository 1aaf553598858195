#pragma once
/// \file tendon_keys.hpp
/// The keys of tendons and of what pulls on them.

#include "tendril/io/key.hpp"

namespace tendril {

inline constexpr Key tendon_keys[] = {
    {"tendons", KeyType::list, "", "(none)",
     "cords without mass or thickness over points of bodies, rods and the world, and sums of joints' coordinates"},
    {"tendons[].name", KeyType::text, "", "(tendon0, tendon1, ...)", "for files and messages", anything, "", "flexor"},
    {"tendons[].path", KeyType::list, "", "required",
     "what it runs through, in order: points (body, or rod) with straight parts between those that follow each other, "
     "what such a part winds round (cylinder, sphere), and joints, whose coordinates add to its length"},
    {"tendons[].path[].body", KeyType::text, "", "(a point, rod, joint, cylinder or sphere)",
     "a point of this body, by its name or number, or of the world", anything, "", "cube"},
    {"tendons[].path[].point", KeyType::vector, "m", "(position of the body)",
     "where it is as drawn, in the axes of the scene; of a cylinder a point of its axis, of a sphere its middle",
     anything, "", "[0.1, 0.05, 0]"},
    {"tendons[].path[].rod", KeyType::rod, "", "(a body, joint, cylinder or sphere)", "a point of this rod", anything,
     "", "0"},
    {"tendons[].path[].vertex", KeyType::index, "", "(or edge)", "which vertex of the rod", not_negative, "", "last"},
    {"tendons[].path[].edge", KeyType::index, "", "(or vertex)", "the middle of which edge of the rod", not_negative,
     "", "last"},
    {"tendons[].path[].offset", KeyType::pair, "m", "[0, 0]",
     "from the middle of the edge along its first and second director", anything, "", "[0.01, 0]"},
    {"tendons[].path[].joint", KeyType::text, "", "(a body, rod, cylinder or sphere)",
     "a hinge, or a joint that slides, by its name", anything, "", "elbow"},
    {"tendons[].path[].coefficient", KeyType::number, "1, m/rad", "1",
     "what the joint's coordinate is multiplied by: a lever arm, the radius of a pulley or drum", anything, "",
     "-0.05"},
    {"tendons[].path[].cylinder", KeyType::text, "", "(a body, rod, joint or sphere)",
     "the body or the world that carries a cylinder without ends, round which the part between the points before and "
     "behind winds where it is in the way",
     anything, "", "cube"},
    {"tendons[].path[].sphere", KeyType::text, "", "(a body, rod, joint or cylinder)", "the same of a sphere", anything,
     "", "cube"},
    {"tendons[].path[].radius", KeyType::number, "m", "(that of the body's shape)", "of the cylinder or sphere",
     positive, "", "0.02"},
    {"tendons[].path[].axis", KeyType::vector, "", "[0, 0, 1]", "of the cylinder as drawn, of any length", anything, "",
     "[0, 1, 0]"},
    {"tendons[].path[].side", KeyType::integer, "", "0",
     "of the cylinder: 0 the nearer one; 1 anticlockwise about the axis from the point before to the point behind, -1 "
     "clockwise, up to three quarters of a turn",
     Bounds{-1, 1}, "", "1"},
    {"tendons[].path[].friction", KeyType::number, "", "(that of the tendon)",
     "coefficient of the tendon on this point, cylinder or sphere", not_negative, "", "0.3"},
    {"tendons[].friction", KeyType::number, "", "0",
     "coefficient on all points between the first and the last, and on what it winds round: where it slides over a "
     "turn "
     "by an angle, the tension changes by the factor exp(friction times angle); the first entry is the actuator's end",
     not_negative, "", "0.3"},
    {"tendons[].slip_length", KeyType::number, "m", "(1e-4 of the length as drawn)",
     "way over which friction comes to its limit", positive, "", "1e-4"},
    {"tendons[].displacement", KeyType::map, "", "(none)",
     "an actuator: a spring with a damper, which draws the tendon's displacement, 0 as drawn, to a target"},
    {"tendons[].displacement.stiffness", KeyType::number, "N/m", "required",
     "of the spring, EA over the length of a cord", not_negative, "", "1e4"},
    {"tendons[].displacement.damping", KeyType::number, "N s/m", "0", "of the damper", not_negative, "", "10"},
    {"tendons[].displacement.target", KeyType::number, "m", "0",
     "displacement at which the spring is slack: a negative one pulls the tendon in", anything, "", "-0.05"},
    {"tendons[].displacement.table", KeyType::profile, "s, m", "(target)",
     "rows of [time, target]; linear between rows, at rest outside; in statics time is the load factor", anything, "",
     "[[0, 0], [1, -0.05]]"},
    {"tendons[].displacement.compression", KeyType::flag, "", "false", "whether it may push, too", anything, "",
     "true"},
    {"tendons[].force", KeyType::map, "", "(none)", "an actuator: a tension that is given"},
    {"tendons[].force.tension", KeyType::number, "N", "(or table)", "whatever the displacement is", not_negative, "",
     "10"},
    {"tendons[].force.table", KeyType::profile, "s, N", "(tension)",
     "rows of [time, tension], as those of a displacement", anything, "", "[[0, 0], [1, 10]]"},
    {"tendons[].mckibben", KeyType::map, "", "(none)",
     "an actuator: a McKibben muscle, tension p b^2/(4 pi n^2) (3 L^2/b^2 - 1) at length L, nowhere negative"},
    {"tendons[].mckibben.braid_length", KeyType::number, "m", "required", "b: of a thread of the braid", positive, "",
     "0.25"},
    {"tendons[].mckibben.turns", KeyType::number, "", "required", "n: of a thread about the muscle", positive, "",
     "1.5"},
    {"tendons[].mckibben.length", KeyType::number, "m", "(that of the path)", "L as drawn", positive, "", "0.2"},
    {"tendons[].mckibben.minimum_pressure", KeyType::number, "Pa", "0", "p is what the pressure is above it",
     not_negative, "", "2e4"},
    {"tendons[].mckibben.pressure", KeyType::number, "Pa", "(or table)", "in the muscle", not_negative, "", "1e5"},
    {"tendons[].mckibben.table", KeyType::profile, "s, Pa", "(pressure)",
     "rows of [time, pressure], as those of a displacement", anything, "", "[[0, 0], [1, 1e5]]"},
    {"tendons[].mckibben.damping", KeyType::number, "N s/m", "0", "tension over the rate of the length", not_negative,
     "", "10"},
};

} // namespace tendril
