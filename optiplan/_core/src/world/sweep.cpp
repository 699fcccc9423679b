#include "world/sweep.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace optiplan {

static constexpr double SPARE = 1.05;  // parts that an interval is cut into, times this
static constexpr int BLOCK = 6;        // intervals in a row of which far pairs are found at once

void Curve::around(int piece, double middle, double half, double *q, double *reach) const {
    const double local = middle - breakpoints[piece];
    const double *piece_of = coefficients.data() + static_cast<std::size_t>(piece) * (degree + 1) * joints;
    std::vector<double> c(degree + 1);
    for (int j = 0; j < joints; ++j) {
        for (int k = 0; k <= degree; ++k) c[k] = piece_of[k * joints + j];
        for (int low = 0; low < degree; ++low)  // Taylor shift by repeated Horner steps
            for (int k = degree - 1; k >= low; --k) c[k] += local * c[k + 1];
        double sum = 0.0, power = 1.0;
        for (int k = 1; k <= degree; ++k) power *= half, sum += power * std::fabs(c[k]);
        q[j] = c[0];
        reach[j] = sum;
    }
}

Sweep::Sweep(const World &world, Curve curve, SweepRules rules)
    : world_(world), curve_(std::move(curve)), rules_(rules), at_(world.placement()), trail_(world.trail()) {
    q_.resize(curve_.joints), reach_.resize(curve_.joints);
    reaches_.resize(world.bodies().size() * world.tree().joints.size());
    for (int piece = 0; piece + 1 < static_cast<int>(curve_.breakpoints.size()); ++piece) {
        const double low = curve_.breakpoints[piece], length = curve_.breakpoints[piece + 1] - low;
        curve_.around(piece, low + 0.5 * length, 0.5 * length, q_.data(), reach_.data());
        const double way = std::accumulate(reach_.begin(), reach_.end(), 0.0);
        const int parts = std::max(1, static_cast<int>(std::ceil(2.0 * way / rules_.first)));
        const double half = 0.5 * length / parts;
        for (int k = 0; k < parts; ++k) intervals_.push_back({piece, low + (2 * k + 1) * half, half});
    }
    suspects_.resize(intervals_.size());
    narrowed_.assign(intervals_.size(), 0);
}

void Sweep::look(int begin, int end, std::vector<double> &touching) {
    for (int k = begin; k < end; ++k) {
        const bool all = touched_ && !narrowed_[k];  // nobody proves what touches somewhere
        const std::vector<int> &pairs = all ? suspects_[k] : suspects(k);
        bool touches = false;
        if (all || !pairs.empty()) {
            const Interval &interval = intervals_[k];
            curve_.around(interval.piece, interval.middle, interval.half, q_.data(), reach_.data());
            world_.place_outside(q_.data(), at_);
            touches = all ? world_.collides(at_, &trail_) : world_.collides(at_, pairs, trail_);
        }
        touched_ |= touches;
        if (touches && !before_) touching.push_back(intervals_[k].middle);
        before_ = touches;
    }
}

void Sweep::prove(int begin, int end, std::vector<Touched> &found) {
    for (int k = begin; k < end; ++k) {
        Touched touched{};
        const std::vector<int> &pairs = suspects(k);
        const bool failed = !pairs.empty() && !free(intervals_[k], pairs, touched);
        if (failed && !failed_before_) found.push_back(touched);
        failed_before_ = failed;
    }
}

const std::vector<int> &Sweep::suspects(int interval) {
    if (!narrowed_[interval]) {
        int end = interval;
        while (end < intervals() && end < interval + BLOCK && intervals_[end].piece == intervals_[interval].piece)
            narrowed_[end++] = 1;
        const std::vector<int> near = near_along(joined(interval, end));
        for (int k = interval; k < end && !near.empty(); ++k) suspects_[k] = near_along(intervals_[k], near);
    }
    return suspects_[interval];
}

Sweep::Interval Sweep::joined(int begin, int end) const {
    const Interval &first = intervals_[begin], &last = intervals_[end - 1];
    const double low = first.middle - first.half, high = last.middle + last.half;
    return {first.piece, 0.5 * (low + high), 0.5 * (high - low)};
}

