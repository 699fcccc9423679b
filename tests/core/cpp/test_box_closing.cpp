#include "verify/box_closing.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_box_closing {

// Anywhere within half a turn in both of two steps.
static const double LOW[4] = {-3.2, -3.2, -3.2, -3.2}, HIGH[4] = {3.2, 3.2, 3.2, 3.2};

// The arm with a rod along each link, and the box of `arm_and_box`.
static BoxClosing closing() {
    const Vec3 begin{}, end{1.0, 0.0, 0.0}, middle{0.5, 0.0, 0.0};
    const Mat3 identity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    std::vector<Rod> rods{{1, {begin, end}, 0.05}, {2, {begin, end}, 0.05}};
    std::vector<RodBody> bodies{{1, middle, 0.55, {0}, {0}}, {2, middle, 0.55, {1}, {0}}};
    std::vector<ObstacleBox> boxes{{0, {1.0, 1.0, 0.0}, {0.1, 0.1, 0.1}, 0.0}};
    BoxClosing made{arm(), rods, bodies, boxes, {identity}, {0, 0, 1, 0, 1, 0, 2, 1}};
    made.keep_within({LOW, HIGH, 2});
    return made;
}

TEST(all_configurations_of_a_closed_box_collide) {
    const World world = arm_and_box();
    BoxClosing boxes = closing();
    int closed = 0;
    for (double first = 0.0; first < 1.5; first += 0.1)
        for (double second = -1.5; second < 1.5; second += 0.1) {
            const double low[2] = {first, second}, high[2] = {first + 0.1, second + 0.1};
            if (boxes.close(low, high, 1000) != Box::closed) continue;
            ++closed;
            for (int i = 0; i <= 4; ++i)
                for (int k = 0; k <= 4; ++k) {
                    const double q[2] = {first + 0.025 * i, second + 0.025 * k};
                    CHECK(collides(world, q));
                }
        }
    CHECK(closed > 5);
}

TEST(a_box_with_a_free_configuration_is_passable) {
    BoxClosing boxes = closing();
    const double low[2] = {-0.1, -0.1}, high[2] = {0.1, 0.1};
    CHECK(boxes.close(low, high, 1000) == Box::passable);
}

TEST(a_box_that_no_step_of_the_corridor_meets_in_both_joints_is_closed) {
    BoxClosing boxes = closing();
    const double lowest[4] = {-0.1, 0.4, -0.1, -0.1}, highest[4] = {0.1, 0.5, 0.1, 0.5};  // the joints in two steps
    boxes.keep_within({lowest, highest, 2});
    const double early[2] = {-0.1, 0.2}, early_end[2] = {0.1, 0.3};  // the second joint gets there in the second step
    const double late[2] = {0.4, 0.2}, late_end[2] = {0.5, 0.3};
    CHECK(boxes.close(early, early_end, 1000) == Box::closed);
    CHECK(boxes.close(late, late_end, 1000) == Box::passable);
}

}  // namespace optiplan::test_box_closing
