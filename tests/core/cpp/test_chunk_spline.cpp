#include "chunks/chunk_spline.hpp"

#include "check.hpp"

namespace optiplan::test_chunk_spline {

namespace {

// Derivatives 0 to 2 of joint j at time t of a curve, from the piece before t if `before`.
void value(const Curve &curve, std::size_t j, double t, bool before, double *out) {
    std::size_t piece = 0;
    while (piece + 2 < curve.breakpoints.size() &&
           (before ? curve.breakpoints[piece + 1] < t : curve.breakpoints[piece + 1] <= t))
        ++piece;
    const double s = t - curve.breakpoints[piece];
    const double *c = curve.coefficients.data() + piece * 4 * curve.joints + j;
    const std::size_t n = static_cast<std::size_t>(curve.joints);
    out[0] = c[0] + s * (c[n] + s * (c[2 * n] + s * c[3 * n]));
    out[1] = c[n] + s * (2.0 * c[2 * n] + s * 3.0 * c[3 * n]);
    out[2] = 2.0 * c[2 * n] + 6.0 * s * c[3 * n];
}

JointLimits limits() { return {{-9.0, -9.0}, {9.0, 9.0}, {{2.0, 2.0}, {8.0, 5.0}, {100.0, 80.0}}}; }

}  // namespace

TEST(the_spline_passes_its_set_points_smoothly) {
    for (bool rests : {false, true})
        for (std::size_t k : {1u, 2u, 3u, 12u}) {
            Vec times, Q;
            double t = 0.0;
            for (std::size_t i = 0; i < k; ++i) {
                times.push_back(t += uniform(0.05, 0.2));
                Q.push_back(uniform(-1, 1)), Q.push_back(uniform(-1, 1));
            }
            const JointState start{{0.1, -0.2}, {0.5, -0.3}, {1.0, 2.0}};
            const ChunkSpline spline(times, rests);
            const Curve curve = spline.curve(spline.through(start, Q.data()), 2);
            double at[3], before[3];
            for (std::size_t j = 0; j < 2; ++j) {
                value(curve, j, 0.0, false, at);
                NEAR(at[0], start.q[j], 1e-12), NEAR(at[1], start.v[j], 1e-11), NEAR(at[2], start.a[j], 1e-9);
                for (std::size_t i = 0; i < k; ++i) {
                    value(curve, j, times[i], true, at);
                    NEAR(at[0], Q[2 * i + j], 1e-10);
                    NEAR(curve.breakpoints[spline.knot_of(i)], times[i], 0.0);
                }
                if (rests) NEAR(at[1], 0.0, 1e-8);
                NEAR(at[2], 0.0, 1e-7);
                for (std::size_t i = 1; i + 1 < curve.breakpoints.size(); ++i) {
                    value(curve, j, curve.breakpoints[i], true, before);
                    value(curve, j, curve.breakpoints[i], false, at);
                    for (int order = 0; order < 3; ++order) NEAR(at[order], before[order], 1e-7);
                }
            }
        }
}

TEST(stencils_are_the_spline_and_its_derivatives) {
    const ChunkSpline spline({0.1, 0.25, 0.3}, false);
    Vec control(spline.points());
    for (double &each : control) each = uniform(-1, 1);
    const Curve curve = spline.curve(control, 1);
    for (double t : {0.0, 0.02, 0.11, 0.25, 0.3}) {
        const Stencil s = spline.at(t);
        double sum = 0.0, at[3];
        for (std::size_t k = 0; k < s.count; ++k) sum += s.weights[k] * control[s.first + k];
        value(curve, 0, t, false, at);
        NEAR(sum, at[0], 1e-12);
    }
    for (std::size_t row = 0; row + 2 < spline.points(); ++row) {  // accelerations at knots
        const Stencil s = spline.derivative(2, row);
        double sum = 0.0, at[3];
        for (std::size_t k = 0; k < s.count; ++k) sum += s.weights[k] * control[s.first + k];
        value(curve, 0, spline.knots()[row], row > 0, at);
        NEAR(sum, at[2], 1e-8);
    }
}

TEST(the_stop_ends_at_rest_within_its_limits) {
    for (int round = 0; round < 50; ++round) {
        const JointState state{{0.0, 0.0}, {uniform(-2, 2), uniform(-2, 2)}, {uniform(-5, 5), uniform(-5, 5)}};
        const Curve curve = stop_from(state, limits());
        const JointState end = end_of(curve);
        for (std::size_t j = 0; j < 2; ++j) {
            NEAR(end.v[j], 0.0, 1e-7), NEAR(end.a[j], 0.0, 1e-5);
            double before[3] = {state.q[j], state.v[j], state.a[j]}, at[3];
            for (std::size_t i = 0; i + 1 < curve.breakpoints.size(); ++i) {
                value(curve, j, curve.breakpoints[i], false, at);
                NEAR(at[0], before[0], 1e-10), NEAR(at[1], before[1], 1e-8), NEAR(at[2], before[2], 1e-6);
                CHECK(std::fabs(at[2]) <= limits().rates[1][j] * (1.0 + 1e-9));
                CHECK(std::fabs(6.0 * curve.coefficients[(i * 4 + 3) * 2 + j]) <= limits().rates[2][j] * (1.0 + 1e-9));
                value(curve, j, curve.breakpoints[i + 1], true, before);
            }
        }
    }
    CHECK(stop_from({{0.0}, {0.0}, {0.0}}, {{-1.0}, {1.0}, {{1.0}, {1.0}, {1.0}}}).breakpoints.size() == 1);
}

}  // namespace optiplan::test_chunk_spline