void Sweep::stand_at(const Interval &interval) {
    curve_.around(interval.piece, interval.middle, interval.half, q_.data(), reach_.data());
    world_.place_outside(q_.data(), at_);
    reached_.assign(world_.bodies().size(), 0);
}

std::vector<int> Sweep::near_along(const Interval &part) {
    stand_at(part);
    std::vector<int> near;
    for (int pair : world_.alone()) {
        world_.open(at_, pair);
        if (!apart(pair)) near.push_back(pair);
    }
    for (int group = 0; group < static_cast<int>(world_.groups().size()); ++group) {
        const double gap = group_travel(group) + rules_.margin;
        if (world_.group_apart(at_, group, gap, &trail_.groups[group])) continue;
        world_.visit_near(at_, world_.groups()[group], gap, [&](int pair) {
            if (!world_.boxes_apart(at_, pair, gap)) near.push_back(pair);
        });
    }
    std::sort(near.begin(), near.end());
    return near;
}

std::vector<int> Sweep::near_along(const Interval &part, const std::vector<int> &pairs) {
    stand_at(part);
    std::vector<int> near;
    std::vector<char> known(world_.groups().size());
    const auto gap = [&](int group) { return group_travel(group) + rules_.margin; };
    for (int pair : pairs) {
        if (world_.settled(at_, pair, known, gap, trail_.groups.data())) continue;
        const int group = world_.group_of(pair);
        if (!(group < 0 ? apart(pair) : world_.boxes_apart(at_, pair, gap(group)))) near.push_back(pair);
    }
    return near;
}

bool Sweep::apart(int pair) {
    const double gap = travel(pair) + rules_.margin;
    return world_.boxes_apart(at_, pair, gap) || world_.outlines_apart(at_, pair, gap, &trail_.pairs[pair]);
}

void Sweep::reach(int a, int b) {
    for (int body : {a, b}) {
        if (!reached_[body]) world_.reach(at_, body, reaches_.data() + body * world_.tree().joints.size());
        reached_[body] = 1;
    }
}

double Sweep::travel(int pair) {
    reach(world_.pairs()[pair].a, world_.pairs()[pair].b);
    return world_.travel(reaches_, reach_.data(), pair);
}

double Sweep::group_travel(int group) {
    reach(world_.groups()[group].hull, world_.groups()[group].other);
    return world_.group_travel(reaches_, reach_.data(), group);
}

bool Sweep::free(const Interval &interval, const std::vector<int> &pairs, Touched &touched) {
    stand_at(interval);
    std::vector<int> left;
    double ratio = 0.0, least = 0.0;
    int worst = -1;
    std::vector<char> known(world_.groups().size());
    const auto group_gap = [&](int group) { return group_travel(group) + rules_.margin; };
    for (int pair : pairs) {
        if (world_.settled(at_, pair, known, group_gap, trail_.groups.data())) continue;
        const double travel = this->travel(pair);
        if (world_.boxes_apart(at_, pair, travel)) continue;
        const double gap = world_.gap(at_, pair, travel + rules_.margin, &trail_.pairs[pair]) - rules_.margin;
        if (gap > travel) continue;
        if (gap <= 0.0) {
            if (worst < 0 || gap < least) worst = pair, least = gap;
            continue;
        }
        left.push_back(pair);
        ratio = std::max(ratio, travel / gap);
    }
    if (worst < 0 && left.empty()) return true;
    if (worst < 0 && interval.half < rules_.resolution) worst = left.front();
    if (worst >= 0) {
        touched = {interval.middle, worst};
        return false;
    }
    const int parts = std::clamp(static_cast<int>(std::ceil(std::min(ratio, 1e6) * SPARE)), 2, rules_.most_cuts);
    const double half = interval.half / parts;
    for (int k = 0; k < parts; ++k)
        if (!free({interval.piece, interval.middle - interval.half + (2 * k + 1) * half, half}, left, touched))
            return false;
    return true;
}

}  // namespace optiplan
