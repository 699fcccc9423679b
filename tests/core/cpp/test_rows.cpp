#include "program/rows.hpp"

#include "arm.hpp"
#include "bezier.hpp"
#include "check.hpp"

namespace optiplan::test_rows {

TEST(rows_of_clearance_are_distances_beyond_the_margin) {
    const World world = arm_and_box();
    const Margins margins{0.02, {0.5, 0.01}, {0.5, 0.01}};
    NEAR(margins.at(0.5, 0), 0.02, 0.0);
    CHECK(margins.at(0.5, 1) < 0.01);
    const Vec u{0.2, 0.5, 0.8}, Q{0.05, 0.1, 0.3, 0.2, 0.2, -0.4};
    const NearRows rows = RowSearch(world, margins, 5.0).of(u, Q);
    CHECK(rows.sample.size() == 6 && rows.value.size() == 6 && rows.gradient.size() == 12);
    const double h = 1e-6;
    for (std::size_t k = 0; k < rows.sample.size(); ++k) {
        const int i = rows.sample[k];
        const double x = Q[2 * i], y = Q[2 * i + 1];
        bool known = false;
        for (int pair = 0; pair < 2 && !known; ++pair) {
            known = std::fabs(rows.value[k] + margins.at(u[i], pair) - distance_at(world, pair, x, y)) < 1e-7;
            if (!known) continue;
            const double first = distance_at(world, pair, x + h, y) - distance_at(world, pair, x - h, y);
            const double second = distance_at(world, pair, x, y + h) - distance_at(world, pair, x, y - h);
            NEAR(rows.gradient[2 * k], first / (2 * h), 1e-5);
            NEAR(rows.gradient[2 * k + 1], second / (2 * h), 1e-5);
        }
        CHECK(known);
    }
    CHECK(RowSearch(world, margins, 0.0).of(u, Q).sample.empty());
}

TEST(rows_of_torque_are_what_is_left_of_the_limit) {
    const Tree tree = arm();
    const Spline spline = bezier();
    const Vec u{0.3, 0.6}, C = control();
    const Samples samples = bezier_samples(u);
    const Vec none{HUGE_VAL, HUGE_VAL};
    TorqueRows weak(tree, {30.0, HUGE_VAL}, none), strong(tree, {1e6, 1e6}, none);
    CHECK(weak.limited() == 1 && strong.limited() == 2);
    Inequalities rows;
    Mask exceeded;
    const double T = 2.0;
    weak.of(spline, samples, C.data(), T, Mask(2), rows, exceeded);
    InverseDynamics dynamics(tree);
    CHECK(rows.value.size() == 2);
    for (std::size_t i = 0; i < rows.value.size(); ++i) {
        double q[2], v[2], a[2], tau[2];
        samples.at(i, 0, C.data(), spline, q), samples.at(i, 1, C.data(), spline, v);
        samples.at(i, 2, C.data(), spline, a);
        for (int j = 0; j < 2; ++j) v[j] /= T, a[j] /= T * T;
        dynamics.torques(q, v, a, tau);
        NEAR(rows.value[i], 1.0 - std::fabs(tau[0]) / 30.0, 1e-12);
        CHECK(static_cast<bool>(exceeded[i]) == (rows.value[i] < 0.0));
    }
    strong.of(spline, samples, C.data(), T, Mask(4), rows, exceeded);
    CHECK(rows.value.empty());
}

TEST(rows_at_rest_are_what_is_left_of_the_limit_of_gravity) {
    const Tree tree = arm();
    const Spline spline = bezier();
    const Vec u{0.1, 0.6}, C = control(), rest(2, 0.0);
    const Samples samples = bezier_samples(u);
    InverseDynamics dynamics(tree);
    double q[2], tau[2], most = 0.0;  // what both ends need
    for (const std::size_t end : {std::size_t{0}, spline.points - 1}) {
        dynamics.torques(C.data() + 2 * end, rest.data(), rest.data(), tau);
        most = std::max(most, std::fabs(tau[0]));
    }
    for (const double still : {1.1 * most, 0.5 * most}) {
        TorqueRows heavy(tree, {1e6, 1e6}, {still, HUGE_VAL});
        const double allowed = std::max(0.98 * still, most);
        Inequalities rows;
        Mask exceeded;
        heavy.of(spline, samples, C.data(), 2.0, Mask(4), rows, exceeded);
        std::size_t found = 0;
        for (std::size_t i = 0; i < u.size(); ++i) {
            samples.at(i, 0, C.data(), spline, q);
            dynamics.torques(q, rest.data(), rest.data(), tau);
            if (std::fabs(tau[0]) <= 0.8 * allowed) continue;
            CHECK(rows.sample[found] == static_cast<int>(i) && rows.by_duration[found] == 0.0);
            NEAR(rows.value[found++], 1.0 - std::fabs(tau[0]) / allowed, 1e-12);
        }
        CHECK(found > 0 && rows.value.size() == found);
    }
}

}  // namespace optiplan::test_rows
