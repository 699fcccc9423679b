#include "convex/triangle_mesh.hpp"

#include <stdexcept>

#include "check.hpp"

namespace optiplan::test_triangle_mesh {

// The surface of the box of half edges 0.1, 0.2, 0.3.
static TriangleMesh surface() {
    std::vector<Vec3> corners;
    for (int k = 0; k < 8; ++k) corners.push_back({k & 1 ? 0.1 : -0.1, k & 2 ? 0.2 : -0.2, k & 4 ? 0.3 : -0.3});
    std::vector<TriangleMesh::Corners> faces;
    const std::uint32_t squares[6][4] = {{0, 2, 4, 6}, {1, 3, 5, 7}, {0, 1, 4, 5},
                                         {2, 3, 6, 7}, {0, 1, 2, 3}, {4, 5, 6, 7}};
    for (const auto &s : squares) faces.push_back({s[0], s[1], s[2]}), faces.push_back({s[1], s[2], s[3]});
    return {corners, faces};
}

TEST(distances_of_points_are_those_of_the_surface) {
    const TriangleMesh mesh = surface();
    const double half[3] = {0.1, 0.2, 0.3};
    for (int k = 0; k < 300; ++k) {
        const Vec3 p{uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.5, 0.5)};
        double squared = 0.0, inside = HUGE_VAL;
        for (int axis = 0; axis < 3; ++axis) {
            const double beyond = std::fabs(p[axis]) - half[axis];
            squared += beyond > 0.0 ? beyond * beyond : 0.0;
            inside = std::fmin(inside, -beyond);
        }
        const double expected = squared > 0.0 ? std::sqrt(squared) : inside;
        NEAR(mesh.distance(Shape::sphere(0.05), {{}, p}, HUGE_VAL, 0.0).distance, expected, 1e-9);
    }
}

TEST(heights_above_planes_and_broken_meshes) {
    NEAR(surface().above({0, 0, 1}, 0.1).distance, -0.4, 1e-12);
    NEAR(surface().above({0, 1, 0}, -1.0).distance, 0.8, 1e-12);
    int refused = 0;
    for (const std::vector<TriangleMesh::Corners> &faces :
         {std::vector<TriangleMesh::Corners>{}, std::vector<TriangleMesh::Corners>{{0, 1, 7}}}) {
        try {
            TriangleMesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, faces);
        } catch (const std::invalid_argument &) { ++refused; }
    }
    CHECK(refused == 2);
}

}  // namespace optiplan::test_triangle_mesh
