#include "control/clearance_watch.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_clearance_watch {

static ClearanceWatch watch(const World &world) {
    return {world, arms(), {1.05, 0.2, 1.05, 0.2}, {{1.0, 1.0}, {0.0, 0.0}}, {{0.5, 0.5}, 1.2}};
}

TEST(views_bound_all_distances_and_know_the_near_ones) {
    const World world = arm_and_box();
    ClearanceWatch watched = watch(world);
    View before;
    for (int k = 0; k < 100; ++k) {
        const double q[2] = {0.3 + 0.2 * std::sin(0.1 * k), 0.4 * std::cos(0.13 * k)};
        const View view = watched.look(q, k ? &before : nullptr);
        for (int pair = 0; pair < 2; ++pair) {
            const double distance = distance_at(world, pair, q[0], q[1]);
            CHECK(view.bound[pair] <= distance + 1e-7);
            bool seen = false;
            for (std::size_t i = 0; i < view.near.size(); ++i) {
                if (view.near[i] != pair) continue;
                seen = true;
                NEAR(view.distance[i], distance, 1e-7);
            }
            CHECK(seen || distance > 0.5 - 1e-9);
        }
        before = view;
    }
}

TEST(a_stop_into_the_box_is_not_clear) {
    const World world = arm_and_box();
    ClearanceWatch watched = watch(world);
    const double q[2] = {0.5, 0.0}, none[2] = {0.0, 0.0}, least[2] = {0.005, 0.005};
    const double limit[2] = {3.0, 3.0}, jerk[2] = {100.0, 100.0};
    const View view = watched.look(q, nullptr);
    for (double speed : {-1.0, 0.0, 2.5}) {
        const double v[2] = {speed, 0.0};
        StopPath path;
        path.start(q, v, none, limit, jerk, 2, 0.01);
        CHECK(watched.stop_is_clear(path, view, least) == (speed < 1.0));
    }
    const double lost[2] = {NAN, 0.0}, open[2] = {-0.1, -0.1};
    View unknown = watched.look(q, nullptr);
    unknown.near.clear(), unknown.distance.clear();
    unknown.bound.assign(2, NAN);
    StopPath still, nowhere;
    still.start(q, none, none, limit, jerk, 2, 0.01), nowhere.start(lost, none, none, limit, jerk, 2, 0.01);
    CHECK(watched.stop_is_clear(still, unknown, open));  // it is measured
    CHECK(!watched.stop_is_clear(nowhere, unknown, open));
    CHECK(watched.look(q, &unknown).near == watched.look(q, nullptr).near);
}

}  // namespace optiplan::test_clearance_watch
