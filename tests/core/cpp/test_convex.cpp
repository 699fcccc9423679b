#include "convex/convex.hpp"

#include "check.hpp"

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

}  // namespace optiplan::test_convex
