#include "search/edges.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

EdgeChecker::EdgeChecker(const World &world, std::vector<double> arms, std::vector<double> torque, EdgeRules rules)
    : world_(world), arms_(std::move(arms)), torque_(std::move(torque)), rules_(rules), at_(world.placement()) {
    const std::size_t n = joints();
    q_.resize(n), d_.resize(n), held_.resize(n), travel_.resize(world.pairs().size());
    half_d_.resize(n), reaches_.resize(world.bodies().size() * world.tree().joints.size());
}

bool EdgeChecker::too_heavy() {
    if (torque_.empty()) return false;
    world_.tree().gravity_torques(at_.joints.data(), held_.data());
    for (std::size_t j = 0; j < torque_.size(); ++j)
        if (std::fabs(held_[j]) > torque_[j]) return true;
    return false;
}

bool EdgeChecker::blocked(const double *q) {
    world_.place_outside(q, at_);
    return world_.collides(at_) || too_heavy();
}

bool EdgeChecker::heavy_along(const double *a, const double *d) {
    if (torque_.empty()) return false;
    double farthest = 0.0;
    for (int j = 0; j < joints(); ++j) farthest = std::max(farthest, std::fabs(d[j]));
    const int parts = std::max(1, static_cast<int>(std::ceil(farthest / rules_.heavy_step)));
    for (int k = 1; k < parts; ++k) {
        const double share = static_cast<double>(k) / parts;
        for (int j = 0; j < joints(); ++j) q_[j] = a[j] + d[j] * share;
        world_.tree().poses(q_.data(), at_.joints.data());
        if (too_heavy()) return true;
    }
    return false;
}

bool EdgeChecker::free(const double *a, const double *b) {
    for (int j = 0; j < joints(); ++j) d_[j] = b[j] - a[j];
    return !blocked(b) && !heavy_along(a, d_.data()) && apart(a, d_.data());
}

bool EdgeChecker::polyline_free(const double *waypoints, int count) {
    for (int k = 0; k + 1 < count; ++k)
        if (!free(waypoints + k * joints(), waypoints + (k + 1) * joints())) return false;
    return true;
}

// Middles of equal parts of [0, 1], far apart first: collisions are found sooner in that order.
static std::vector<double> middles(int parts) {
    std::vector<double> order;
    std::vector<std::pair<int, int>> spans{{0, parts - 1}};
    for (std::size_t k = 0; k < spans.size(); ++k) {
        const auto [low, high] = spans[k];
        if (low > high) continue;
        const int middle = (low + high) / 2;
        order.push_back((middle + 0.5) / parts);
        spans.push_back({low, middle - 1});
        spans.push_back({middle + 1, high});
    }
    return order;
}

void EdgeChecker::reach(int a, int b) {
    for (int body : {a, b}) {
        if (!reached_[body]) world_.reach(at_, body, reaches_.data() + body * world_.tree().joints.size());
        reached_[body] = 1;
    }
}

bool EdgeChecker::apart(const double *a, const double *d) {
    const int n = joints();
    double farthest = 0.0;
    std::vector<int> pairs, left;  // to be proved, of the parts one after another
    for (int p = 0; p < static_cast<int>(travel_.size()); ++p) {
        double travel = 0.0;
        for (int j = 0; j < n; ++j) travel += arms_[static_cast<std::size_t>(p) * n + j] * std::fabs(d[j]);
        travel_[p] = travel;
        farthest = std::max(farthest, travel);
        if (travel > 0.0) pairs.push_back(p);
    }
    if (pairs.empty()) return true;
    std::vector<double> together(world_.groups().size(), 0.0);  // the farthest travel of each group's pairs
    for (std::size_t g = 0; g < together.size(); ++g)
        for (int p : world_.groups()[g].pairs) together[g] = std::max(together[g], travel_[p]);
    std::vector<char> known(together.size());
    const double wanted = std::ceil(0.5 * farthest / rules_.first);
    if (wanted > rules_.most) return false;
    const int count = std::max(1, static_cast<int>(wanted));
    std::vector<Part> parts, next;
    for (double middle : middles(count)) parts.push_back({middle, 0, pairs.size()});
    double half = 0.5 / count;
    for (int asked = 0; !parts.empty(); half *= 0.5) {
        asked += static_cast<int>(parts.size());
        if (asked > rules_.most || (farthest * half < rules_.least && rules_.least < farthest)) return false;
        left.clear(), next.clear();
        for (int j = 0; j < n; ++j) half_d_[j] = half * std::fabs(d[j]);
        const auto group_gap = [&](int g) {
            reach(world_.groups()[g].hull, world_.groups()[g].other);
            return std::min(together[g] * half, world_.group_travel(reaches_, half_d_.data(), g)) + rules_.margin;
        };
        for (const Part &part : parts) {
            for (int j = 0; j < n; ++j) q_[j] = a[j] + part.middle * d[j];
            world_.place_outside(q_.data(), at_);
            const std::size_t first = left.size();
            std::fill(known.begin(), known.end(), 0);
            reached_.assign(world_.bodies().size(), 0);
            for (std::size_t k = part.begin; k < part.end; ++k) {
                const int p = pairs[k];
                if (world_.settled(at_, p, known, group_gap)) continue;
                const double most = travel_[p] * half + rules_.margin;
                if (world_.balls_apart(at_, p, most) || world_.lower_bound(at_, p) > most) continue;
                reach(world_.pairs()[p].a, world_.pairs()[p].b);
                const double margin = std::min(most, world_.travel(reaches_, half_d_.data(), p) + rules_.margin);
                if (!world_.within(at_, p, margin)) continue;
                if (world_.within(at_, p, 0.0)) {
                    at_.touching = p;
                    return false;
                }
                left.push_back(p);
            }
            if (left.size() == first) continue;
            for (double side : {-0.5, 0.5}) next.push_back({part.middle + side * half, first, left.size()});
        }
        parts.swap(next);
        pairs.swap(left);
    }
    return true;
}

}  // namespace optiplan
