// The kinematic tree of a robot: joints that turn or slide, some of which follow others.
#pragma once

#include <vector>

#include "pose.hpp"

namespace optiplan {

// A joint and the link that it carries. Position: multiplier * q[leader] + offset.
struct Joint {
    int parent;      // joint that carries it; 0 is the world
    Pose X_PJ;       // fixed placement in the parent's frame
    bool revolute;   // or prismatic
    Vec3 axis;       // unit vector, in the joint's own frame
    int leader;      // planned joint, from 0
    double multiplier, offset;
    double mass;     // kg, of the link
    Vec3 com;        // its centre of mass, m, in the joint's frame
    Mat3 inertia;    // about that centre, kg m^2, in the joint's frame
};

struct Tree {
    std::vector<Joint> joints;  // [0] is the world; parents come before children
    int planned = 0;            // n
    Vec3 gravity{0.0, 0.0, -9.81};

    int count() const { return static_cast<int>(joints.size()); }

    // Poses X_WJ of all joints at q (n,): out[0] is the world.
    void poses(const double *q, Pose *out) const;

    // Torques (n,) that hold the tree against gravity, N m or N, where `poses` put it.
    void gravity_torques(const Pose *poses, double *out) const;

    // Axis of joint j in the world.
    Vec3 axis(const Pose *poses, int j) const { return poses[j].R * joints[j].axis; }
};

}  // namespace optiplan
