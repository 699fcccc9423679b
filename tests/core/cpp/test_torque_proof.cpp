#include "verify/torque_proof.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_torque_proof {

namespace {

Curve swing(double a, double b) { return {{0.0, 0.5}, {0.2, -0.4, a, b, 0.5 * a, -b, -1.0, 2.0}, 3, 2}; }

// Largest torques at many times.
std::vector<double> dense(const Curve &curve) {
    InverseDynamics dynamics(arm());
    std::vector<double> most(2, 0.0);
    for (int i = 0; i <= 2000; ++i) {
        const double t = 0.5 * i / 2000.0;
        double q[2], v[2], a[2], tau[2];
        for (int j = 0; j < 2; ++j) {
            const double *c = curve.coefficients.data() + j;
            q[j] = c[0] + t * (c[2] + t * (c[4] + t * c[6]));
            v[j] = c[2] + t * (2 * c[4] + t * 3 * c[6]), a[j] = 2 * c[4] + 6 * t * c[6];
        }
        dynamics.torques(q, v, a, tau);
        for (int j = 0; j < 2; ++j) most[j] = std::max(most[j], std::fabs(tau[j]));
    }
    return most;
}

}  // namespace

TEST(torques_are_proved_up_to_their_largest_value) {
    TorqueProof proof(arm(), {0.0, 0.0});
    for (int round = 0; round < 10; ++round) {
        const Curve curve = swing(uniform(-3, 3), uniform(-3, 3));
        const std::vector<double> most = dense(curve);
        const auto limits = [&](double share, int of) {
            return std::vector<double>{of ? 1e3 : share * most[0], of ? share * most[1] : 1e3};
        };
        for (int joint : {0, 1}) {
            CHECK(proof.overload(curve, limits(1.001, joint)).joint == -1);
            CHECK(proof.overload(curve, limits(0.999, joint)).joint == joint);
        }
    }
}

TEST(what_many_pieces_take_is_no_loss_to_the_last) {
    TorqueProof proof(arm(), {0.0, 0.0});
    const Curve last = swing(1.0, -1.0);
    Curve curve{{0.0}, {}, 3, 2};
    for (int piece = 1; piece <= 5000; ++piece) {  // upright
        curve.breakpoints.push_back(0.1 * piece);
        curve.coefficients.insert(curve.coefficients.end(), {1.57, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    }
    curve.breakpoints.push_back(curve.breakpoints.back() + 0.5);
    curve.coefficients.insert(curve.coefficients.end(), last.coefficients.begin(), last.coefficients.end());
    const std::vector<double> most = dense(last);
    CHECK(proof.overload(curve, {1.001 * most[0], 1.001 * most[1]}).joint == -1);
}

TEST(a_motion_that_takes_too_many_intervals_is_given_up) {
    TorqueProof proof(arm(), {0.0, 0.0});
    const Curve endless{{0.0, 1e5}, {0.0, 0.0, 1e-3, 1e-3}, 1, 2};
    CHECK(proof.overload(endless, {35.0, 20.0}).joint >= 0);
}

TEST(the_bound_on_curvature_holds) {
    TorqueProof proof(arm(), {0.0, 0.0});
    InverseDynamics dynamics(arm());
    const double step = 1e-3;
    for (int round = 0; round < 200; ++round) {
        double x[2][5], motion[10];  // derivatives 0 to 4 at one instant
        for (auto &joint : x)
            for (double &each : joint) each = uniform(-2, 2);
        for (int k = 0; k < 5; ++k)
            for (int j = 0; j < 2; ++j) {  // bounds over [-step, step]
                motion[2 * k + j] = 0.0;
                double factor = 1.0;
                for (int i = k; i < 5; ++i)
                    motion[2 * k + j] += std::fabs(x[j][i]) * factor, factor *= step / (i - k + 1);
            }
        double tau[3][2];
        for (int at = -1; at <= 1; ++at) {
            double state[3][2];
            for (int j = 0; j < 2; ++j)
                for (int k = 0; k < 3; ++k) {
                    double factor = 1.0;
                    state[k][j] = 0.0;
                    for (int i = k; i < 5; ++i) state[k][j] += x[j][i] * factor, factor *= at * step / (i - k + 1);
                }
            dynamics.torques(state[0], state[1], state[2], tau[at + 1]);
        }
        double size[2], curvature[2];
        proof.bounds(motion, size, curvature);
        for (int j = 0; j < 2; ++j) {
            CHECK(std::fabs(tau[1][j]) <= size[j]);
            CHECK(std::fabs(tau[0][j] - 2.0 * tau[1][j] + tau[2][j]) / (step * step) <= curvature[j] + 1e-3);
        }
    }
}

}  // namespace optiplan::test_torque_proof
