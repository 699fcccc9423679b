#include "control/joint_box.hpp"

#include "check.hpp"

using namespace optiplan;

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

TEST(singular_values_of_known_matrices) {
    const double diagonal[9] = {0, 3, 0, 1, 0, 0, 0, 0, -2}, row[3] = {3.0, 0.0, 4.0};
    const std::vector<double> found = singular_values(diagonal, 3, 3);
    NEAR(found[0], 3.0, 1e-12);
    NEAR(found[1], 2.0, 1e-12);
    NEAR(found[2], 1.0, 1e-12);
    NEAR(singular_values(row, 1, 3)[0], 5.0, 1e-12);
    const double skewed[4] = {1.0, 2.0, 0.5, 3.0};  // s t = |det|, s² + t² = the sum of squares
    const std::vector<double> two = singular_values(skewed, 2, 2);
    NEAR(two[0] * two[1], 2.0, 1e-12);
    NEAR(two[0] * two[0] + two[1] * two[1], 14.25, 1e-12);
}
