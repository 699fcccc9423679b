#include "control/stop_path.hpp"

#include "check.hpp"

namespace optiplan::test_stop_path {

TEST(the_path_ends_at_rest_and_its_accelerations_are_bounded) {
    for (int k = 0; k < 50; ++k) {
        const double q[2] = {0.3, -0.2}, v[2] = {uniform(-2, 2), uniform(-2, 2)}, limit[2] = {3.0, 4.0};
        const double a[2] = {uniform(-3, 3), uniform(-4, 4)}, jerk[2] = {60.0, 80.0}, dt = 0.004;
        StopPath path;
        path.start(q, v, a, limit, jerk, 2, dt);
        double here[2], speed[2], start[2];
        path.at(0, start);
        path.at(path.steps, here, speed);
        for (int j = 0; j < 2; ++j) {
            CHECK(start[j] == q[j]);
            NEAR(here[j], path.end[j], 1e-9);
            NEAR(speed[j], 0.0, 1e-9);
            CHECK(path.strongest(j, 0, path.steps) <= limit[j] * (1 + 1e-9));
        }
        for (int step = 0; step <= path.steps; ++step) {
            path.at(step, here, speed);
            for (int j = 0; j < 2; ++j) CHECK(std::fabs(here[j] - q[j]) <= path.way[j] + 1e-9);
        }
    }
}

TEST(joints_that_do_not_brake_are_carried_along) {
    const double q[1] = {0.0}, v[1] = {0.1}, a[1] = {0.0}, limit[1] = {3.0}, jerk[1] = {60.0};
    StopPath path;
    path.start(q, v, a, limit, jerk, 1, 0.01);
    path.carry({{{1.0, 2.0, -1.0}, 0.5}}, 2.0);
    CHECK(path.size() == 2 && path.steps >= 200 && path.end.size() == 2);
    double here[2];
    path.whole(20, here);
    NEAR(here[1], 1.0 + 2.0 * 0.2 - 0.04, 1e-12);
    path.whole(150, here);
    NEAR(here[1], path.drifts[0].at(0.5), 1e-12);
    CHECK(path.way[1] >= std::fabs(path.drifts[0].at(0.5) - 1.0) - 1e-12);
}

TEST(what_has_ended_its_way_stands_still) {
    const Drift ended{{0.4, 0.0, 0.0, 0.0, 0.0}, 0.0}, cubic{{0.4, 1.0, -2.0, 3.0}, 2.0};
    CHECK(ended.strongest(0.0, 0.4) == 0.0 && ended.way(0.4) == 0.0 && ended.at(0.4) == 0.4);
    NEAR(cubic.strongest(0.1, 0.5), 2.0 * 2.0 + 6.0 * 3.0 * 0.5, 1e-12);
}

}  // namespace optiplan::test_stop_path
