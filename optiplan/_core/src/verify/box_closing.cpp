#include "verify/box_closing.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace optiplan {

namespace {

constexpr double kSlack = 1e-9;       // rad, m: more than rounding takes
constexpr double kSmallest = 3e-3;  // m: boxes that move no point by more are given up
constexpr double kWide = 0.15;  // m: boxes that move points by more are tried with kRough rods of each body
constexpr double kTooWide = 0.4;  // m: bodies that may be moved by more are not tried
constexpr int kRough = 5;
constexpr double kFar = 1e30;
constexpr double kShares[5] = {0.0, 0.25, 0.5, 0.75, 1.0};
// Shares of a box by which configurations tried in it differ, joint by joint: fractions of irrational numbers.
constexpr double kSpread[8] = {0.618034, 0.414214, 0.732051, 0.236068, 0.645751, 0.316625, 0.605551, 0.123106};
constexpr double kParts[3][2] = {{1.0, 0.0}, {0.0, 1.0}, {0.7, 0.7}};

}  // namespace

BoxClosing::BoxClosing(const Tree &tree, std::vector<Rod> rods, std::vector<RodBody> bodies,
                       std::vector<ObstacleBox> boxes, std::vector<Mat3> turns, std::vector<double> arms)
    : tree_(tree), rods_(std::move(rods)), bodies_(std::move(bodies)), boxes_(std::move(boxes)),
      turns_(std::move(turns)), arms_(std::move(arms)), n_(tree.planned), J_(tree.count() - 1), point_(2 * n_) {
    chain_.assign((J_ + 1) * J_, 0);
    for (int j = 1; j <= J_; ++j) {
        const int parent = tree_.joints[j].parent;
        for (int k = 0; k < J_; ++k) chain_[j * J_ + k] = chain_[parent * J_ + k];
        chain_[j * J_ + j - 1] = 1;
    }
    depth_.assign(J_ + 1, 0);
    for (int j = 1; j <= J_; ++j) depth_[j] = depth_[tree_.joints[j].parent] + 1;
    poses_.resize(J_ + 1);
    axes_.resize(J_ + 1);
    reach_.resize(J_);
    sway_.assign(n_, 0.0);  // m for each rad or m, at most
    for (std::size_t e = 0; e < 2 * rods_.size(); ++e)
        for (int k = 0; k < J_; ++k) {
            double &sway = sway_[tree_.joints[k + 1].leader];
            sway = std::max(sway, std::fabs(tree_.joints[k + 1].multiplier) * arms_[e * J_ + k]);
        }
    for (End &end : ends_) end.slope.resize(3 * J_);
}

void BoxClosing::keep_within(const Corridor &corridor) {
    const int K = steps_ = corridor.steps;
    const std::size_t size = static_cast<std::size_t>(n_) * K;
    highest_before_.assign(corridor.high, corridor.high + size);
    lowest_before_.assign(corridor.low, corridor.low + size);
    highest_after_ = highest_before_;
    lowest_after_ = lowest_before_;
    for (int i = 0; i < n_; ++i)
        for (int k = 1; k < K; ++k) {
            const int here = i * K + k, back = i * K + K - 1 - k;
            highest_before_[here] = std::max(highest_before_[here], highest_before_[here - 1]);
            lowest_before_[here] = std::min(lowest_before_[here], lowest_before_[here - 1]);
            highest_after_[back] = std::max(highest_after_[back], highest_after_[back + 1]);
            lowest_after_[back] = std::min(lowest_after_[back], lowest_after_[back + 1]);
        }
}

// All joints are somewhere in the box at one time. It lies between the first and the last step in which each can be
// there, and in these steps each is within the corridor.
bool BoxClosing::within_time(double *low, double *high) const {
    const int K = steps_;
    int first = 0, last = K - 1;
    for (int pass = 0; pass < 3; ++pass) {
        for (int i = 0; i < n_; ++i) {
            const double *up = &highest_before_[i * K], *up_after = &highest_after_[i * K];
            const double *down = &lowest_before_[i * K], *down_after = &lowest_after_[i * K];
            const double l = low[i], h = high[i];
            // Steps before the first one, or after the last, in which the joint is nowhere in [l, h].
            first = static_cast<int>(std::lower_bound(up + first, up + last + 1, l) - up);
            if (first > last) return false;
            first = static_cast<int>(std::lower_bound(down + first, down + last + 1, h, std::greater<double>()) - down);
            if (first > last) return false;
            last = static_cast<int>(std::upper_bound(up_after + first, up_after + last + 1, l, std::greater<double>()) -
                                    up_after) -
                   1;
            if (first > last) return false;
            last = static_cast<int>(std::upper_bound(down_after + first, down_after + last + 1, h) - down_after) - 1;
            if (first > last) return false;
        }
        bool changed = false;
        for (int i = 0; i < n_; ++i) {
            const double h = std::min(highest_before_[i * K + last], highest_after_[i * K + first]) + kSlack;
            const double l = std::max(lowest_before_[i * K + last], lowest_after_[i * K + first]) - kSlack;
            if (l > low[i]) low[i] = l, changed = true;
            if (h < high[i]) high[i] = h, changed = true;
            if (low[i] > high[i]) return false;
        }
        if (!changed) break;
    }
    return true;
}

