#include "control/joint_box.hpp"

#include "check.hpp"

namespace optiplan::test_joint_box {

TEST(velocities_within_the_box_keep_every_limit) {
    const double velocity[1] = {1.0}, acceleration[1] = {3.0}, jerk[1] = {60.0}, lower[1] = {-1.0}, upper[1] = {1.0};
    const double inside[1] = {0.0}, slow[1] = {0.0}, dt = 0.01;
    const JointTable table{1, velocity, acceleration, jerk, lower, upper, inside, inside, slow};
    const std::vector<std::int64_t> order{0, 1, 2, 3};
    for (double position = -0.9; position <= 0.9; position += 0.1) {
        double q[1] = {position}, v[1] = {0.0}, a[1] = {0.0};
        for (int step = 0; step < 400; ++step) {  // as fast towards the upper end as the box allows
            const JointBounds box = joint_bounds(q, v, a, table, order, {dt, dt, 0.0});
            CHECK(box.low[0] <= box.high[0] && box.made.size() * 2 == box.intervals.size());
            const double next = box.high[0];
            CHECK(std::fabs(next) <= 1.0 + 1e-9);
            CHECK(std::fabs(next - v[0]) <= dt * 3.0 + 1e-9);
            CHECK(std::fabs((next - v[0]) / dt - a[0]) <= dt * 60.0 + 1e-6);
            a[0] = (next - v[0]) / dt, v[0] = next, q[0] += dt * next;
            CHECK(q[0] <= 1.0 + 1e-6);
        }
        CHECK(q[0] > 0.9);
    }
}

}  // namespace optiplan::test_joint_box
