#include "execution/path_watch.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_path_watch {

namespace {

// The first joint turns from 0 to 1.5 rad in 1.5 s, the second stands still: the hand is at 2 m, at the angle s.
Curve path() { return {{0.0, 1.5}, {0.0, 0.0, 1.0, 0.0}, 1, 2}; }

Seen box_at(double angle, double reach = 1.9) {
    return {2, {{}, {reach * std::cos(angle), reach * std::sin(angle), 0.0}}, {0, 0, 0}, 0.0, 0.0};
}

}  // namespace

TEST(a_box_on_the_way_blocks_it_where_it_is) {
    World world = arm_and_box();
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

TEST(the_nearest_place_leaves_the_least) {
    World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}}, stop{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {0.5, {0.5, 0.0, 0.0}, 0.0}}};
    const Blocked apart = watch.nearest(stop, 0.0, {box_at(1.0, 2.3)}, 0.0, 5.0);
    CHECK(apart.pair >= 0 && apart.slack > 0.3 && apart.slack < 5.0);
    NEAR(apart.s, 0.5, 5e-3);  // it comes nearer until it stands still
    NEAR(watch.nearest(stop, 0.0, {box_at(1.0, 2.3)}, 0.1, 5.0).slack, apart.slack - 0.1, 1e-9);
    CHECK(watch.nearest(stop, 0.0, {box_at(1.0, 2.3)}, 0.0, 0.5 * apart.slack).pair == -1);
    Seen anywhere = box_at(1.0, 2.3);
    anywhere.spread = 1.0;
    const double grown = watch.nearest(stop, 0.0, {anywhere}, 0.0, 5.0).slack;
    CHECK(grown < apart.slack - 0.49 && grown > apart.slack - 0.51);
    CHECK(watch.nearest(law, 0.0, {box_at(1.0)}, 0.0, 5.0).slack < 0.0);
}

TEST(a_law_that_ends_before_is_clear) {
    World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw stop{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {0.5, {0.5, 0.0, 0.0}, 0.0}}};
    CHECK(watch.blocked(stop, 0.0, {box_at(1.0)}, 0.0).pair == -1);
    CHECK(watch.blocked(stop, 0.0, {box_at(0.5)}, 0.0).pair == 1);
}

TEST(what_moves_is_met_where_it_is_by_then) {
    World world = arm_and_box();
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
    World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const Seen held{1, {{}, {9.0, 0.0, 0.0}}, {0, 0, 0}, 0.0, 0.0};
    CHECK(watch.blocked(law, 0.0, {held, box_at(1.0)}, 0.0).pair == 1);
    CHECK(watch.blocked(law, 0.0, {held, box_at(1.0)}, 0.0).s < 0.95);
}

TEST(a_part_of_a_path_begins_later) {
    World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 2.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const Blocked found = watch.blocked(law, 0.0, {box_at(1.0)}, 0.0);
    CHECK(found.pair == 1 && found.s > 2.85 && found.s < 2.96);
    const TimeLaw before{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {1.0, {1.0, 0.0, 0.0}, 0.0}}};
    CHECK(watch.blocked(before, 0.0, {box_at(1.0)}, 0.0).pair == -1);
}

TEST(joints_that_may_be_off_the_path_are_blocked_sooner) {
    World world = arm_and_box();
    PathWatch exact(world, path(), 4e-3, 0.0), wide(world, path(), 4e-3, 0.0, {0.02, 0.02});
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const double sooner = exact.blocked(law, 0.0, {box_at(1.0)}, 0.0).s - wide.blocked(law, 0.0, {box_at(1.0)}, 0.0).s;
    CHECK(sooner > 0.015 && sooner < 0.05);
}

// The path was not proved against it: a second box, of the first one's kind.
TEST(an_added_box_blocks_like_one_that_was_known) {
    World world = arm_and_box();
    const std::size_t pairs = world.pairs().size();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw law{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};
    const Blocked known = watch.blocked(law, 0.0, {box_at(1.0)}, 0.0);
    Body again = world.bodies()[2];
    const int added = watch.add(again);
    CHECK(watch.bodies() == added + 1);
    CHECK(world.pairs().size() > pairs);
    Seen seen = box_at(1.0);
    seen.body = added;
    const Blocked found = watch.blocked(law, 0.0, {seen}, 0.0);
    CHECK(found.s == known.s);
    CHECK(found.pair >= static_cast<int>(pairs));
    CHECK(watch.blocked(law, 0.0, {box_at(1.0, 9.0)}, 0.0).pair == -1);
}

TEST(a_robot_at_rest_is_struck_by_what_goes_on) {
    World world = arm_and_box();
    PathWatch watch(world, path(), 4e-3, 0.0);
    const TimeLaw stop{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {0.5, {0.5, 0.0, 0.0}, 0.0}}};
    Seen coming = box_at(0.5, 4.0);  // at 0.5 m/s it is at the hand after some 3.8 s
    coming.velocity = {-0.5 * std::cos(0.5), -0.5 * std::sin(0.5), 0.0};
    CHECK(watch.blocked(stop, 0.0, {coming}, 0.0).pair == -1);
    CHECK(watch.blocked(stop, 0.0, {coming}, 0.0, 2.0).pair == -1);
    const Blocked found = watch.blocked(stop, 0.0, {coming}, 0.0, 5.0);
    CHECK(found.pair >= 0 && found.s == 0.5);
    Seen past = box_at(0.9, 4.0);
    past.velocity = coming.velocity;
    CHECK(watch.blocked(stop, 0.0, {past}, 0.0, 9.0).pair == -1);  // 1.5 m beside it
    const TimeLaw whole{{{0.0, {0.0, 1.0, 0.0}, 0.0}}};            // it rests at the path's end
    Seen at_end = box_at(1.5, 4.0);
    at_end.velocity = {-0.5 * std::cos(1.5), -0.5 * std::sin(1.5), 0.0};
    CHECK(watch.blocked(whole, 0.0, {at_end}, 0.0).pair == -1);
    CHECK(watch.blocked(whole, 0.0, {at_end}, 0.0, 5.0).s == 1.5);
}

}  // namespace optiplan::test_path_watch