void BoxClosing::place(const double *centre) {
    tree_.poses(centre, poses_.data());
    for (int j = 1; j <= J_; ++j) axes_[j] = tree_.axis(poses_.data(), j);
}

// Bound on what the linear part leaves out: 1/2 sum_jk w_max(j, k) D_j D_k over the joints that carry the point.
double BoxClosing::bend(int end, const double *reach) const {
    const double *arm = &arms_[end * J_];
    double before = 0.0, total = 0.0;
    for (int k = 0; k < J_; ++k) {
        if (arm[k] == 0.0) continue;
        total += arm[k] * reach[k] * (before + 0.5 * reach[k]);
        before += reach[k];
    }
    return total;
}

// How far both ends of a rod are spread along the axes of a turn.
void BoxClosing::spread(int rod, const Mat3 &turn, const double *reach) {
    const int joint = rods_[rod].joint;
    for (int side = 0; side < 2; ++side) {
        const int index = 2 * rod + side;
        const double *arm = &arms_[index * J_];
        const Vec3 p = poses_[joint] * rods_[rod].ends[side];
        End &end = ends_[side];
        double travel = kSlack, linear[3] = {0.0, 0.0, 0.0};
        for (int k = 0; k < J_; ++k) {
            if (!chain_[joint * J_ + k]) continue;
            const Vec3 &w = axes_[k + 1];
            const Vec3 g = turn * (tree_.joints[k + 1].revolute ? cross(w, p - poses_[k + 1].p) : w);
            for (int i = 0; i < 3; ++i) {
                end.slope[3 * k + i] = g[i];
                linear[i] += std::fabs(g[i]) * reach[k];
            }
            travel += arm[k] * reach[k];
        }
        const double bent = bend(index, reach) + kSlack;
        for (int i = 0; i < 3; ++i) end.wide[i] = std::min(linear[i] + bent, travel);
    }
}

