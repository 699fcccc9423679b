#include "program/inverse_dynamics.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_inverse_dynamics {

TEST(torques_at_rest_are_those_of_gravity) {
    const Tree tree = arm();
    InverseDynamics dynamics(tree);
    Pose X[3];
    for (int k = 0; k < 20; ++k) {
        const double q[2] = {uniform(-3, 3), uniform(-3, 3)}, v[2] = {uniform(-2, 2), 1.0}, none[2] = {0.0, 0.0};
        double still[2], held[2], moving[2], gravity[2];
        tree.poses(q, X);
        tree.gravity_torques(X, gravity);
        dynamics.torques(q, none, none, still);
        dynamics.torques(q, v, none, moving);
        dynamics.at_rest(held);
        for (int j = 0; j < 2; ++j) NEAR(still[j], gravity[j], 1e-12), NEAR(held[j], gravity[j], 1e-12);
    }
}

TEST(derivatives_equal_differences) {
    Tree tree = arm();
    tree.joints[1].axis = {0.6, 0.0, 0.8};
    const Mat3 inertia{{{0.3, 0.02, 0.01}, {0.02, 0.2, 0.03}, {0.01, 0.03, 0.4}}};
    const Pose skew{{{{0.6, -0.8, 0}, {0.8, 0.6, 0}, {0, 0, 1}}}, {0.1, 0.2, 0.3}};
    tree.joints.push_back({2, skew, false, {0, 0.6, 0.8}, 0, -0.5, 0.1, 1.5, {0.1, -0.2, 0.1}, inertia});
    tree.joints.push_back({3, skew, true, {0.8, 0, 0.6}, 1, 0.7, 0.2, 0.8, {0.2, 0.1, -0.1}, inertia});
    InverseDynamics dynamics(tree);
    const double h = 1e-6;
    for (int k = 0; k < 20; ++k) {
        double state[3][2], tau[2], slope[3][4], up[2], down[2];
        for (auto &row : state) row[0] = uniform(-2, 2), row[1] = uniform(-2, 2);
        dynamics.torques(state[0], state[1], state[2], tau);
        dynamics.derivatives(slope[0], slope[1], slope[2]);
        for (int order = 0; order < 3; ++order)
            for (int j = 0; j < 2; ++j) {
                const double kept = state[order][j];
                state[order][j] = kept + h;
                dynamics.torques(state[0], state[1], state[2], up);
                state[order][j] = kept - h;
                dynamics.torques(state[0], state[1], state[2], down);
                state[order][j] = kept;
                for (int i = 0; i < 2; ++i) NEAR(slope[order][2 * i + j], (up[i] - down[i]) / (2 * h), 1e-6);
            }
        NEAR(slope[2][1], slope[2][2], 1e-12);  // the mass matrix is symmetric, and positive
        CHECK(slope[2][0] > 0.0 && slope[2][0] * slope[2][3] > slope[2][1] * slope[2][2]);
    }
}

}  // namespace optiplan::test_inverse_dynamics
