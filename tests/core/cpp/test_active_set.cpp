#include "control/active_set.hpp"

#include "check.hpp"

namespace optiplan::test_active_set {

static const ActiveSetRules RULES{8, 1e-9, 1e-9, 1e-9};

static double cost(const double *H, const double *g, const double *x) {
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        sum += g[i] * x[i];
        for (int j = 0; j < 3; ++j) sum += 0.5 * x[i] * H[3 * i + j] * x[j];
    }
    return sum;
}

TEST(the_solution_is_feasible_and_no_feasible_point_is_better) {
    for (int round = 0; round < 100; ++round) {
        double B[9], H[9] = {}, g[3], C[6], A[3];
        for (double &one : B) one = uniform(-1, 1);
        for (double &one : C) one = uniform(-1, 1);
        for (int i = 0; i < 3; ++i) {
            g[i] = uniform(-3, 3), A[i] = uniform(0.2, 1.0);
            for (int j = 0; j < 3; ++j)
                for (int k = 0; k < 3; ++k) H[3 * i + j] += B[3 * i + k] * B[3 * j + k];
            H[4 * i] += 0.1;
        }
        const double low[2] = {-0.3, -0.2}, high[2] = {0.4, 0.5}, lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1};
        const double b[1] = {0.0};
        const std::size_t equations = round % 2;
        ActiveSet solver;
        CHECK(solver.solve({3, 2, equations, H, g, C, low, high, lower, upper, A, b}, RULES));
        const double *x = solver.x.data();
        const auto feasible = [&](const double *at, double slack) {
            bool holds = true;
            for (int i = 0; i < 3; ++i) holds &= at[i] >= lower[i] - slack && at[i] <= upper[i] + slack;
            for (int r = 0; r < 2; ++r) {
                const double row = C[3 * r] * at[0] + C[3 * r + 1] * at[1] + C[3 * r + 2] * at[2];
                holds &= row >= low[r] - slack && row <= high[r] + slack;
            }
            return holds;
        };
        CHECK(feasible(x, 1e-8));
        if (equations) NEAR(A[0] * x[0] + A[1] * x[1] + A[2] * x[2], 0.0, 1e-8);
        for (int trial = 0; trial < 300; ++trial) {
            double y[3] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
            if (equations) y[2] = -(A[0] * y[0] + A[1] * y[1]) / A[2];
            if (feasible(y, 0.0)) CHECK(cost(H, g, y) >= cost(H, g, x) - 1e-8);
        }
    }
}

}  // namespace optiplan::test_active_set