// Whether some rod meets some box in all configurations of the box; else the joint that hinders the proof most.
//
// Two reasons count. A point of the rod is nearer to the box than its radius. Or the ends are on both sides of a plane
// across the box, at the height z0, and the rod crosses it inside: with a the height of the upper end and b the depth
// of the lower one, the crossing's coordinate along another axis is (A b + B a) / (a + b), which is less than e where
// (A - e) b + (B - e) a < 0; that is linear in each, so the ends of intervals suffice.
bool BoxClosing::collides(const double *reach, bool roughly, Hindrance &found) {
    double best = kFar;
    int best_rod = -1, best_box = -1, best_axis = 0;
    double best_weight[2] = {0.0, 0.0};
    const auto consider = [&](int r, int b) {
        const ObstacleBox &box = boxes_[b];
        const Rod &rod = rods_[r];
        const Mat3 &turn = turns_[box.turn];
        const double radius = rod.radius + box.round;
        const Vec3 p[2] = {poses_[rod.joint] * rod.ends[0], poses_[rod.joint] * rod.ends[1]};
        double at[2][3];
        for (int i = 0; i < 3; ++i) {
            at[0][i] = dot(turn.rows[i], p[0]) - box.centre[i];
            at[1][i] = dot(turn.rows[i], p[1]) - box.centre[i];
            const double edge = box.half[i] + radius;
            if (std::min(at[0][i], at[1][i]) > edge || std::max(at[0][i], at[1][i]) < -edge) return false;
        }
        spread(r, turn, reach);
        // Halvings that a proof would take, as it seems: of every joint that moves the rod.
        const auto effort = [&](double ratio) { return depth_[rod.joint] * std::log(std::max(ratio, 1.05)); };
        const double *wide[2] = {ends_[0].wide, ends_[1].wide};
        for (const double share : kShares) {
            double gap = 0.0, beyond = 0.0, ratio = 0.0, over[3], w[3];
            int axis = 0;
            for (int i = 0; i < 3; ++i) {
                const double middle = std::fabs((1.0 - share) * at[0][i] + share * at[1][i]);
                w[i] = (1.0 - share) * wide[0][i] + share * wide[1][i];
                over[i] = middle - box.half[i];
                const double far = std::max(over[i] + w[i], 0.0), now = std::max(over[i], 0.0);
                gap += far * far, beyond += now * now;
            }
            if (gap < radius * radius) return true;
            if (beyond >= radius * radius) continue;
            for (int i = 0; i < 3; ++i) {
                const double now = std::max(over[i], 0.0);
                const double room = std::sqrt(radius * radius - beyond + now * now) - over[i];
                if (w[i] / room > ratio) ratio = w[i] / room, axis = i;
            }
            if (effort(ratio) < best) {
                best = effort(ratio), best_rod = r, best_axis = axis, best_box = b;
                best_weight[0] = 1.0 - share, best_weight[1] = share;
            }
        }
        for (int k = 0; k < 3; ++k) {
            const int up = at[0][k] >= at[1][k] ? 0 : 1, down = 1 - up;
            const double h = box.half[k];
            if (at[up][k] <= -h || at[down][k] >= h) continue;
            const double top = at[up][k] - wide[up][k], bottom = at[down][k] + wide[down][k];
            const double level = std::clamp(0.5 * (top + bottom), -h, h);
            const double a_mid = at[up][k] - level, b_mid = level - at[down][k];
            if (a_mid <= 0.0 || b_mid <= 0.0) continue;
            const double a_low = top - level, b_low = level - bottom;
            const double a_high = a_mid + wide[up][k], b_high = b_mid + wide[down][k];
            const int x = (k + 1) % 3, y = (k + 2) % 3;
            for (const auto &part : kParts) {
                bool inside = a_low > 0.0 && b_low > 0.0, possible = true;
                double ratio = 0.0;
                int axis = k;
                double weight[2] = {0.0, 0.0};
                if (wide[up][k] / a_mid > ratio) ratio = wide[up][k] / a_mid, weight[up] = 1.0, weight[down] = 0.0;
                if (wide[down][k] / b_mid > ratio) ratio = wide[down][k] / b_mid, weight[down] = 1.0, weight[up] = 0.0;
                for (int o = 0; o < 2; ++o) {
                    const int i = o == 0 ? x : y;
                    const double edge = box.half[i] + part[o] * radius;
                    const double w = (b_mid * wide[up][i] + a_mid * wide[down][i]) / (a_mid + b_mid);
                    for (const double sign : {1.0, -1.0}) {
                        const double A = sign * at[up][i] - edge, B = sign * at[down][i] - edge;
                        const double room = -(A * b_mid + B * a_mid) / (a_mid + b_mid);
                        if (room <= 0.0) {
                            possible = false;
                            break;
                        }
                        if (w / room > ratio) {
                            ratio = w / room, axis = i;
                            weight[up] = b_mid / (a_mid + b_mid), weight[down] = a_mid / (a_mid + b_mid);
                        }
                        const double Aw = A + wide[up][i], Bw = B + wide[down][i];
                        inside = inside && std::max(Aw * b_low, Aw * b_high) + std::max(Bw * a_low, Bw * a_high) < 0.0;
                    }
                    if (!possible) break;
                }
                if (!possible) continue;
                if (inside) return true;
                if (effort(ratio) < best) {
                    best = effort(ratio), best_rod = r, best_axis = axis, best_box = b;
                    best_weight[0] = weight[0], best_weight[1] = weight[1];
                }
            }
        }
        return false;
    };
    if (found.rod >= 0 && consider(found.rod, found.box)) return true;
    const bool nearer = best < found.effort;
    for (const RodBody &body : bodies_) {
        if (nearer) break;
        double travel = 0.0;
        for (int k = 0; k < J_; ++k) travel += arms_[2 * body.rods[0] * J_ + k] * reach[k];
        if (travel > kTooWide) continue;  // not yet: halving its joints is no use before those of others
        const Vec3 middle = poses_[body.joint] * body.centre;
        for (const int b : body.boxes) {
            const ObstacleBox &box = boxes_[b];
            double apart = 0.0;
            for (int i = 0; i < 3; ++i) {
                const double x = std::fabs(dot(turns_[box.turn].rows[i], middle) - box.centre[i]) - box.half[i];
                if (x > 0.0) apart += x * x;
            }
            const double near = body.radius + box.round;
            if (apart > near * near) continue;
            int left = roughly ? kRough : static_cast<int>(body.rods.size());
            for (const int r : body.rods) {
                if (left-- == 0) break;
                if (consider(r, b)) return true;
            }
        }
    }
    found = {best_rod, best_box, -1, best};
    if (best_rod < 0) return false;
    // The joint with the greatest part in what is in the way: its linear part and its part of the bend.
    spread(best_rod, turns_[boxes_[best_box].turn], reach);
    double most = -1.0;
    for (int k = 0; k < J_; ++k) {
        if (!chain_[rods_[best_rod].joint * J_ + k] || reach[k] <= 0.0) continue;
        double part = 0.0;
        for (int side = 0; side < 2; ++side) {
            const double *arm = &arms_[(2 * best_rod + side) * J_];
            double others = 0.0;
            for (int m = 0; m < J_; ++m)
                if (arm[m] > 0.0) others += arm[std::max(m, k)] * reach[m];
            part += best_weight[side] * reach[k] * (std::fabs(ends_[side].slope[3 * k + best_axis]) + 0.5 * others);
        }
        if (part > most) most = part, found.joint = tree_.joints[k + 1].leader;
    }
    return false;
}

