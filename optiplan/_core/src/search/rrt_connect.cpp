#include "search/rrt_connect.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace optiplan {

static constexpr int TURN = 8;  // iterations of which one takes the trees in turn, whatever their sizes
static constexpr double DOUBLED = 2500.0;  // iterations in which the duration of motions doubles
static constexpr int ANYWHERE = 3;  // iterations of which one draws from the whole box: if no short motion passes
static constexpr double AS_AT_END = 0.5;  // share of the draws that have what is carried as it is at an end
static constexpr int MOST_STATES = 5'000'000;  // of both trees, some 80 bytes each
static constexpr int DRAWS = 64;  // of one iteration: where the set is much smaller than its box, the last is taken

RrtConnect::RrtConnect(EdgeChecker &check, SearchSpace space, const double *start, const std::vector<double> &goals,
                       double reach, std::uint64_t seed)
    : check_(check), space_(std::move(space)), reach_(reach), random_(seed) {
    const int m = static_cast<int>(space_.joints.size());
    trees_.assign(2, SearchTree(m));
    target_.resize(m), low_.resize(m), high_.resize(m), x_.resize(m);
    from_.resize(check.joints()), to_.resize(check.joints());
    for (int k = 0; k < m; ++k) x_[k] = start[k] / space_.units[k];
    trees_[0].add(x_.data(), -1);
    for (std::size_t goal = 0; goal * m < goals.size(); ++goal) {
        for (int k = 0; k < m; ++k) x_[k] = goals[goal * m + k] / space_.units[k];
        trees_[1].add(x_.data(), -1);
    }
    goals_ = size(1);
}

void RrtConnect::lift(const double *x, double *q) const {
    std::copy(space_.still.begin(), space_.still.end(), q);
    for (std::size_t k = 0; k < space_.joints.size(); ++k) q[space_.joints[k]] = x[k] * space_.units[k];
}

RrtConnect::Step RrtConnect::extend(int tree, int from) {
    const SearchTree &grown = trees_[tree];
    const int m = static_cast<int>(target_.size());
    double squared = 0.0;
    for (int k = 0; k < m; ++k) squared += (target_[k] - grown.at(from)[k]) * (target_[k] - grown.at(from)[k]);
    const double length = std::sqrt(squared);
    const bool reaches = length <= reach_;
    const double share = reaches ? 1.0 : reach_ / length;
    std::vector<double> node(m);
    for (int k = 0; k < m; ++k) {
        node[k] = grown.at(from)[k];
        x_[k] = reaches ? target_[k] : node[k] + share * (target_[k] - node[k]);
    }
    lift(node.data(), from_.data());
    lift(x_.data(), to_.data());
    if (!check_.free(from_.data(), to_.data())) return Step::blocked;
    last_ = trees_[tree].add(x_.data(), from);
    return reaches ? Step::reached : Step::advanced;
}

// The smaller tree where one has twice the states of the other: it is in a narrow place, and has to get out of it.
int RrtConnect::next_tree() {
    const int turn = iterations_++;
    if (turn % TURN != 0 && 2 * size(0) < size(1)) return 0;
    if (turn % TURN != 0 && 2 * size(1) < size(0)) return 1;
    return turn / TURN % 2 == 0 ? turn % 2 : 1 - turn % 2;
}

// Least time in which a joint at rest gets so far, whatever its speed there.
static double time_from_rest(double distance, double velocity, double acceleration) {
    const double d = std::fabs(distance);
    if (d > 0.5 * velocity * velocity / acceleration) return d / velocity + 0.5 * velocity / acceleration;
    return std::sqrt(2.0 * d / acceleration);
}

bool RrtConnect::passed_within(const double *x, double duration) const {
    const auto time = [&](const double *end) {
        double most = 0.0;
        for (std::size_t k = 0; k < target_.size(); ++k)
            most = std::max(most, time_from_rest((x[k] - end[k]) * space_.units[k], space_.velocity[k],
                                                 space_.acceleration[k]));
        return most;
    };
    const double before = time(trees_[0].at(0));
    for (int goal = 0; goal < goals_ && before < duration; ++goal)
        if (before + time(trees_[1].at(goal)) <= duration) return true;
    return false;
}

