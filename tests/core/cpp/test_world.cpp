#include "arm.hpp"
#include "check.hpp"

using namespace optiplan;

TEST(the_nearest_pair_of_the_stretched_arm) {
    const World world = arm_and_box();
    const double q[2] = {0.0, 0.0};
    Placement at = world.placement();
    world.place(q, at);
    NEAR(world.nearest(at).witness.distance, 0.85, 1e-9);
    CHECK(!world.collides(at));
    const double through[2] = {M_PI / 4, 0.0};
    CHECK(collides(world, through));
}

TEST(bounds_lie_below_distances_and_gradients_are_differences) {
    const World world = arm_and_box();
    const double h = 1e-6;
    int compared = 0;
    for (int k = 0; k < 100; ++k) {
        const double q[2] = {uniform(-3, 3), uniform(-3, 3)};
        Placement at = world.placement();
        world.place(q, at);
        for (int pair = 0; pair < 2; ++pair) {
            const Witness found = world.distance(at, pair, HUGE_VAL);
            CHECK(world.lower_bound(at, pair) <= found.distance + 1e-12);
            CHECK(world.within(at, pair, found.distance + 1e-6));
            if (found.distance < 0.01) continue;
            CHECK(!world.within(at, pair, found.distance - 1e-6));
            double slope[2];
            world.gradient(at.joints.data(), {0, pair, found}, slope);
            const double first = (distance_at(world, pair, q[0] + h, q[1]) - distance_at(world, pair, q[0] - h, q[1]));
            const double second = (distance_at(world, pair, q[0], q[1] + h) - distance_at(world, pair, q[0], q[1] - h));
            NEAR(slope[0], first / (2 * h), 1e-4);
            NEAR(slope[1], second / (2 * h), 1e-4);
            ++compared;
        }
    }
    CHECK(compared > 100);
}
