// Shapes of bodies, each in its own frame, lengths in m.
#pragma once

#include <cstdint>
#include <memory>

#include "../pose.hpp"
#include "hull.hpp"

namespace optiplan {

class TriangleMesh;

// In the order in which a pair is sorted before it is asked.
enum class Kind : std::uint8_t { sphere, capsule, box, cylinder, hull, mesh, half_space };

struct Shape {
    Kind kind = Kind::sphere;
    double radius = 0.0;       // sphere, capsule, cylinder
    double half_length = 0.0;  // capsule (without its caps), cylinder; along z
    Vec3 half;                 // box: half edges
    Vec3 normal;               // half-space: all points with normal . p <= offset are solid; unit length
    double offset = 0.0;
    std::shared_ptr<const Hull> hull;
    std::shared_ptr<const TriangleMesh> mesh;

    static Shape sphere(double radius);
    static Shape capsule(double radius, double half_length);
    static Shape box(const Vec3 &half);
    static Shape cylinder(double radius, double half_length);
    static Shape convex_hull(std::vector<Vec3> points);
    static Shape half_space(const Vec3 &normal, double offset);
    static Shape triangles(std::shared_ptr<const TriangleMesh> mesh);
};

}  // namespace optiplan
