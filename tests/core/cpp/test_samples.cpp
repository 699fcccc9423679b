#include "program/samples.hpp"

#include "bezier.hpp"
#include "check.hpp"

namespace optiplan::test_samples {

TEST(derivatives_of_samples_equal_differences) {
    const Spline spline = bezier();
    const Vec C = control();
    const double h = 1e-5;
    for (double u : {0.1, 0.35, 0.8}) {
        const Samples samples = bezier_samples({u - h, u, u + h});
        CHECK(samples.count() == 3);
        double at[3][3][2];
        for (std::size_t i = 0; i < 3; ++i)
            for (int order = 0; order < 3; ++order) samples.at(i, order, C.data(), spline, at[i][order]);
        for (int j = 0; j < 2; ++j) {
            double sum = 0.0;
            for (int k = 0; k < 5; ++k) sum += bernstein(k, 4, u) * C[2 * k + j];
            NEAR(at[1][0][j], sum, 1e-14);
            NEAR(at[1][1][j], (at[2][0][j] - at[0][0][j]) / (2 * h), 1e-8);
            NEAR(at[1][2][j], (at[2][1][j] - at[0][1][j]) / (2 * h), 1e-8);
        }
    }
}

TEST(a_sample_of_too_many_control_points_is_refused) {
    const double u[1] = {0.5}, wide[7] = {1, 0, 0, 0, 0, 0, 1};
    const double *const matrices[3] = {wide, wide, wide};
    bool refused = false;
    try {
        Samples::of(u, 1, matrices, 7);
    } catch (const std::exception &) { refused = true; }
    CHECK(refused);
}

}  // namespace optiplan::test_samples
