#include "arm.hpp"
#include "check.hpp"
#include "world/many_checks.hpp"

namespace optiplan::test_many_checks {

TEST(many_configurations_touch_where_each_does) {
    const World world = arm_and_box();
    std::vector<double> Q;
    for (int k = 0; k < 2 * 1003; ++k) Q.push_back(uniform(-4, 4));
    std::vector<std::uint8_t> found(1003);
    ManyChecks(world).touching(Q.data(), found.size(), found.data());
    int touching = 0;
    for (std::size_t k = 0; k < found.size(); ++k) {
        CHECK((found[k] == 1) == collides(world, Q.data() + 2 * k));
        touching += found[k];
    }
    CHECK(touching > 5 && touching < 950);
}

TEST(pairs_that_touch_change_places_and_no_answer) {
    std::vector<Body> bodies{body(1, Shape::sphere(0.03), {{}, {1, 0, 0}}, {0.03, 0.03, 0.03}),
                             body(2, Shape::sphere(0.03), {{}, {1, 0, 0}}, {0.03, 0.03, 0.03})};
    std::vector<std::pair<int, int>> pairs;
    const Vec3 half{0.01, 0.03, 0.1};
    for (int k = 2; k < 42; ++k) {
        bodies.push_back(body(0, Shape::box(half), {{}, {uniform(-2, 2), uniform(-2, 2), 0}}, half));
        pairs.push_back({0, k}), pairs.push_back({1, k});
    }
    const World world(arm(), bodies, pairs);
    ManyChecks checks(world);
    int touching = 0;
    for (int k = 0; k < 300; ++k) {
        double q[2 * LANES];
        bool any = false;
        for (double &one : q) one = uniform(-3, 3);
        for (int lane = 0; lane < LANES; ++lane) any = any || collides(world, q + 2 * lane);
        CHECK(checks.any_touches(q) == any);
        touching += any;
    }
    CHECK(touching > 50 && touching < 250);
}

TEST(poses_in_lanes_are_those_of_one) {
    Tree tree = arm();
    tree.joints[1].axis = {0.6, 0.0, 0.8};
    tree.joints.push_back({2, {{}, {0.1, 0.2, 0.3}}, false, {0, 0.6, 0.8}, 0, -0.5, 0.1, 1.0, {}, {}});
    for (double size : {1.0, 30.0, 3e4, 1e7}) {
        double q[2 * LANES];
        for (double &one : q) one = uniform(-size, size);
        PoseLanes lanes[4];
        Pose poses[4];
        poses_in_lanes(tree, q, lanes);
        for (int lane = 0; lane < LANES; ++lane) {
            tree.poses(q + 2 * lane, poses);
            for (int j = 0; j < 4; ++j) {
                const Pose one = lane_of(lanes[j], lane);
                for (int i = 0; i < 3; ++i) NEAR(norm(one.R.rows[i] - poses[j].R.rows[i]), 0.0, 1e-14);
                NEAR(norm(one.p - poses[j].p), 0.0, 1e-14 * (1.0 + size));
            }
        }
    }
}

}  // namespace optiplan::test_many_checks
