#include "world/parts.hpp"

#include "check.hpp"

namespace optiplan::test_parts {

// A beam of half edges `half` about `centre`, as the hull of its corners.
static ConvexPart beam(const Vec3 &centre, const Vec3 &half) {
    std::vector<Vec3> corners;
    for (int k = 0; k < 8; ++k)
        corners.push_back(centre + Vec3{k & 1 ? half.x : -half.x, k & 2 ? half.y : -half.y, k & 4 ? half.z : -half.z});
    return ConvexPart::hull(Shape::convex_hull(corners));
}

// By `a` about z, then by `b` about the turned x, rad.
static Mat3 turn(double a, double b) {
    const Mat3 about_z{{{std::cos(a), -std::sin(a), 0}, {std::sin(a), std::cos(a), 0}, {0, 0, 1}}};
    const Mat3 about_x{{{1, 0, 0}, {0, std::cos(b), -std::sin(b)}, {0, std::sin(b), std::cos(b)}}};
    return about_z * about_x;
}

// Two beams of 1 m, along x and y, that meet in the origin.
static std::vector<ConvexPart> angle() {
    return {beam({0.5, 0, 0}, {0.5, 0.05, 0.05}), beam({0, 0.5, 0}, {0.05, 0.5, 0.05})};
}

TEST(parts_are_within_where_the_nearest_two_are) {
    const std::vector<ConvexPart> one = angle(), two = angle();
    int within = 0;
    for (int k = 0; k < 2000; ++k) {
        const Pose X{turn(uniform(-3, 3), uniform(-3, 3)), {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}};
        double nearest = HUGE_VAL;
        for (const ConvexPart &a : one)
            for (const ConvexPart &b : two) nearest = std::fmin(nearest, distance(a.shape, {}, b.shape, X).distance);
        const double margin = uniform(0.0, 0.2);
        if (std::fabs(nearest - margin) < 1e-9) continue;
        CHECK(parts_within(one, {}, two, X, margin) == (nearest < margin));
        within += nearest < margin;
    }
    CHECK(within > 200 && within < 1800);
}

TEST(bodies_without_parts_are_told_by_none) {
    CHECK(parts_within({}, {}, angle(), {{}, {9, 9, 9}}, 0.0));
    CHECK(!parts_within(angle(), {}, angle(), {{}, {9, 9, 9}}, 0.0));
}

}  // namespace optiplan::test_parts
