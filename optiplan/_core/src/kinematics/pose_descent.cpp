#include "kinematics/pose_descent.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

PoseDescent::PoseDescent(const Tree &tree, int joint, const Pose &X_JF, int rows, DescentRules rules)
    : tree_(tree), joint_(joint), rows_(rows), X_JF_(X_JF), rules_(rules), poses_(tree.joints.size()),
      J_(6 * tree.planned), step_(tree.planned), best_(tree.planned), held_(tree.planned) {
    for (int j = joint; j > 0; j = tree.joints[j].parent) chain_.push_back(j);
}

// Sets error and Jacobian at q; returns the squared error.
double PoseDescent::linearise(const Pose &X_WG, const double *q) {
    tree_.poses(q, poses_.data());
    const Pose X_WF = poses_[joint_] * X_JF_;
    const Vec3 shift = X_WG.p - X_WF.p;
    const Vec3 turn = rows_ == 6 ? rotation_vector(X_WG.R * transpose(X_WF.R)) : Vec3{};
    e_ = {shift.x, shift.y, shift.z, turn.x, turn.y, turn.z};
    std::fill(J_.begin(), J_.end(), 0.0);
    for (int j : chain_) {
        const Joint &joint = tree_.joints[j];
        const Vec3 axis = joint.multiplier * tree_.axis(poses_.data(), j);
        const Vec3 moved = joint.revolute ? cross(axis, X_WF.p - poses_[j].p) : axis;
        double *column = J_.data() + 6 * joint.leader;
        column[0] += moved.x, column[1] += moved.y, column[2] += moved.z;
        if (joint.revolute) column[3] += axis.x, column[4] += axis.y, column[5] += axis.z;
    }
    double squared = 0.0;
    for (int k = 0; k < rows_; ++k) squared += e_[k] * e_[k];
    return squared;
}

// step = J^T (J J^T + damping I)^-1 e of the joints that are not held, by L D L^T.
void PoseDescent::solve(double damping) {
    double A[6][6], y[6];
    for (int i = 0; i < rows_; ++i)
        for (int k = 0; k <= i; ++k) {
            A[i][k] = i == k ? damping : 0.0;
            for (int j = 0; j < tree_.planned; ++j)
                if (!held_[j]) A[i][k] += J_[6 * j + i] * J_[6 * j + k];
        }
    for (int i = 0; i < rows_; ++i) {
        y[i] = e_[i];
        for (int k = 0; k < i; ++k) {
            double sum = A[i][k];
            for (int m = 0; m < k; ++m) sum -= A[i][m] * A[k][m] * A[m][m];
            A[i][k] = sum / A[k][k];
            y[i] -= A[i][k] * y[k];
        }
        for (int m = 0; m < i; ++m) A[i][i] -= A[i][m] * A[i][m] * A[m][m];
        A[i][i] = std::max(A[i][i], 0.5 * damping);  // rounding may take more than was added
    }
    for (int i = rows_; i-- > 0;) {
        y[i] /= A[i][i];
        for (int k = i + 1; k < rows_; ++k) y[i] -= A[k][i] * y[k];
    }
    for (int j = 0; j < tree_.planned; ++j) {
        step_[j] = 0.0;
        for (int i = 0; i < rows_ && !held_[j]; ++i) step_[j] += J_[6 * j + i] * y[i];
    }
}

// Holds the joints that are at a bound and would pass it; whether there are more of them than before.
bool PoseDescent::hold(const double *low, const double *high, const double *q) {
    bool more = false;
    for (int j = 0; j < tree_.planned; ++j) {
        const bool pushed = (q[j] <= low[j] && step_[j] < 0.0) || (q[j] >= high[j] && step_[j] > 0.0);
        more |= pushed;
        held_[j] |= pushed;
    }
    return more;
}

// One damped step; joints that it would push through a bound are held there and the rest is solved again.
bool PoseDescent::step(const double *low, const double *high, double damping, double *q) {
    std::fill(held_.begin(), held_.end(), 0);
    solve(damping);
    for (int k = 0; k < 2 && hold(low, high, q); ++k) solve(damping);
    double largest = 0.0;
    for (double by : step_) largest = std::max(largest, std::fabs(by));
    if (!std::isfinite(largest)) return false;
    const double share = largest > rules_.longest ? rules_.longest / largest : 1.0;
    for (int j = 0; j < tree_.planned; ++j) q[j] = std::min(std::max(q[j] + share * step_[j], low[j]), high[j]);
    return true;
}

void PoseDescent::descend(const Pose &X_WG, const double *low, const double *high, int iterations, double gain,
                          double *q) {
    const int n = tree_.planned;
    for (int j = 0; j < n; ++j) q[j] = std::min(std::max(q[j], low[j]), high[j]);
    std::copy(q, q + n, best_.begin());
    double least = std::numeric_limits<double>::infinity(), milestone = least;
    for (int k = 0; k < iterations; ++k) {
        const double error = linearise(X_WG, q);
        if (error < least) std::copy(q, q + n, best_.begin()), least = error;
        if (error < rules_.converged * rules_.converged) break;
        if (k % rules_.patience == 0) {
            if (least > (1.0 - gain) * (1.0 - gain) * milestone) break;
            milestone = least;
        }
        if (!step(low, high, rules_.damping * error + rules_.least_damping, q)) break;
    }
    std::copy(best_.begin(), best_.end(), q);
}

}  // namespace optiplan
