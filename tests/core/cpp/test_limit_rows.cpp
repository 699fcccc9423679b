#include "control/limit_rows.hpp"

#include "check.hpp"

namespace optiplan::test_limit_rows {

TEST(rows_of_torques) {
    const double M[4] = {2.0, 0.5, 0.5, 1.0}, h[2] = {3.0, -1.0}, v[2] = {0.2, -0.1}, torque[2] = {10.0, 5.0},
                 dt = 0.01;
    const LimitRows rows = torque_rows(M, h, v, torque, dt, 2);
    const double x[2] = {0.3, 0.1};
    for (int k = 0; k < 2; ++k) {
        const double tau = (M[2 * k] * (x[0] - v[0]) + M[2 * k + 1] * (x[1] - v[1])) / dt + h[k];
        const double y = rows.G[2 * k] * x[0] + rows.G[2 * k + 1] * x[1];
        NEAR((y - rows.low[k]) * rows.unit[k], tau + torque[k], 1e-10);
        NEAR((rows.high[k] - y) * rows.unit[k], torque[k] - tau, 1e-10);
        NEAR(rows.G[3 * k], 1.0, 1e-15);
    }
}

TEST(rows_of_speeds_lie_along_the_motion) {
    double J[12] = {0.0};
    J[0] = J[3] = J[9] = 1.0;  // joints slide along x and y, and the second turns about y
    const double v[2] = {3.0, 4.0}, delay[2] = {0.0, 0.0}, bounds[6] = {1.0, 0.5, 0.5, 2.0, 1.0, 1.0};
    const LimitRows rows = speed_rows(J, v, delay, bounds, {0, 3}, 0.01, 2);
    CHECK(rows.size() == 6);
    NEAR(rows.G[0], 0.6, 1e-12);
    NEAR(rows.G[1], 0.8, 1e-12);
    NEAR(rows.high[0], 1.0, 1e-12);
    NEAR(rows.unit[0], 1.0, 1e-12);
    NEAR(rows.G[6] * v[0] + rows.G[7] * v[1], 4.0, 1e-12);
    const double late[2] = {0.01, 0.01};  // an acceleration goes on for a step: x + (x - v) is bounded
    const LimitRows more = speed_rows(J, v, late, bounds, {0}, 0.01, 2);
    NEAR(more.unit[0], 2.0, 1e-12);
    NEAR(more.high[0] * more.unit[0], 5.0 + 1.0, 1e-12);
}

TEST(rows_of_distances) {
    const double gradient[3] = {1.0, 0.0, 9.0}, distance[1] = {0.03}, v[2] = {-0.5, 0.0}, delay[2] = {0.1, 0.1};
    const double brake[2] = {0.5, 0.5}, least[2] = {0.0, 0.005}, margin[2] = {0.0, 0.01}, none[1] = {0.0};
    const std::int64_t near[1] = {1};
    const NearPairs seen{gradient, distance, near, 1, 3};  // the third column is no joint of the robot
    const StopRules rules{delay, brake, least, margin, none, none, 0.01, 50.0};
    const LimitRows rows = stop_rows(seen, v, rules, 2);
    const double slope = 0.1 + 0.5 * 0.5, b = 0.02 - 0.5 * slope + 0.5 * 0.5 * 0.5 * 0.5;
    NEAR(rows.unit[0], 0.01 + slope, 1e-12);
    NEAR(rows.low[0] * rows.unit[0], -0.5 * slope - 0.5 * b, 1e-12);
    CHECK(std::isinf(rows.high[0]));
    double kept[2] = {0.0, 0.002};
    const double asked[2] = {0.01, 0.05};
    raise_least(kept, asked, 2, seen, 0.001);
    NEAR(kept[0], 0.01, 0.0);
    NEAR(kept[1], 0.029, 1e-15);
}

TEST(whether_rows_hold) {
    const double C[4] = {1.0, 0.0, 0.0, 1.0}, low[2] = {-1.0, -INFINITY}, high[2] = {1.0, 0.5};
    const double inside[2] = {1.0, -9.0}, outside[2] = {1.1, 0.0}, unknown[2] = {NAN, 0.0};
    CHECK(rows_hold(C, low, high, inside, 2, 2, 1e-9));
    CHECK(!rows_hold(C, low, high, outside, 2, 2, 1e-9));
    CHECK(!rows_hold(C, low, high, unknown, 2, 2, 1e-9));
}

}  // namespace optiplan::test_limit_rows
