// A planar arm of two links of 1 m in the plane z = 0, gravity along -y, and a box that its links must not touch.
#pragma once

#include "world/world.hpp"

namespace optiplan {

inline Tree arm() {
    const Mat3 inertia{{{0.01, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}}};
    Tree tree;
    tree.joints.push_back({0, {}, true, {0, 0, 1}, 0, 0.0, 0.0, 0.0, {}, inertia});
    for (int j = 1; j <= 2; ++j)
        tree.joints.push_back(
            {j - 1, {{}, {j - 1.0, 0, 0}}, true, {0, 0, 1}, j - 1, 1.0, 0.0, 2.0, {0.5, 0.1, 0.0}, inertia});
    tree.planned = 2;
    tree.gravity = {0.0, -9.81, 0.0};
    return tree;
}

inline Body body(int joint, Shape shape, const Pose &X_JB, const Vec3 &half) {
    Body made;
    made.joint = joint, made.X_JB = X_JB, made.shapes = {std::move(shape)};
    made.centre = {}, made.half = half, made.radius = norm(half);
    return made;
}

// Pairs: 0 is the first link and the box, 1 the second link and the box.
inline World arm_and_box(const Vec3 &at = {1.0, 1.0, 0.0}, const TubeError &tube = {}) {
    const Pose along_x{{{{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}}, {0.5, 0, 0}};
    const Vec3 half{0.05, 0.05, 0.55}, box{0.1, 0.1, 0.1};
    const std::vector<Body> bodies{body(1, Shape::capsule(0.05, 0.5), along_x, half),
                                   body(2, Shape::capsule(0.05, 0.5), along_x, half),
                                   body(0, Shape::box(box), {{}, at}, box)};
    return {arm(), bodies, {{0, 2}, {1, 2}}, {}, {}, tube};
}

// Change of each pair's distance at most, m per rad of each joint.
inline std::vector<double> arms() { return {1.1, 0.0, 2.1, 1.1}; }

inline bool collides(const World &world, const double *q) {
    Placement at = world.placement();
    world.place(q, at);
    return world.collides(at);
}

inline double distance_at(const World &world, int pair, double first, double second) {
    const double q[2] = {first, second};
    Placement at = world.placement();
    world.place(q, at);
    return world.distance(at, pair, HUGE_VAL).distance;
}

}  // namespace optiplan
