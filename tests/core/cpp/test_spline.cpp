#include "bezier.hpp"
#include "check.hpp"

namespace optiplan::test_spline {

TEST(derivative_control_points_are_differences) {
    const Spline spline = bezier();
    const Vec C = control();
    double out[2];
    for (std::size_t k = 0; k < 4; ++k) {
        spline.derivative(k, C.data(), out);
        for (std::size_t j = 0; j < 2; ++j) NEAR(out[j], 4.0 * (C[2 * k + 2 + j] - C[2 * k + j]), 1e-14);
    }
    spline.derivative(4, C.data(), out);
    for (std::size_t j = 0; j < 2; ++j) NEAR(out[j], 12.0 * (C[4 + j] - 2.0 * C[2 + j] + C[j]), 1e-13);
}

TEST(the_shortest_duration_brings_one_derivative_to_its_limit) {
    const Vec C = control();
    for (std::size_t tight = 0; tight < 3; ++tight) {  // the order whose limits decide
        Spline spline = bezier();
        for (std::size_t k = 0; k < 6; ++k)
            if (k / 2 != tight) spline.rates[k] *= 1000.0;
        const double T = spline.shortest_duration(C.data());
        double most = 0.0, out[2];
        for (std::size_t row = 0; row < spline.derivatives.size(); ++row) {
            spline.derivative(row, C.data(), out);
            for (std::size_t j = 0; j < 2; ++j)
                most = std::fmax(most, std::fabs(out[j]) / (spline.limit(row)[j] * std::pow(T, spline.order[row])));
        }
        NEAR(most, 1.0, 1e-12);
    }
}

TEST(the_cost_of_jerk_falls_with_the_fifth_power_of_the_duration) {
    Spline spline = bezier();
    for (std::size_t k = 0; k < 5; ++k) spline.gram[6 * k] = 2.0;
    const Vec C = control();
    CHECK(spline.jerk_cost(C.data(), 1.0) == 0.0);
    spline.jerk = 0.5;
    NEAR(spline.jerk_cost(C.data(), 1.0), 0.5 * 2.0 * dot(C.data(), C.data(), 10), 1e-14);
    NEAR(spline.jerk_cost(C.data(), 2.0), spline.jerk_cost(C.data(), 1.0) / 32.0, 1e-14);
}

TEST(stencils_leave_out_what_is_held) {
    const double row[7] = {0, 1, 2, 3, 4, 0, 0}, wide[7] = {1, 0, 0, 0, 0, 1, 0};
    const Stencil found = stencil_of(row, 7);
    CHECK(found.first == 1 && found.count == 4 && found.weights[3] == 4.0);
    const Stencil inner = free_part(found, 2, 3);
    CHECK(inner.first == 0 && inner.count == 3 && inner.weights[0] == 2.0 && inner.weights[2] == 4.0);
    bool refused = false;
    try {
        stencil_of(wide, 7);
    } catch (const std::exception &) { refused = true; }
    CHECK(refused);
}

}  // namespace optiplan::test_spline
