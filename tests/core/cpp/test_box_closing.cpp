#include "verify/box_closing.hpp"

#include "arm.hpp"
#include "check.hpp"

using namespace optiplan;

static const double LONG = 1000.0;  // s, in which any box is reached

// The arm with a rod along each link, and the box of `arm_and_box`.
static BoxClosing closing() {
    const Vec3 begin{}, end{1.0, 0.0, 0.0}, middle{0.5, 0.0, 0.0};
    const Mat3 identity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    std::vector<Rod> rods{{1, {begin, end}, 0.05}, {2, {begin, end}, 0.05}};
    std::vector<RodBody> bodies{{1, middle, 0.55, {0}, {0}}, {2, middle, 0.55, {1}, {0}}};
    std::vector<ObstacleBox> boxes{{0, {1.0, 1.0, 0.0}, {0.1, 0.1, 0.1}, 0.0}};
    Way way{{0.0, 0.0}, {1.5, 0.0}, {1.0, 1.0}, {2.0, 2.0}, {1e-6, 1e-6}};
    return {arm(), rods, bodies, boxes, {identity}, {0, 0, 1, 0, 1, 0, 2, 1}, way};
}

TEST(all_configurations_of_a_closed_box_collide) {
    const World world = arm_and_box();
    BoxClosing boxes = closing();
    int closed = 0;
    for (double first = 0.0; first < 1.5; first += 0.1)
        for (double second = -1.5; second < 1.5; second += 0.1) {
            const double low[2] = {first, second}, high[2] = {first + 0.1, second + 0.1};
            if (boxes.close(LONG, low, high, 1000) != Box::closed) continue;
            ++closed;
            for (int i = 0; i <= 4; ++i)
                for (int k = 0; k <= 4; ++k) {
                    const double q[2] = {first + 0.025 * i, second + 0.025 * k};
                    CHECK(collides(world, q));
                }
        }
    CHECK(closed > 5);
}

TEST(free_boxes_are_never_closed_in_a_long_time) {
    BoxClosing boxes = closing();
    const double low[2] = {-0.1, -0.1}, high[2] = {0.1, 0.1};
    CHECK(boxes.close(LONG, low, high, 1000) != Box::closed);
}

TEST(a_box_too_far_from_an_end_is_closed) {
    BoxClosing boxes = closing();
    const double low[2] = {-2.1, 0.0}, high[2] = {-2.0, 0.1};  // 2 rad from the start takes 2.25 s, 3.5 rad 3.75 s
    CHECK(boxes.close(5.9, low, high, 1000) == Box::closed);
    CHECK(boxes.close(6.1, low, high, 1000) != Box::closed);
}
