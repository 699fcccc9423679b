#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_world {

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

namespace {

// What a world with a tube tells at q, beside what one without tells anywhere in the tube.
void compare(const World &wide, const World &exact, const double *error, const double *q, int &apart) {
    Placement at = wide.placement(), there = exact.placement();
    wide.place(q, at);
    double least[2] = {1e9, 1e9};
    for (int i = -4; i <= 4; ++i)
        for (int k = -4; k <= 4; ++k) {
            const double moved[2] = {q[0] + 0.25 * i * error[0], q[1] + 0.25 * k * error[1]};
            exact.place(moved, there);
            for (int pair : {0, 1}) least[pair] = std::min(least[pair], exact.distance(there, pair, 1e3).distance);
        }
    bool touches = false;
    for (int pair : {0, 1}) {
        const double told = wide.distance(at, pair, 1e3).distance;
        CHECK(told <= least[pair] + 1e-9);
        CHECK(wide.lower_bound(at, pair) <= least[pair] + 1e-9);
        CHECK(wide.gap(at, pair, 1e3) <= least[pair] + 1e-9);
        CHECK(wide.nearest_points(at, pair, 1e3).distance <= least[pair] + 1e-9);
        if (wide.balls_apart(at, pair, 0.05)) CHECK(least[pair] > 0.05);
        CHECK(wide.within(at, pair, 0.02) == (told <= 0.02) || std::fabs(told - 0.02) < 1e-6);
        touches |= told <= 0.0;
        if (told > 0.0) ++apart;
        if (least[pair] > 0.2) CHECK(told > 0.8 * least[pair] - 0.05);  // and takes hardly more than that
    }
    CHECK(wide.collides(at) == touches);
}

}  // namespace

TEST(distances_in_a_tube_are_below_all_that_are_met_there) {
    const double error[2] = {0.02, 0.03};
    const TubeError tube{{error[0], error[1]}, {1.1 * error[0], 2.1 * error[0] + 1.1 * error[1]}};
    const World wide = arm_and_box({1.0, 1.0, 0.0}, tube), exact = arm_and_box();
    int apart = 0;
    for (double a = -1.5; a < 2.5; a += 0.17)
        for (double b = -2.5; b < 2.5; b += 0.23) {
            const double q[2] = {a, b};
            compare(wide, exact, error, q, apart);
        }
    CHECK(apart > 300);
}

TEST(a_pair_whose_tube_takes_nothing_keeps_its_distance) {
    const World wide = arm_and_box({1.0, 1.0, 0.0}, {{0.02, 0.03}, {0.0, 0.1}}), exact = arm_and_box();
    const double q[2] = {0.4, 0.2};
    Placement at = wide.placement(), there = exact.placement();
    wide.place(q, at), exact.place(q, there);
    CHECK(wide.distance(at, 0, 1e3).distance == exact.distance(there, 0, 1e3).distance);
    CHECK(wide.distance(at, 1, 1e3).distance < exact.distance(there, 1, 1e3).distance - 0.01);
}

}  // namespace optiplan::test_world
