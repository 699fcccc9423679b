// Triangles in a tree of boxes.
#pragma once

#include <array>
#include <vector>

#include "witness.hpp"
#include "shape.hpp"

namespace optiplan {

// The surface that triangles make; it encloses nothing.
//
// Distances are in the mesh's frame, A being the mesh, and to the core of the other shape. Where a triangle meets it
// they are 0, with a point that both have in common: triangles do not tell how deep, or which way is out. Above
// `cutoff` (m) they are lower bounds; any pair of points at most `enough` (m) apart ends the search.
class TriangleMesh {
  public:
    using Corners = std::array<std::uint32_t, 3>;

    // Throws std::invalid_argument without triangles, for vertices that are not there and numbers that are not finite.
    TriangleMesh(const std::vector<Vec3> &vertices, const std::vector<Corners> &triangles);

    Witness distance(const Shape &convex, const Pose &X_AB, double cutoff, double enough) const;
    Witness distance(const TriangleMesh &other, const Pose &X_AB, double cutoff, double enough) const;

    // To the points with n . p <= offset: the height of the lowest point, negative below the plane.
    Witness above(const Vec3 &n, double offset) const;

  private:
    struct Node {
        Vec3 centre, half;   // of a box along the axes that holds its triangles
        std::uint32_t child; // the second one (the first follows its parent); of a leaf its triangle
        bool leaf;
    };
    struct Triangle {
        Vec3 corners[3];
    };

    void build(std::vector<Triangle>::iterator first, std::vector<Triangle>::iterator end);

    std::vector<Node> nodes_;
    std::vector<Triangle> triangles_;
};

}  // namespace optiplan
