#include "program/inverse_dynamics.hpp"

#include <algorithm>

namespace optiplan {

namespace {

Spatial operator+(const Spatial &a, const Spatial &b) { return {a.angular + b.angular, a.linear + b.linear}; }
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

}  // namespace

InverseDynamics::InverseDynamics(const Tree &tree) : tree_(tree) {
    const std::size_t count = tree.joints.size();
    pose_.resize(count), inertia_.resize(count), composite_.resize(count);
    for (auto *each : {&axis_, &twist_, &acceleration_, &force_, &axis_rate_, &carried_, &held_, &lift_})
        each->resize(count);
    coriolis_.resize(count);
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

// With inertia (m, c, J), twist (w, u) and momentum (L, p): turning = S + S' - [L] and
// S = -J [w] - c u' + (c . u) 1.
Coriolis InverseDynamics::coriolis(int j) const {
    const auto &[w, u] = twist_[j];
    const auto &[mass, c, J] = inertia_[j];
    const Spatial momentum = inertia_[j] * twist_[j];
    const double along = optiplan::dot(c, u);
    Mat3 S{{cross(w, J.rows[0]) - c.x * u, cross(w, J.rows[1]) - c.y * u, cross(w, J.rows[2]) - c.z * u}};
    S.rows[0].x += along, S.rows[1].y += along, S.rows[2].z += along;
    const Mat3 other = transpose(S);
    const auto &[x, y, z] = momentum.angular;
    return {{{S.rows[0] + other.rows[0] + Vec3{0.0, z, -y}, S.rows[1] + other.rows[1] + Vec3{-z, 0.0, x},
              S.rows[2] + other.rows[2] + Vec3{y, -x, 0.0}}},
            momentum.linear};
}

void InverseDynamics::derivatives(double *by_q, double *by_v, double *by_a) {
    const int n = tree_.planned, count = tree_.count();
    for (double *each : {by_q, by_v, by_a}) std::fill_n(each, n * n, 0.0);
    for (int j = 1; j < count; ++j) {
        const int parent = tree_.joints[j].parent;
        composite_[j] = inertia_[j], coriolis_[j] = coriolis(j);
        lift_[j] = cross_motion(acceleration_[parent], axis_[j]) + cross_motion(twist_[parent], axis_rate_[j]);
    }
    for (int j = count - 1; j > 0; --j) {
        const int parent = tree_.joints[j].parent;
        if (!parent) continue;
        add(composite_[parent], composite_[j]);
        for (int i = 0; i < 3; ++i) coriolis_[parent].turning.rows[i] += coriolis_[j].turning.rows[i];
        coriolis_[parent].momentum += coriolis_[j].momentum;
    }
    for (int j = 1; j < count; ++j) {
        const Joint &joint = tree_.joints[j];
        const auto &[turning, momentum] = coriolis_[j];
        const auto applied = [&](const Vec3 &w) { return Spatial{turning * w, 2.0 * cross(w, momentum)}; };
        const Spatial own_q =
            applied(axis_rate_[j].angular) + composite_[j] * lift_[j] + cross_force(axis_[j], carried_[j]);
        const Spatial own_v = applied(axis_[j].angular) + composite_[j] * (2.0 * axis_rate_[j]);
        const Spatial own_a = composite_[j] * axis_[j];
        // B' times the axis, of which the linear part is zero.
        const Vec3 back = transposed(turning, axis_[j].angular) + 2.0 * cross(momentum, axis_[j].linear);
        for (int i = j; i > 0; i = tree_.joints[i].parent) {
            const Joint &other = tree_.joints[i];
            const double factor = joint.multiplier * other.multiplier;
            const int up = other.leader * n + joint.leader, down = joint.leader * n + other.leader;
            by_q[up] += factor * dot(axis_[i], own_q);
            by_v[up] += factor * dot(axis_[i], own_v);
            by_a[up] += factor * dot(axis_[i], own_a);
            if (i == j) continue;
            by_q[down] += factor * (optiplan::dot(back, axis_rate_[i].angular) + dot(own_a, lift_[i]));
            by_v[down] += factor * (optiplan::dot(back, axis_[i].angular) + 2.0 * dot(own_a, axis_rate_[i]));
            by_a[down] += factor * dot(axis_[i], own_a);
        }
    }
}

}  // namespace optiplan
