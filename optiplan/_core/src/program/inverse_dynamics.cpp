#include "program/inverse_dynamics.hpp"

#include <algorithm>

namespace optiplan {

namespace {

Spatial operator+(const Spatial &a, const Spatial &b) { return {a.angular + b.angular, a.linear + b.linear}; }
Spatial operator-(const Spatial &a, const Spatial &b) { return {a.angular - b.angular, a.linear - b.linear}; }
Spatial operator*(double s, const Spatial &a) { return {s * a.angular, s * a.linear}; }
double dot(const Spatial &a, const Spatial &b) {
    return optiplan::dot(a.angular, b.angular) + optiplan::dot(a.linear, b.linear);
}

// v x m, of twists.
Spatial cross_motion(const Spatial &v, const Spatial &m) {
    return {cross(v.angular, m.angular), cross(v.angular, m.linear) + cross(v.linear, m.angular)};
}

// v x* f, of a twist and a wrench.
Spatial cross_force(const Spatial &v, const Spatial &f) {
    return {cross(v.angular, f.angular) + cross(v.linear, f.linear), cross(v.angular, f.linear)};
}

Spatial operator*(const SpatialInertia &inertia, const Spatial &v) {
    return {inertia.rotational * v.angular + cross(inertia.moment, v.linear),
            inertia.mass * v.linear - cross(inertia.moment, v.angular)};
}

void add(SpatialInertia &a, const SpatialInertia &b) {
    a.mass += b.mass;
    a.moment += b.moment;
    for (int i = 0; i < 3; ++i) a.rotational.rows[i] += b.rotational.rows[i];
}

SpatialInertia placed(const Joint &joint, const Pose &pose) {
    const Vec3 centre = pose * joint.com;
    const Mat3 turned = pose.R * joint.inertia * transpose(pose.R);
    SpatialInertia found{joint.mass, joint.mass * centre, turned};
    const double c[3] = {centre.x, centre.y, centre.z}, square = squared_norm(centre);
    for (int i = 0; i < 3; ++i) {
        const double along[3] = {i == 0 ? square : 0.0, i == 1 ? square : 0.0, i == 2 ? square : 0.0};
        found.rotational.rows[i] +=
            joint.mass * Vec3{along[0] - c[i] * c[0], along[1] - c[i] * c[1], along[2] - c[i] * c[2]};
    }
    return found;
}

constexpr std::size_t SQUARE = 36;

}  // namespace

InverseDynamics::InverseDynamics(const Tree &tree) : tree_(tree) {
    const std::size_t count = tree.joints.size();
    pose_.resize(count), inertia_.resize(count), composite_.resize(count);
    for (auto *each : {&axis_, &twist_, &acceleration_, &force_, &axis_rate_, &carried_, &held_}) each->resize(count);
    coriolis_.resize(count * SQUARE);
}

void InverseDynamics::torques(const double *q, const double *v, const double *a, double *tau) {
    tree_.poses(q, pose_.data());
    twist_[0] = {};
    acceleration_[0] = {{}, -tree_.gravity};
    for (int j = 1; j < tree_.count(); ++j) {
        const Joint &joint = tree_.joints[j];
        const Vec3 direction = tree_.axis(pose_.data(), j);
        axis_[j] = joint.revolute ? Spatial{direction, cross(pose_[j].p, direction)} : Spatial{{}, direction};
        const double speed = joint.multiplier * v[joint.leader], rise = joint.multiplier * a[joint.leader];
        axis_rate_[j] = cross_motion(twist_[joint.parent], axis_[j]);
        twist_[j] = twist_[joint.parent] + speed * axis_[j];
        acceleration_[j] = acceleration_[joint.parent] + rise * axis_[j] + speed * axis_rate_[j];
        inertia_[j] = placed(joint, pose_[j]);
        force_[j] = inertia_[j] * acceleration_[j] + cross_force(twist_[j], inertia_[j] * twist_[j]);
        carried_[j] = force_[j];
    }
    pass_down(carried_, tau);
}

void InverseDynamics::at_rest(double *tau) {
    for (int j = 1; j < tree_.count(); ++j) held_[j] = inertia_[j] * Spatial{{}, -tree_.gravity};
    pass_down(held_, tau);
}

void InverseDynamics::pass_down(std::vector<Spatial> &wrenches, double *tau) const {
    std::fill_n(tau, tree_.planned, 0.0);
    for (int j = tree_.count() - 1; j > 0; --j) {
        const Joint &joint = tree_.joints[j];
        tau[joint.leader] += joint.multiplier * dot(axis_[j], wrenches[j]);
        if (joint.parent) wrenches[joint.parent] += wrenches[j];
    }
}

// B of body j times x, with 2 B = (v x*) I - I (v x) + (I v) x-bar*.
Spatial InverseDynamics::coriolis_row(int j, const Spatial &x) const {
    const Spatial &v = twist_[j];
    const SpatialInertia &inertia = inertia_[j];
    return cross_force(v, inertia * x) - inertia * cross_motion(v, x) + cross_force(x, inertia * v);
}

void InverseDynamics::derivatives(double *by_q, double *by_v, double *by_a) {
    const int n = tree_.planned, count = tree_.count();
    for (double *each : {by_q, by_v, by_a}) std::fill_n(each, n * n, 0.0);
    for (int j = 1; j < count; ++j) {
        composite_[j] = inertia_[j];
        for (int k = 0; k < 6; ++k) {
            const double unit[6] = {k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 1.0 : 0.0,
                                    k == 3 ? 1.0 : 0.0, k == 4 ? 1.0 : 0.0, k == 5 ? 1.0 : 0.0};
            const Spatial column = coriolis_row(j, {{unit[0], unit[1], unit[2]}, {unit[3], unit[4], unit[5]}});
            double *into = coriolis_.data() + j * SQUARE + 6 * k;
            for (int i = 0; i < 3; ++i) into[i] = column.angular[i], into[3 + i] = column.linear[i];
        }
    }
    for (int j = count - 1; j > 0; --j) {
        const int parent = tree_.joints[j].parent;
        if (!parent) continue;
        add(composite_[parent], composite_[j]);
        add_scaled(coriolis_.data() + parent * SQUARE, 1.0, coriolis_.data() + j * SQUARE, SQUARE);
    }
    for (int j = 1; j < count; ++j) {
        const Joint &joint = tree_.joints[j];
        const double *matrix = coriolis_.data() + j * SQUARE;
        const auto twice_coriolis = [matrix](const Spatial &x) {
            double sum[6] = {};
            const double entries[6] = {x.angular.x, x.angular.y, x.angular.z, x.linear.x, x.linear.y, x.linear.z};
            for (int k = 0; k < 6; ++k)
                for (int i = 0; i < 6; ++i) sum[i] += entries[k] * matrix[6 * k + i];
            return Spatial{{sum[0], sum[1], sum[2]}, {sum[3], sum[4], sum[5]}};
        };
        // What the motion of joint i (j or an ancestor of it) changes, as wrenches on all that joint j carries.
        const auto lift = [&](int i) {
            return cross_motion(acceleration_[tree_.joints[i].parent], axis_[i]) +
                   cross_motion(twist_[tree_.joints[i].parent], axis_rate_[i]);
        };
        const Spatial own_q =
            twice_coriolis(axis_rate_[j]) + composite_[j] * lift(j) + cross_force(axis_[j], carried_[j]);
        const Spatial own_v = twice_coriolis(axis_[j]) + composite_[j] * (2.0 * axis_rate_[j]);
        const Spatial own_a = composite_[j] * axis_[j];
        for (int i = j; i > 0; i = tree_.joints[i].parent) {
            const Joint &other = tree_.joints[i];
            const double factor = joint.multiplier * other.multiplier;
            const int up = other.leader * n + joint.leader, down = joint.leader * n + other.leader;
            by_q[up] += factor * dot(axis_[i], own_q);
            by_v[up] += factor * dot(axis_[i], own_v);
            by_a[up] += factor * dot(axis_[i], own_a);
            if (i == j) continue;
            by_q[down] += factor * dot(axis_[j], twice_coriolis(axis_rate_[i]) + composite_[j] * lift(i));
            by_v[down] += factor * dot(axis_[j], twice_coriolis(axis_[i]) + composite_[j] * (2.0 * axis_rate_[i]));
            by_a[down] += factor * dot(axis_[i], own_a);
        }
    }
}

}  // namespace optiplan
