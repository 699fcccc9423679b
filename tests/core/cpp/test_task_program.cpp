#include "control/task_program.hpp"

#include "check.hpp"

namespace optiplan::test_task_program {

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

TEST(singular_values_of_more_rows_than_columns) {
    const double column[3] = {3.0, 0.0, 4.0};
    const std::vector<double> found = singular_values(column, 3, 1);
    CHECK(found.size() == 1);
    NEAR(found[0], 5.0, 1e-12);
}

// Two tasks of one row each for two joints: the first with a lag, the second with rates of its own.
static TaskRows two_rows() {
    return {2, {1.0, 0.0, 0.0, 2.0}, {0.1, 0.2}, {1.0, 5.0}, {1.0, 0.5}, {0.3, 0.0}, {10.0, 0.0}, {0.0, 7.0}, {0, 1}};
}

TEST(a_program_of_two_rows) {
    const double v[2] = {2.0, 3.0}, a[2] = {4.0, 0.0};
    const std::int64_t main[1] = {0};
    double A[4], rates[6], H[4], g[2];
    const TaskRules rules{0.01, 0.5, 0.25, 0.1, 0.05, 1.0};
    const TaskSummary found = task_program(two_rows(), v, a, main, 1, 0, 0, 0.5, rules, {A, rates, H, g});
    NEAR(found.error, 0.1, 1e-15);
    NEAR(rates[0], 1.0 + 0.5 * (2.0 - 0.01 * 10.0 + 0.3 - 1.0), 1e-15);  // half of the way from its rate of a step ago
    NEAR(rates[1], 0.5 * 7.0, 1e-15);
    NEAR(rates[5], 0.5 * 5.0, 1e-15);
    NEAR(A[3], 1.0, 1e-15);
    NEAR(H[0], 1.0 + 0.75, 1e-15);
    NEAR(H[1], 0.0, 1e-15);
    NEAR(g[0], -rates[0] - 0.25 * (2.0 + 0.1 * 4.0) - 0.5 * 0.5 * 2.0, 1e-15);
    NEAR(g[1], -rates[1] - 0.25 * 3.0 - 0.5 * 0.5 * 3.0, 1e-15);
    NEAR(norm_left(A, rates + 4, v, main, 1, 2), 1.0, 1e-15);
    NEAR(norm_of(rates + 4, main, 1), 1.0, 1e-15);
}

TEST(velocities_are_damped_near_singularities) {
    const double v[2] = {0.0, 0.0};
    double A[4], rates[6], H[4], g[2];
    TaskRows rows = two_rows();
    for (double least : {0.5, 1e-3, 0.0}) {  // the other singular value is 1
        rows.J = {1.0, 0.0, 0.0, 2.0 * least};
        const TaskSummary found =
            task_program(rows, v, v, nullptr, 0, 0, 2, 0.0, {0.01, 0.0, 0.0, 0.0, 0.05, 0.1}, {A, rates, H, g});
        NEAR(found.manipulability, least, 1e-7);
        const double share = least / 0.05, damping = share < 1.0 ? 0.1 * (1.0 - share * share) : 0.0;
        NEAR(H[0], 1.0 + damping * damping, 1e-12);
    }
}

TEST(errors_of_a_pose_change_as_its_rates_say) {
    for (double angle : {0.0, 1e-9, 1e-3, 1.0, 3.1}) {
        const double c = std::cos(angle), s = std::sin(angle);
        const Pose target{{}, {0.1, 0.2, 0.3}};
        Pose frame{{{{c, -s, 0.0}, {s, c, 0.0}, {0.0, 0.0, 1.0}}}, {0.4, 0.2, 0.3}};
        double error[6], moved[6], turn[36];
        pose_error(frame, target, error, turn);
        NEAR(error[0], 0.3, 1e-15);
        NEAR(error[5], angle, 1e-12);
        const double step = 1e-7, tilt = std::cos(step), side = std::sin(step);  // about x of the world
        const Mat3 turned{{{1.0, 0.0, 0.0}, {0.0, tilt, -side}, {0.0, side, tilt}}};
        frame.R = turned * frame.R;
        double ignored[36];
        pose_error(frame, target, moved, ignored);
        for (int i = 3; i < 6; ++i) NEAR((moved[i] - error[i]) / step, turn[6 * i + 3], 2e-6);
    }
    const Pose half{{{{-1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, {0.0, 0.0, 1.0}}}, {}};
    double error[6], turn[36];
    pose_error(half, {}, error, turn);
    NEAR(std::fabs(error[5]), 3.14159265358979, 1e-12);
}

TEST(rates_slow_down_where_the_target_is_far) {
    const double near[3] = {0.01, 0.0, 0.0}, far[3] = {0.0, -1.0, 0.0}, none[3] = {0.0, 0.0, 0.0};
    double out[3];
    capped(near, 10.0, 1.0, 1.0, out);
    NEAR(out[0], -0.1, 1e-15);
    capped(far, 10.0, 100.0, 1.0, out);
    NEAR(out[1], std::sqrt(2.0 * (1.0 - 0.005)), 1e-12);
    capped(far, 10.0, 0.5, 1.0, out);
    NEAR(out[1], 0.5, 1e-15);
    capped(none, 10.0, 1.0, 1.0, out);
    NEAR(out[0], 0.0, 0.0);
    const double brake[3] = {1.0, 1.0, 1.0}, speed[3] = {0.5, 0.5, 2.0}, both[3] = {0.01, -1.0, 1.0};
    curbed(both, 10.0, brake, speed, 3, out);
    NEAR(out[0], -0.1, 1e-15);
    NEAR(out[1], 0.5, 1e-15);
    NEAR(out[2], -std::sqrt(2.0 * (1.0 - 0.005)), 1e-12);
}

}  // namespace optiplan::test_task_program