// Whether the configuration q can be passed in time, and no rod meets a box there.
bool BoxClosing::passes(const double *q) {
    std::copy(q, q + n_, point_.begin());
    std::copy(q, q + n_, point_.begin() + n_);
    if (!within_time(point_.data(), point_.data() + n_)) return false;
    place(q);
    std::fill(reach_.begin(), reach_.end(), 0.0);
    Hindrance there;
    return !collides(reach_.data(), false, there) && there.rod < 0;
}

Box BoxClosing::close(const double *low, const double *high, std::int64_t most) {
    const int size = 2 * n_ + 3;
    std::vector<double> stack(low, low + n_), centre(n_), box(size);
    stack.insert(stack.end(), high, high + n_);
    stack.insert(stack.end(), {-1.0, -1.0, 0.0});  // the rod and the obstacle's box to be tried first
    for (int k = 1; k <= most; ++k) {  // some configurations, evenly spread
        for (int i = 0; i < n_; ++i) {
            const double share = k * kSpread[i % 8];
            centre[i] = low[i] + (share - std::floor(share)) * (high[i] - low[i]);
        }
        if (passes(centre.data())) return Box::passable;
    }
    while (!stack.empty()) {
        std::copy(stack.end() - size, stack.end(), box.begin());
        stack.resize(stack.size() - size);
        double *l = box.data(), *h = l + n_;
        Hindrance found{static_cast<int>(box[2 * n_]), static_cast<int>(box[2 * n_ + 1]), -1, box[2 * n_ + 2]};
        if (!within_time(l, h)) continue;
        double widest = 0.0;
        int by_sway = 0;
        for (int i = 0; i < n_; ++i) {
            centre[i] = 0.5 * (l[i] + h[i]);
            const double moved = 0.5 * (h[i] - l[i]) * sway_[i];
            if (moved > widest) widest = moved, by_sway = i;
        }
        for (int k = 0; k < J_; ++k) {
            const Joint &one = tree_.joints[k + 1];
            reach_[k] = std::fabs(one.multiplier) * (0.5 * (h[one.leader] - l[one.leader]) + kSlack);
        }
        place(centre.data());
        if (collides(reach_.data(), widest > kWide, found)) continue;
        if (widest < kSmallest || (found.rod < 0 && passes(centre.data()))) return Box::passable;
        if (--most <= 0) return Box::unknown;
        int joint = found.joint;
        if (joint < 0 || h[joint] - l[joint] < 1e-5) joint = by_sway;
        const double middle = 0.5 * (l[joint] + h[joint]);
        box[2 * n_] = found.rod, box[2 * n_ + 1] = found.box, box[2 * n_ + 2] = found.effort;
        for (const bool upper : {false, true}) {
            stack.insert(stack.end(), box.begin(), box.end());
            double *pushed = stack.data() + stack.size() - size;
            (upper ? pushed[joint] : pushed[n_ + joint]) = middle;
        }
    }
    return Box::closed;
}

}  // namespace optiplan
