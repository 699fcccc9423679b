#include "world/tree.hpp"

#include <algorithm>

namespace optiplan {

// exp([axis] angle), by Rodrigues' formula.
static Mat3 rotation_about(const Vec3 &axis, double angle) {
    const double s = std::sin(angle), c = std::cos(angle), v = 1.0 - c;
    const double xy = v * axis.x * axis.y, xz = v * axis.x * axis.z, yz = v * axis.y * axis.z;
    return {{{c + v * axis.x * axis.x, xy - s * axis.z, xz + s * axis.y},
             {xy + s * axis.z, c + v * axis.y * axis.y, yz - s * axis.x},
             {xz - s * axis.y, yz + s * axis.x, c + v * axis.z * axis.z}}};
}

void Tree::poses(const double *q, Pose *out) const {
    out[0] = Pose{};
    for (int j = 1; j < count(); ++j) {
        const Joint &joint = joints[j];
        const double position = joint.multiplier * q[joint.leader] + joint.offset;
        const Pose fixed = out[joint.parent] * joint.X_PJ;
        if (joint.revolute)
            out[j] = {fixed.R * rotation_about(joint.axis, position), fixed.p};
        else
            out[j] = {fixed.R, fixed.p + position * (fixed.R * joint.axis)};
    }
}

void Tree::gravity_torques(const Pose *poses, double *out) const {
    std::vector<double> mass(joints.size());
    std::vector<Vec3> moment(joints.size());  // sum of mass times place, of all that a joint carries
    std::fill(out, out + planned, 0.0);
    for (int j = 1; j < count(); ++j) {
        mass[j] = joints[j].mass;
        moment[j] = joints[j].mass * (poses[j] * joints[j].com);
    }
    for (int j = count() - 1; j > 0; --j) {
        const Joint &joint = joints[j];
        const Vec3 direction = axis(poses, j);
        const Vec3 pull = joint.revolute ? cross(moment[j] - mass[j] * poses[j].p, gravity) : mass[j] * gravity;
        out[joint.leader] -= joint.multiplier * dot(direction, pull);
        mass[joint.parent] += mass[j];
        moment[joint.parent] += moment[j];
    }
}

}  // namespace optiplan
