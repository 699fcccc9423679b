#include "search/rrt_connect.hpp"

#include <limits>

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_rrt_connect {

TEST(it_finds_a_way_around_the_box) {
    const World world = arm_and_box();
    EdgeChecker check(world, arms(), {}, {0.1, 0.0, 1e-4, 100000, 0.1});
    const double start[2] = {0.0, 0.0};
    const std::vector<double> goal{1.57, 0.0};
    CHECK(!check.free(start, goal.data()));
    const SearchSpace space{{0.0, 0.0}, {0, 1},     {-3.0, -3.0}, {3.0, 3.0},
                            {1.0, 1.0}, {1.0, 1.0}, {1.0, 1.0},   std::numeric_limits<double>::infinity()};
    RrtConnect search(check, space, start, goal, 0.4, 3), same(check, space, start, goal, 0.4, 3),
        cut(check, space, start, goal, 0.4, 3);
    CHECK(search.grow(20000, 60.0) && search.met());
    const std::vector<double> path = search.path();
    const int count = static_cast<int>(path.size() / 2);
    CHECK(count > 2 && path[0] == 0.0 && path[1] == 0.0);
    NEAR(path[2 * count - 2], 1.57, 1e-12);
    NEAR(path[2 * count - 1], 0.0, 1e-12);
    EdgeChecker fresh(world, arms(), {}, {0.1, 0.0, 1e-4, 100000, 0.1});
    CHECK(fresh.polyline_free(path.data(), count));
    for (double x : path) CHECK(std::fabs(x) <= 3.0);
    CHECK(same.grow(20000, 60.0) && same.path() == path);
    for (int k = 0; k < 1000000 && !cut.met(); ++k) cut.grow(20000, 1e-5);
    CHECK(cut.path() == path && cut.iterations() == search.iterations());
}

TEST(a_step_that_is_tiny_beside_the_way_ends_with_the_time) {
    const World world = arm_and_box();
    EdgeChecker check(world, arms(), {}, {0.1, 0.0, 1e-4, 100000, 0.1});
    const double start[2] = {0.0, 0.0};
    const SearchSpace space{{0.0, 0.0}, {0, 1},     {-1e9, -1e9}, {1e9, 1e9},
                            {1.0, 1.0}, {1.0, 1.0}, {1.0, 1.0},   std::numeric_limits<double>::infinity()};
    RrtConnect search(check, space, start, {0.5, 1e9}, 1e-7, 3);
    CHECK(!search.grow(20000, 0.05));
    RrtConnect slow(check, space, start, {0.5, 0.0}, 1e-6, 3);  // half a million steps from tree to tree
    CHECK(!slow.grow(20000, 0.01) && slow.size(0) + slow.size(1) < 100000);
}

}  // namespace optiplan::test_rrt_connect
