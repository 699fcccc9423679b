#include "execution/set_point_history.hpp"

#include <cmath>

#include "check.hpp"

namespace optiplan::test_set_point_history {

namespace {

constexpr double ALL[2] = {1.0, 1.0};

// A quarter of a circle in a second.
SetPointHistory circle(double kept) {
    SetPointHistory history(2, kept, 4e-3);
    for (int k = 0; k <= 1000; ++k) {
        const double angle = 1.5e-3 * k, q[2] = {std::cos(angle), std::sin(angle)};
        history.note(1e-3 * k, q, 1e-3 * k, 0);
    }
    return history;
}

}  // namespace

TEST(a_lag_lies_on_the_way) {
    const SetPointHistory history = circle(0.45);
    for (double behind : {0.0, 0.0123, 0.2}) {
        const double angle = 1.5 * (1.0 - behind), q[2] = {std::cos(angle), std::sin(angle)};
        double off[2];
        const NearestPlace found = history.nearest(q, ALL, off);
        CHECK(off[0] < 1e-5 && off[1] < 1e-5);
        CHECK(std::fabs(found.place - (1.0 - behind)) < 1e-4);
        CHECK(std::fabs(history.progress_at(1.0) - found.progress - behind) < 1e-4);
    }
}

TEST(what_is_off_the_way_is_told_joint_by_joint) {
    const SetPointHistory history = circle(0.45);
    const double q[2] = {1.003 * std::cos(1.2), 1.003 * std::sin(1.2)};
    double off[2];
    history.nearest(q, ALL, off);
    CHECK(std::fmax(off[0], off[1]) <= 3e-3 && std::fmax(off[0], off[1]) > 2e-3);  // 0.003 / (cos + sin)
    const double mind_the_first[2] = {1e3, 1.0};
    history.nearest(q, mind_the_first, off);
    CHECK(off[0] < off[1]);
}

TEST(what_is_longer_ago_is_forgotten) {
    const SetPointHistory history = circle(0.1);
    const double q[2] = {1.0, 0.0};
    double off[2];
    const NearestPlace found = history.nearest(q, ALL, off);
    CHECK(found.place > 0.86 && found.place < 0.91);
    CHECK(history.progress_at(0.2) > 0.86);
}

TEST(progress_grows_on_the_way_back_and_goes_on_in_another_motion) {
    SetPointHistory history(1, 1.0, 4e-3);
    double off[1], t = 0.0, q[1];
    for (int k = 0; k <= 100; ++k, t += 1e-3) q[0] = 1e-3 * k, history.note(t, q, q[0], 0);
    for (int k = 99; k >= 0; --k, t += 1e-3) q[0] = 1e-3 * k, history.note(t, q, q[0], 0);
    CHECK(std::fabs(history.progress_at(t) - 0.2) < 1e-9);
    for (int k = 0; k <= 50; ++k, t += 1e-3) q[0] = -1e-3 * k, history.note(t, q, 1e-3 * k, 1);
    CHECK(std::fabs(history.progress_at(t) - 0.25) < 1e-9);
    q[0] = -0.02;
    const NearestPlace found = history.nearest(q, ALL, off);
    CHECK(found.epoch == 1 && std::fabs(found.place - 0.02) < 1e-4 && off[0] < 1e-6);
}

TEST(of_equal_places_the_last_one_is_told) {
    SetPointHistory history(1, 1.0, 4e-3);
    const double q[1] = {0.3};
    for (int k = 0; k < 100; ++k) history.note(0.01 * k, q, 0.3, 0);
    double off[1];
    const NearestPlace found = history.nearest(q, ALL, off);
    CHECK(off[0] == 0.0 && found.progress == 0.0);
}

}  // namespace optiplan::test_set_point_history
