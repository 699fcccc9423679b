#include "verify/torque_proof.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double ROUNDING = 1e-12;  // share of the sum of all that adds up to a torque
static constexpr int ORDERS = 5, DEPTH = 24;
static constexpr int MOST = 5000, MOST_OF_PIECE = 8;  // intervals, and more a piece, after which a proof is given up
static constexpr double FACTORIALS[ORDERS] = {1.0, 1.0, 2.0, 6.0, 24.0};

TorqueProof::TorqueProof(const Tree &tree, std::vector<double> armature)
    : tree_(tree), dynamics_(tree), armature_(std::move(armature)), gravity_(norm(tree.gravity)) {
    for (const Joint &joint : tree_.joints) {
        offset_.push_back(norm(joint.X_PJ.p));
        lever_.push_back(norm(joint.com));
        double squares = 0.0, most = 0.0;  // two norms that are no less than the spectral one
        for (const Vec3 &row : joint.inertia.rows) {
            squares += squared_norm(row);
            most = std::max(most, std::fabs(row[0]) + std::fabs(row[1]) + std::fabs(row[2]));
        }
        inertia_.push_back(std::min(std::sqrt(squares), most));
    }
    for (auto *each : {&q_, &turn_, &fixed_, &axis_, &origin_, &force_, &moment_})
        each->assign(ORDERS * tree_.joints.size(), 0.0);
}

// Bounds are |x^(k)| / k!, so that Leibniz' rule has no factors.
void TorqueProof::bounds(const double *motion, double *size, double *curvature) {
    const std::size_t J = tree_.joints.size(), n = static_cast<std::size_t>(tree_.planned);
    const auto term = [&](const std::vector<double> &x, const std::vector<double> &y, std::size_t j, int k) {
        double sum = 0.0;
        for (int l = 0; l <= k; ++l) sum += x[l * J + j] * y[(k - l) * J + j];
        return sum;
    };
    std::vector<double> &force = force_, &moment = moment_;
    std::vector<double> arm(ORDERS * J, 0.0), rates(ORDERS * J, 0.0), spin(ORDERS * J, 0.0);
    fixed_[0] = axis_[0] = 1.0;
    for (int k = 1; k < ORDERS; ++k) fixed_[k * J] = axis_[k * J] = 0.0;
    for (int k = 0; k < ORDERS; ++k) turn_[k * J] = origin_[k * J] = 0.0;
    for (std::size_t j = 1; j < J; ++j) {
        const Joint &joint = tree_.joints[j];
        const std::size_t parent = static_cast<std::size_t>(joint.parent);
        for (int k = 0; k < ORDERS; ++k)
            q_[k * J + j] = std::fabs(joint.multiplier) * motion[k * n + joint.leader] / FACTORIALS[k];
        q_[j] += std::fabs(joint.offset);
        for (int k = 0; k + 1 < ORDERS; ++k) rates[k * J + j] = joint.revolute ? q_[(k + 1) * J + j] * (k + 1) : 0.0;
        for (int k = 0; k < ORDERS; ++k) axis_[k * J + j] = fixed_[k * J + parent];
        fixed_[j] = 1.0;
        for (int k = 0; k + 1 < ORDERS; ++k) {
            turn_[k * J + j] = turn_[k * J + parent] + term(axis_, rates, j, k);
            fixed_[(k + 1) * J + j] = term(turn_, fixed_, j, k) / (k + 1);
        }
        for (int k = 0; k < ORDERS; ++k) {
            double own = offset_[j] * axis_[k * J + j];
            if (!joint.revolute) own += term(axis_, q_, j, k);
            origin_[k * J + j] = origin_[k * J + parent] + own;
        }
        // Force, N, and moment about its joint, N m, that accelerate the body, and two derivatives.
        for (int k = 0; k < ORDERS; ++k) arm[k * J + j] = lever_[j] * fixed_[k * J + j];
        for (int k = 0; k < 3; ++k)
            force[k * J + j] = joint.mass * (k + 2) * (k + 1) * (origin_[(k + 2) * J + j] + arm[(k + 2) * J + j]);
        force[j] += joint.mass * gravity_;
        double turned[4] = {1.0, 0.0, 0.0, 0.0};
        for (int k = 0; k < 3; ++k) {
            for (int l = 0; l <= k; ++l) turned[k + 1] += turn_[l * J + j] * turned[k - l];
            turned[k + 1] *= 2.0 / (k + 1);
        }
        for (int k = 1; k < 4; ++k) {
            double sum = 0.0;
            for (int l = 0; l <= k; ++l) sum += turned[l] * turn_[(k - l) * J + j];
            spin[(k - 1) * J + j] = k * inertia_[j] * sum;
        }
        for (int k = 0; k < 3; ++k) moment[k * J + j] = term(arm, force, j, k) + spin[k * J + j];
    }
    std::fill_n(size, n, 0.0), std::fill_n(curvature, n, 0.0);
    for (std::size_t j = J; j-- > 1;) {  // from the tips: a joint transmits what all that it carries need
        const Joint &joint = tree_.joints[j];
        const std::size_t parent = static_cast<std::size_t>(joint.parent);
        const std::vector<double> &carried = joint.revolute ? moment : force;
        const double motor = static_cast<std::size_t>(joint.leader) < armature_.size() ? armature_[joint.leader] : 0.0;
        const double second =
            axis_[j] * carried[2 * J + j] + axis_[J + j] * carried[J + j] + axis_[2 * J + j] * carried[j];
        const double share = std::fabs(joint.multiplier);
        size[joint.leader] += share * (carried[j] + 2.0 * motor * q_[2 * J + j]);
        curvature[joint.leader] += share * (2.0 * second + 24.0 * motor * q_[4 * J + j]);
        if (!parent) continue;
        for (int k = 0; k < 3; ++k) {
            arm[k * J + j] = offset_[j] * axis_[k * J + j];
            if (!joint.revolute) arm[k * J + j] += term(axis_, q_, j, k);
        }
        for (int k = 0; k < 3; ++k) {
            moment[k * J + parent] += moment[k * J + j] + term(arm, force, j, k);
            force[k * J + parent] += force[k * J + j];
        }
    }
}

