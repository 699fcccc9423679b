#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_tree {

TEST(poses_are_those_of_the_planar_arm) {
    const Tree tree = arm();
    Pose X[3];
    for (int k = 0; k < 50; ++k) {
        const double q[2] = {uniform(-3, 3), uniform(-3, 3)};
        tree.poses(q, X);
        const Vec3 tip = X[2] * Vec3{1, 0, 0};
        NEAR(tip.x, std::cos(q[0]) + std::cos(q[0] + q[1]), 1e-14);
        NEAR(tip.y, std::sin(q[0]) + std::sin(q[0] + q[1]), 1e-14);
        NEAR(tip.z, 0.0, 1e-14);
    }
}

static double potential(const Tree &tree, double first, double second) {
    const double q[2] = {first, second};
    Pose X[3];
    tree.poses(q, X);
    double energy = 0.0;
    for (int j = 1; j < 3; ++j) energy -= tree.joints[j].mass * dot(tree.gravity, X[j] * tree.joints[j].com);
    return energy;
}

TEST(gravity_torques_are_the_slope_of_the_potential) {
    const Tree tree = arm();
    const double h = 1e-6;
    Pose X[3];
    for (int k = 0; k < 50; ++k) {
        const double q[2] = {uniform(-3, 3), uniform(-3, 3)};
        double tau[2];
        tree.poses(q, X);
        tree.gravity_torques(X, tau);
        NEAR(tau[0], (potential(tree, q[0] + h, q[1]) - potential(tree, q[0] - h, q[1])) / (2 * h), 1e-7);
        NEAR(tau[1], (potential(tree, q[0], q[1] + h) - potential(tree, q[0], q[1] - h)) / (2 * h), 1e-7);
    }
}

}  // namespace optiplan::test_tree
