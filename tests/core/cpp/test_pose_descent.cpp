#include "kinematics/pose_descent.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_pose_descent {

static const DescentRules RULES{1e-9, 0.05, 1e-12, 0.8, 5};

static Mat3 turned(const Vec3 &axis, double angle) {
    Tree tree;
    tree.joints.resize(2);
    tree.joints[1] = {0, {}, true, axis, 0, 1.0, 0.0, 0.0, {}, {}};
    Pose X[2];
    tree.poses(&angle, X);
    return X[1].R;
}

TEST(rotation_vectors_are_those_of_the_rotation) {
    for (double angle : {0.0, 1e-13, 1e-7, 0.3, 1.57, 2.8, 3.1, 3.1415, 3.14159265, M_PI})
        for (int k = 0; k < 20; ++k) {
            Vec3 axis{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
            axis = (1.0 / norm(axis)) * axis;
            const Vec3 found = rotation_vector(turned(axis, angle));
            NEAR(std::min(norm(found - angle * axis), angle > 3.1 ? norm(found + angle * axis) : 1.0), 0.0, 1e-7);
        }
}

TEST(a_planar_arm_reaches_what_it_can) {
    const Tree tree = arm();
    const Pose X_JF{{}, {1, 0, 0}};
    PoseDescent descent(tree, 2, X_JF, 3, RULES);
    const double low[2] = {-3.0, 0.1}, high[2] = {3.0, 3.0};
    Pose X[3];
    for (int k = 0; k < 100; ++k) {
        const double q[2] = {uniform(-2.5, 2.5), uniform(0.3, 2.5)};
        tree.poses(q, X);
        const Pose target = X[2] * X_JF;
        double found[2] = {q[0] + uniform(-0.3, 0.3), q[1] + uniform(-0.3, 0.3)};
        descent.descend(target, low, high, 60, 0.3, found);
        tree.poses(found, X);
        NEAR(norm(X[2] * X_JF.p - target.p), 0.0, 1e-8);
        for (int j = 0; j < 2; ++j) CHECK(found[j] >= low[j] && found[j] <= high[j]);
    }
}

TEST(out_of_reach_it_stretches_towards_the_target_within_the_bounds) {
    const Tree tree = arm();
    PoseDescent descent(tree, 2, {{}, {1, 0, 0}}, 3, RULES);
    const double low[2] = {-1.0, -2.0}, high[2] = {0.5, 2.0};
    double q[2] = {0.0, 0.3};
    descent.descend({{}, {0.0, 3.0, 0.0}}, low, high, 200, 1e-4, q);
    NEAR(q[0], 0.5, 1e-12);
    CHECK(q[1] > 0.5 && q[1] <= 2.0);
}

}  // namespace optiplan::test_pose_descent
