#include "search/shortcuts.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_shortcuts {

static const EdgeRules RULES{0.1, 0.0, 1e-4, 100000, 0.1};
static const Configuration VELOCITY{1.0, 2.0};

static double time_of(const Path &path) {
    double sum = 0.0;
    for (std::size_t k = 0; k + 1 < path.size(); ++k) sum += path_time(path[k], path[k + 1], VELOCITY);
    return sum;
}

TEST(the_time_is_that_of_the_slowest_joint_and_a_tenth_of_the_norm) {
    NEAR(path_time({0.0, 0.0}, {3.0, 8.0}, VELOCITY), 4.0 + 0.1 * 5.0, 1e-14);
}

TEST(needless_corners_go_and_needed_ones_stay) {
    const World world = arm_and_box();
    EdgeChecker check(world, arms(), {}, RULES);
    Path needless{{0.0, 0.0}, {-0.5, 1.0}, {-1.0, 0.0}};
    drop_corners(check, needless, VELOCITY, [] { return false; });
    CHECK(needless.size() == 2);
    Path around{{0.0, 0.0}, {-1.0, 0.0}, {-1.0, 2.8}, {1.57, 2.8}, {1.57, 0.0}};
    for (std::size_t k = 0; k + 1 < around.size(); ++k) CHECK(check.free(around[k].data(), around[k + 1].data()));
    drop_corners(check, around, VELOCITY, [] { return false; });
    CHECK(around.size() > 2);
}

TEST(shortcuts_stay_free_and_never_take_longer) {
    const World world = arm_and_box();
    EdgeChecker check(world, arms(), {}, RULES);
    Path path{{0.0, 0.0}, {-1.0, 0.0}, {-1.0, 2.8}, {1.57, 2.8}, {1.57, 0.0}};
    const double before = time_of(path);
    for (int k = 0; k < 100; ++k) {
        const double draw[3] = {uniform(0, 1), uniform(0, 1), uniform(0, 1)}, last = time_of(path);
        attempt_shortcut(check, path, VELOCITY, draw);
        CHECK(time_of(path) <= last + 1e-12);
    }
    CHECK(time_of(path) < 0.95 * before);
    CHECK(path.front() == Configuration({0.0, 0.0}) && path.back() == Configuration({1.57, 0.0}));
    for (std::size_t k = 0; k + 1 < path.size(); ++k) CHECK(check.free(path[k].data(), path[k + 1].data()));
}

}  // namespace optiplan::test_shortcuts