void RrtConnect::draw() {
    const int m = static_cast<int>(target_.size());
    const bool anywhere = std::isinf(space_.least) || iterations_ % ANYWHERE == 0;
    const double duration = anywhere ? HUGE_VAL : space_.least * std::exp2(iterations_ / DOUBLED);
    const double *start = trees_[0].at(0);
    for (int j = 0; j < m; ++j) {  // the box of the set at full speed
        const double way = duration * space_.velocity[j] / space_.units[j];
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (int goal = 0; goal < goals_; ++goal) {
            const double end = trees_[1].at(goal)[j], slack = std::max(0.0, 0.5 * (way - std::fabs(end - start[j])));
            low = std::min({low, start[j] - slack, end - slack}),
            high = std::max({high, start[j] + slack, end + slack});
        }
        low_[j] = std::max(low, space_.lower[j] / space_.units[j]);
        high_[j] = std::min(high, space_.upper[j] / space_.units[j]);
    }
    for (int k = 0; k < DRAWS; ++k) {
        for (int j = 0; j < m; ++j) target_[j] = low_[j] + random_.uniform() * (high_[j] - low_[j]);
        if (anywhere || passed_within(target_.data(), duration)) break;
    }
    if (space_.carriers > 0 && random_.uniform() < AS_AT_END) {
        const int goal = static_cast<int>(random_.uniform() * goals_);
        const double *end = random_.uniform() < 0.5 ? start : trees_[1].at(goal);
        std::copy(end + space_.carriers, end + m, target_.begin() + space_.carriers);
    }
}

bool RrtConnect::grow(int iterations, double seconds) {
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::duration<double>(seconds);
    const int m = static_cast<int>(target_.size());
    for (int k = 0; k < iterations && !met() && !full() && Clock::now() < end; ++k) {
        if (connecting_ < 0) {
            const int tree = next_tree();
            draw();
            if (extend(tree, trees_[tree].nearest(target_.data())) == Step::blocked) continue;
            connecting_ = tree, grown_ = last_;
            for (int j = 0; j < m; ++j) target_[j] = trees_[tree].at(grown_)[j];
            last_ = trees_[1 - tree].nearest(target_.data());
        }
        const int tree = connecting_, other = 1 - tree;
        Step step;
        do step = extend(other, last_);
        while (step == Step::advanced && !full() && Clock::now() < end);
        if (step == Step::advanced) break;
        connecting_ = -1;
        if (step == Step::reached) met_[tree] = grown_, met_[other] = last_;
    }
    return met();
}

void RrtConnect::append(std::vector<double> &out, int tree, int node) const {
    const std::size_t begin = out.size();
    out.resize(begin + space_.still.size());
    std::vector<double> x(space_.joints.size());
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = trees_[tree].at(node)[k];
    lift(x.data(), out.data() + begin);
}

bool RrtConnect::full() const { return size(0) + size(1) >= MOST_STATES; }

std::vector<double> RrtConnect::path() const {
    std::vector<int> first;
    for (int node = met_[0]; node >= 0; node = trees_[0].parent(node)) first.push_back(node);
    std::vector<double> out;
    for (auto node = first.rbegin(); node != first.rend(); ++node) append(out, 0, *node);
    // Both trees end in the same configuration: it is told once.
    for (int node = trees_[1].parent(met_[1]); node >= 0; node = trees_[1].parent(node)) append(out, 1, node);
    return out;
}

std::vector<double> RrtConnect::sample(int tree, int most) const {
    std::vector<double> out;
    const int stride = size(tree) / most + 1;
    for (int node = 0; node < size(tree); node += stride) append(out, tree, node);
    return out;
}

}  // namespace optiplan
