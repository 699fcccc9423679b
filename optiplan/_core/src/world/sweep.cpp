#include "world/sweep.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace optiplan {

static constexpr double SPARE = 1.05;  // parts that an interval is cut into, times this

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
    : world_(world), curve_(std::move(curve)), rules_(rules), at_(world.placement()) {
    q_.resize(curve_.joints), reach_.resize(curve_.joints);
    reaches_.resize(world.bodies().size() * world.tree().joints.size());
    everything_.resize(world.pairs().size());
    std::iota(everything_.begin(), everything_.end(), 0);
    for (int piece = 0; piece + 1 < static_cast<int>(curve_.breakpoints.size()); ++piece) {
        const double low = curve_.breakpoints[piece], length = curve_.breakpoints[piece + 1] - low;
        curve_.around(piece, low + 0.5 * length, 0.5 * length, q_.data(), reach_.data());
        const double way = std::accumulate(reach_.begin(), reach_.end(), 0.0);
        const int parts = std::max(1, static_cast<int>(std::ceil(2.0 * way / rules_.first)));
        const double half = 0.5 * length / parts;
        for (int k = 0; k < parts; ++k) intervals_.push_back({piece, low + (2 * k + 1) * half, half});
    }
}

void Sweep::look(int begin, int end, std::vector<double> &touching) {
    for (int k = begin; k < end; ++k) {
        const Interval &interval = intervals_[k];
        curve_.around(interval.piece, interval.middle, interval.half, q_.data(), reach_.data());
        world_.place_outside(q_.data(), at_);
        const bool touches = world_.collides(at_);
        if (touches && !before_) touching.push_back(interval.middle);
        before_ = touches;
    }
}

void Sweep::prove(int begin, int end, std::vector<Touched> &found) {
    for (int k = begin; k < end; ++k) {
        Touched touched{};
        const bool failed = !free(intervals_[k], everything_, touched);
        if (failed && !failed_before_) found.push_back(touched);
        failed_before_ = failed;
    }
}

void Sweep::reach(int a, int b) {
    for (int body : {a, b}) {
        if (!reached_[body]) world_.reach(at_, body, reaches_.data() + body * world_.tree().joints.size());
        reached_[body] = 1;
    }
}

bool Sweep::free(const Interval &interval, const std::vector<int> &pairs, Touched &touched) {
    curve_.around(interval.piece, interval.middle, interval.half, q_.data(), reach_.data());
    world_.place_outside(q_.data(), at_);
    reached_.assign(world_.bodies().size(), 0);
    std::vector<int> left;
    double ratio = 0.0, least = 0.0;
    int worst = -1;
    std::vector<char> known(world_.groups().size());
    const auto group_gap = [&](int group) {
        reach(world_.groups()[group].hull, world_.groups()[group].other);
        return world_.group_travel(reaches_, reach_.data(), group) + rules_.margin;
    };
    for (int pair : pairs) {
        if (world_.settled(at_, pair, known, group_gap)) continue;
        reach(world_.pairs()[pair].a, world_.pairs()[pair].b);
        const double travel = world_.travel(reaches_, reach_.data(), pair);
        if (world_.balls_apart(at_, pair, travel) || world_.lower_bound(at_, pair) > travel) continue;
        const double gap = world_.gap(at_, pair, travel + rules_.margin) - rules_.margin;
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
