#include "convex/convex.hpp"

#include "check.hpp"
#include "convex/triangle_mesh.hpp"

namespace optiplan::test_convex {

static Pose at(double x, double y, double z) { return {{}, {x, y, z}}; }

TEST(closed_forms) {
    const Shape ball = Shape::sphere(0.1), box = Shape::box({0.2, 0.3, 0.4}), pill = Shape::capsule(0.05, 0.5);
    NEAR(distance(ball, at(1, 0, 0), ball, at(0, 0, 0)).distance, 0.8, 1e-12);
    NEAR(distance(box, {}, ball, at(0.5, 0.0, 0.1)).distance, 0.2, 1e-12);
    NEAR(distance(ball, at(0.15, 0, 0), box, {}).distance, -0.15, 1e-9);  // 5 cm inside, and its radius
    NEAR(distance(pill, {}, pill, at(0.3, 0.4, 0.2)).distance, 0.4, 1e-12);
    NEAR(distance(box, at(0, 0, 1), Shape::half_space({0, 0, 1}, 0.1), {}).distance, 0.5, 1e-12);
}

TEST(points_and_normal_agree_and_order_does_not_matter) {
    const Shape shapes[4] = {Shape::box({0.2, 0.3, 0.1}), Shape::capsule(0.05, 0.3), Shape::cylinder(0.2, 0.1),
                             Shape::convex_hull({{0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 0.3}})};
    for (int k = 0; k < 200; ++k) {
        const Shape &a = shapes[k % 4], &b = shapes[(k / 4) % 4];
        const Pose X = at(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
        const Witness found = distance(a, {}, b, X), back = distance(b, X, a, {});
        NEAR(found.distance, back.distance, 1e-8);
        NEAR(norm(found.normal), 1.0, 1e-9);
        NEAR(norm(found.b - found.a - found.distance * found.normal), 0.0, 1e-8);
        if (found.distance < 1e-6) continue;
        const Shape point = Shape::sphere(0.0);  // the nearest points lie on their shapes
        NEAR(distance(point, {{}, found.a}, a, {}).distance, 0.0, 1e-7);
        NEAR(distance(point, {{}, found.b}, b, X).distance, 0.0, 1e-7);
        CHECK(overlap_within(a, {}, b, X, found.distance + 1e-6));
        CHECK(!overlap_within(a, {}, b, X, found.distance - 1e-6));
    }
}

TEST(a_sliver_about_a_point_is_touched_and_not_deep) {  // 14 cm long, 0.3 nm wide
    const Shape sliver = Shape::convex_hull({{0.0027924397589043472, -0.0026082824293763201, 0.0018292703369698507},
                                             {0.06634709776827391, -0.061971603257206513, 0.043462631201015997},
                                             {-0.072709560873397069, 0.067914471394359785, -0.047630550429631484}});
    const Pose turned{{{{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}}, {}};
    const Witness found = distance(Shape::capsule(0.0, 0.0), {}, sliver, turned);
    NEAR(found.distance, 0.0, 1e-9);
    NEAR(norm(found.normal), 1.0, 1e-9);
    for (int k = 0; k < 2000; ++k) {
        const double width = std::pow(10.0, uniform(-12, -6));
        std::vector<Vec3> points;
        for (int i = 0; i < 3; ++i) points.push_back({uniform(-1, 1), width * uniform(-1, 1), width * uniform(-1, 1)});
        const double c = std::cos(k), s = std::sin(k);
        const Pose X{{{{c, -s, 0}, {s * c, c * c, -s}, {s * s, s * c, c}}}, {}};
        const Pose there{{}, -(X * ((1.0 / 3.0) * (points[0] + points[1] + points[2])))};
        const Witness at_middle = distance(Shape::capsule(0.0, 0.0), {}, Shape::convex_hull(points), there * X);
        NEAR(at_middle.distance, 0.0, 1e-5);
    }
}

TEST(shapes_at_no_number_are_not_apart) {
    const std::vector<Vec3> corners{{0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 0.3}};
    const std::vector<TriangleMesh::Corners> triangles{{0, 1, 2}, {1, 2, 3}};
    const Shape shapes[7] = {Shape::sphere(0.1),
                             Shape::capsule(0.05, 0.3),
                             Shape::box({0.2, 0.3, 0.1}),
                             Shape::cylinder(0.2, 0.1),
                             Shape::convex_hull(corners),
                             Shape::triangles(std::make_shared<TriangleMesh>(corners, triangles)),
                             Shape::half_space({0, 0, 1}, 0.1)};
    for (const Shape &a : shapes)
        for (const Shape &b : shapes) CHECK(overlap_within(a, at(NAN, 0, 0), b, at(3, 3, 3), 0.0));
}

}  // namespace optiplan::test_convex
