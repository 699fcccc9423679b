#include "execution/path_watch.hpp"

#include "arm.hpp"
#include "check.hpp"

using namespace optiplan;

namespace {

// The first joint turns from 0 to 1.5 rad in 1.5 s, the second stands still: the hand is at 2 m, at the angle s.
Curve path() { return {{0.0, 1.5}, {0.0, 0.0, 1.0, 0.0}, 1, 2}; }

Seen box_at(double angle, double reach = 1.9) {
    return {2, {{}, {reach * std::cos(angle), reach * std::sin(angle), 0.0}}, {0, 0, 0}, 0.0, 0.0};
}

}  // namespace

TEST(a_box_on_the_way_blocks_it_where_it_is) {
    const World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    CHECK(watch.bodies() == 3);
    const Blocked found = watch.blocked(law, 0.0, {box_at(1.0)}, 0.0);
    CHECK(found.pair == 1);
    // The box is 0.1 m in half, the link 0.05 m in radius: it touches some 0.08 to 0.11 rad before.
    CHECK(found.s > 0.87 && found.s < 0.95);
    CHECK(watch.blocked(law, 0.0, {box_at(1.0)}, 0.1).s < found.s - 0.04);
    CHECK(watch.blocked(law, 0.0, {box_at(1.0, 2.3)}, 0.0).pair == -1);  // out of reach
    CHECK(watch.blocked(law, 1.2, {box_at(1.0)}, 0.0).pair == -1);       // behind
    CHECK(watch.blocked(law, 0.0, {}, 0.0).pair == -1);
}

TEST(a_law_that_ends_before_is_clear) {
    const World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw stop{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {0.5, {0.5, 0.0, 0.0}, 0.0}}};
    CHECK(watch.blocked(stop, 0.0, {box_at(1.0)}, 0.0).pair == -1);
    CHECK(watch.blocked(stop, 0.0, {box_at(0.5)}, 0.0).pair == 1);
}

TEST(what_moves_is_met_where_it_is_by_then) {
    const World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}}, slow{{{0.0, {0.0, 0.5, 0.0}, 0.0}}};
    Seen leaving = box_at(1.0);
    leaving.velocity = {1.0, 1.0, 0.0};
    CHECK(watch.blocked(law, 0.0, {leaving}, 0.0).pair == -1);
    Seen coming = box_at(1.0, 3.0);  // in 1.1 s it is where the hand is then, in 2.2 s it has passed the arm
    coming.velocity = {-std::cos(1.0), -std::sin(1.0), 0.0};
    CHECK(watch.blocked(law, 0.0, {coming}, 0.0).pair >= 0);
    Seen anywhere = box_at(1.0, 2.6);
    anywhere.spread = 0.3;
    CHECK(watch.blocked(law, 0.0, {anywhere}, 0.0).pair == -1);
    anywhere.spread = 0.6;
    CHECK(watch.blocked(law, 0.0, {anywhere}, 0.0).pair == 1);
    CHECK(watch.blocked(slow, 0.0, {box_at(1.0)}, 0.0).pair == 1);
}

// The second link is reported far away, as an obstacle that the robot took is where it stood before.
TEST(what_the_robot_holds_is_where_the_path_has_it) {
    const World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const Seen held{1, {{}, {9.0, 0.0, 0.0}}, {0, 0, 0}, 0.0, 0.0};
    CHECK(watch.blocked(law, 0.0, {held, box_at(1.0)}, 0.0).pair == 1);
    CHECK(watch.blocked(law, 0.0, {held, box_at(1.0)}, 0.0).s < 0.95);
}

TEST(a_part_of_a_path_begins_later) {
    const World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 2.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const Blocked found = watch.blocked(law, 0.0, {box_at(1.0)}, 0.0);
    CHECK(found.pair == 1 && found.s > 2.85 && found.s < 2.96);
    const TimeLaw before{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {1.0, {1.0, 0.0, 0.0}, 0.0}}};
    CHECK(watch.blocked(before, 0.0, {box_at(1.0)}, 0.0).pair == -1);
}

TEST(joints_that_may_be_off_the_path_are_blocked_sooner) {
    const World world = arm_and_box();
    PathWatch exact(world, path(), 4e-3, 0.0), wide(world, path(), 4e-3, 0.0, {0.02, 0.02});
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const double sooner = exact.blocked(law, 0.0, {box_at(1.0)}, 0.0).s - wide.blocked(law, 0.0, {box_at(1.0)}, 0.0).s;
    CHECK(sooner > 0.015 && sooner < 0.05);
}