void TorqueProof::torques(const Curve &curve, int piece, double local, double *tau) {
    const std::size_t n = static_cast<std::size_t>(curve.joints), size = static_cast<std::size_t>(curve.degree) + 1;
    const double *c = curve.coefficients.data() + static_cast<std::size_t>(piece) * size * n;
    std::vector<double> at(3 * n, 0.0);
    for (std::size_t k = size; k-- > 0;)
        for (std::size_t j = 0; j < n; ++j) {
            at[2 * n + j] = at[2 * n + j] * local + 2.0 * at[n + j];
            at[n + j] = at[n + j] * local + at[j];
            at[j] = at[j] * local + c[k * n + j];
        }
    dynamics_.torques(at.data(), at.data() + n, at.data() + 2 * n, tau);
    for (std::size_t j = 0; j < n; ++j) tau[j] += armature_[j] * at[2 * n + j];
}

bool TorqueProof::part(const Curve &curve, int piece, double begin, double width, const double *left,
                       const double *right, const std::vector<double> &limits, int depth, Overload &found) {
    const std::size_t n = static_cast<std::size_t>(curve.joints);
    const int degree = curve.degree;
    const double *c = curve.coefficients.data() + static_cast<std::size_t>(piece) * (degree + 1) * n;
    std::vector<double> motion(ORDERS * n, 0.0), size(n), curvature(n);
    const double half = 0.5 * width, middle = begin + half;
    for (std::size_t j = 0; j < n; ++j) {
        double b[16];
        for (int k = 0; k <= degree; ++k) b[k] = c[k * n + j];
        for (int i = 0; i < degree; ++i)
            for (int k = degree; k-- > i;) b[k] += middle * b[k + 1];
        for (int order = 0; order < ORDERS && order <= degree; ++order) {
            double sum = 0.0;
            for (int k = degree; k >= order; --k) {
                double factor = std::fabs(b[k]);
                for (int f = 0; f < order; ++f) factor *= k - f;
                sum = sum * half + factor;
            }
            motion[order * n + j] = sum;
        }
    }
    bounds(motion.data(), size.data(), curvature.data());
    const bool last = depth == 0 || intervals_left_-- <= 0;
    bool proved = true;
    for (std::size_t j = 0; j < n && proved; ++j) {
        const double ends = std::max(std::fabs(left[j]), std::fabs(right[j])), spare = ROUNDING * size[j];
        proved = ends + spare + 0.125 * width * width * curvature[j] <= limits[j];
        if (!(ends + spare <= limits[j]) || (last && !proved)) {
            found = {static_cast<int>(j), curve.breakpoints[piece] + begin, ends};
            return false;
        }
    }
    if (proved) return true;
    std::vector<double> between(n);
    torques(curve, piece, middle, between.data());
    return part(curve, piece, begin, half, left, between.data(), limits, depth - 1, found) &&
           part(curve, piece, middle, half, between.data(), right, limits, depth - 1, found);
}

TorqueProof::Overload TorqueProof::overload(const Curve &curve, const std::vector<double> &limits) {
    Overload found;
    intervals_left_ = MOST + MOST_OF_PIECE * (static_cast<int>(curve.breakpoints.size()) - 1);
    const std::size_t n = static_cast<std::size_t>(curve.joints);
    std::vector<double> left(n), right(n);
    for (std::size_t piece = 0; piece + 1 < curve.breakpoints.size(); ++piece) {
        const double width = curve.breakpoints[piece + 1] - curve.breakpoints[piece];
        torques(curve, static_cast<int>(piece), 0.0, left.data());
        torques(curve, static_cast<int>(piece), width, right.data());
        if (!part(curve, static_cast<int>(piece), 0.0, width, left.data(), right.data(), limits, DEPTH, found)) break;
    }
    return found;
}

}  // namespace optiplan
