#include "program/step.hpp"

#include "bezier.hpp"
#include "check.hpp"

namespace optiplan::test_step {

TEST(a_step_is_quicker_within_its_trust_region_and_leaves_the_ends) {
    const auto spline = std::make_shared<Spline>(bezier());
    StepSolver solver(spline);
    const Vec C = control();
    const double T = spline->shortest_duration(C.data()), radius = 0.05;
    const Step step = solver.solve(C.data(), T, {}, radius, T, 1e-6);
    CHECK(step.solved && step.control.size() == C.size());
    CHECK(step.duration < T && step.promise > 0.0);
    for (std::size_t k = 0; k < C.size(); ++k) {
        const std::size_t point = k / 2, j = k % 2;
        if (point == 0 || point == 4) CHECK(step.control[k] == C[k]);
        CHECK(std::fabs(step.control[k] - C[k]) <= radius * spline->rates[j] * T + 1e-9);
        CHECK(step.control[k] >= spline->lower[j] - 1e-9 && step.control[k] <= spline->upper[j] + 1e-9);
    }
    CHECK(spline->shortest_duration(step.control.data()) < T);
}

TEST(the_violation_is_the_worst_of_each_sample) {
    Inequalities rows;
    rows.sample = {0, 0, 2, 3}, rows.value = {-0.1, -0.3, 0.5, -0.2}, rows.price = 4.0, rows.unit = 2.0;
    NEAR(rows.violation(), 0.5, 1e-15);
    NEAR(rows.cost(), 1.0, 1e-15);
}

}  // namespace optiplan::test_step
