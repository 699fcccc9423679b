#include "search/edges.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double MOST_HEAVY = 1e5;  // checks of gravity; a motion that takes more counts as too heavy

EdgeChecker::EdgeChecker(const World &world, std::vector<double> arms, std::vector<double> torque, EdgeRules rules)
    : world_(world), arms_(arms.size()), torque_(std::move(torque)), rules_(rules), at_(world.placement()),
      trail_(world.trail()) {
    const std::size_t n = joints(), count = world.pairs().size();
    for (std::size_t p = 0; p < count; ++p)
        for (std::size_t j = 0; j < n; ++j) arms_[j * count + p] = arms[p * n + j];
    together_.resize(world.groups().size());
    q_.resize(n), d_.resize(n), held_.resize(n), travel_.resize(world.pairs().size());
    half_d_.resize(n), reaches_.resize(world.bodies().size() * world.tree().joints.size());
    if (rules.spacing == 0.0) return;
    looks_ = std::make_unique<ManyChecks>(world);
    four_.resize(LANES * n);
    for (std::size_t j = 0; j < n; ++j)
        most_.push_back(count ? *std::max_element(&arms_[j * count], &arms_[j * count] + count) : 0.0);
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
    return world_.collides(at_, &trail_) || too_heavy();
}

bool EdgeChecker::heavy_along(const double *a, const double *d) {
    if (torque_.empty()) return false;
    double farthest = 0.0;
    for (int j = 0; j < joints(); ++j) farthest = std::max(farthest, std::fabs(d[j]));
    const double wanted = std::ceil(farthest / rules_.heavy_step);
    if (!(wanted <= MOST_HEAVY)) return true;
    const int parts = std::max(1, static_cast<int>(wanted));
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
    if (looks_) return apart_here_and_there(a, d_.data());
    return !blocked(b) && !heavy_along(a, d_.data()) && apart(a, d_.data());
}

// Along the segment four by four, far apart, first those with its end.
bool EdgeChecker::apart_here_and_there(const double *a, const double *d) {
    const int n = joints();
    double way = 0.0;
    for (int j = 0; j < n; ++j) way += most_[j] * std::fabs(d[j]);
    const double wanted = std::ceil(way / (LANES * rules_.spacing));
    if (!(wanted * LANES <= rules_.most)) return false;
    const int fours = std::max(1, static_cast<int>(wanted));
    for (int k = fours; k > 0; --k) {
        for (int lane = 0; lane < LANES; ++lane)
            for (int j = 0; j < n; ++j)
                four_[lane * n + j] = a[j] + d[j] * ((k + lane * fours) / (1.0 * LANES * fours));
        if (looks_->any_touches(four_.data())) return false;
        for (int lane = 0; lane < LANES && !torque_.empty(); ++lane) {
            looks_->joints(lane, at_.joints.data());
            if (too_heavy()) return false;
        }
    }
    return true;
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

// The travel of each pair, of each group the farthest of its pairs; returns the farthest of all.
double EdgeChecker::measure_travel(const double *d) {
    const std::size_t count = travel_.size();
    double way = 0.0;
    std::fill(travel_.begin(), travel_.end(), 0.0);
    for (int j = 0; j < joints(); ++j) {
        const double *arms = arms_.data() + static_cast<std::size_t>(j) * count, length = std::fabs(d[j]);
        for (std::size_t p = 0; p < count; ++p) travel_[p] += arms[p] * length;
        way += length;
    }
    for (std::size_t p = 0; p < count; ++p) travel_[p] += world_.rise(static_cast<int>(p)) * way;
    for (std::size_t g = 0; g < together_.size(); ++g) {
        together_[g] = 0.0;
        for (const Member &member : world_.groups()[g].members)
            together_[g] = std::max(together_[g], travel_[member.pair]);
    }
    double farthest = 0.0;
    for (int p : world_.alone()) farthest = std::max(farthest, travel_[p]);
    for (double travel : together_) farthest = std::max(farthest, travel);
    return farthest;
}

bool EdgeChecker::apart(const double *a, const double *d) {
    const int n = joints();
    const double farthest = measure_travel(d);
    if (farthest == 0.0) return true;
    const double wanted = std::ceil(0.5 * farthest / rules_.first);
    if (!(wanted <= rules_.most)) return false;
    const int count = std::max(1, static_cast<int>(wanted));
    std::vector<int> pairs, left;  // to be proved, of the parts one after another
    std::vector<char> known(together_.size());
    std::vector<Part> parts, next;
    for (double middle : middles(count)) parts.push_back({middle, 0, 0});
    double half = 0.5 / count;
    const auto group_gap = [&](int g) {
        reach(world_.groups()[g].hull, world_.groups()[g].other);
        return std::min(together_[g] * half, world_.group_travel(reaches_, half_d_.data(), g)) + rules_.margin;
    };
    bool touches = false;
    const auto ask = [&](int p) {
        if (touches || !(travel_[p] > 0.0)) return;
        const double most = travel_[p] * half + rules_.margin;
        if (world_.boxes_apart(at_, p, most)) return;
        reach(world_.pairs()[p].a, world_.pairs()[p].b);
        const double margin = std::min(most, world_.travel(reaches_, half_d_.data(), p) + rules_.margin);
        if (!world_.within(at_, p, margin, &trail_.pairs[p])) return;
        touches = world_.within(at_, p, 0.0, &trail_.pairs[p]);
        if (touches) at_.touching = p;
        left.push_back(p);
    };
    const auto ask_all = [&] {
        for (int p : world_.alone()) {
            world_.open(at_, p);
            ask(p);
        }
        for (int g = 0; g < static_cast<int>(together_.size()) && !touches; ++g) {
            if (!(together_[g] > 0.0) || world_.group_apart(at_, g, group_gap(g), &trail_.groups[g])) continue;
            world_.visit_near(at_, world_.groups()[g], together_[g] * half + rules_.margin, ask);
        }
    };
    for (int asked = 0; !parts.empty(); half *= 0.5) {
        asked += static_cast<int>(parts.size());
        if (asked > rules_.most || (farthest * half < rules_.least && rules_.least < farthest)) return false;
        left.clear(), next.clear();
        for (int j = 0; j < n; ++j) half_d_[j] = half * std::fabs(d[j]);
        for (const Part &part : parts) {
            for (int j = 0; j < n; ++j) q_[j] = a[j] + part.middle * d[j];
            world_.place_outside(q_.data(), at_);
            const std::size_t first = left.size();
            std::fill(known.begin(), known.end(), 0);
            reached_.assign(world_.bodies().size(), 0);
            if (part.end == 0) ask_all();
            for (std::size_t k = part.begin; k < part.end; ++k)
                if (!world_.settled(at_, pairs[k], known, group_gap, trail_.groups.data())) ask(pairs[k]);
            if (touches) return false;
            if (left.size() == first) continue;
            for (double side : {-0.5, 0.5}) next.push_back({part.middle + side * half, first, left.size()});
        }
        parts.swap(next);
        pairs.swap(left);
    }
    return true;
}

}  // namespace optiplan
