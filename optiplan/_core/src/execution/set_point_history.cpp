#include "execution/set_point_history.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double ALIKE = 0.02;  // of weighted distances between two passages of a way
static constexpr double ROUNDED = 1e-6;  // share of the spacing
static constexpr int NARROWINGS = 20;  // of the line on which the nearest place is: to 3e-4 of its length

SetPointHistory::SetPointHistory(int joints, double kept, double spacing)
    : joints_(joints), count_(2 * static_cast<int>(std::ceil(kept / spacing)) + 3), kept_(kept), spacing_(spacing),
      q_(static_cast<std::size_t>(count_) * joints), rows_(count_) {}

void SetPointHistory::note(double time, const double *q, double place, int epoch) {
    if (filled_ && rows_[last_].epoch == epoch) progress_ += std::fabs(place - rows_[last_].place);
    const bool near = filled_ > 1 && time - rows_[slot(1)].time <= spacing_ * (1.0 + ROUNDED);
    const bool replaces = near && rows_[last_].epoch == epoch;
    if (filled_ && !replaces) last_ = (last_ + 1) % count_;
    if (!replaces) filled_ = std::min(filled_ + 1, count_);
    rows_[last_] = {time, place, progress_, epoch};
    while (filled_ > 2 && time - rows_[slot(filled_ - 1)].time > kept_ + spacing_) --filled_;
    std::copy(q, q + joints_, q_.begin() + static_cast<std::ptrdiff_t>(last_) * joints_);
}

double SetPointHistory::progress_at(double time) const {
    int age = 0;
    while (age + 1 < filled_ && rows_[slot(age)].time > time) ++age;
    const Row &before = rows_[slot(age)];
    if (age == 0 || before.time > time) return before.progress;
    const Row &after = rows_[slot(age - 1)];
    const double lasts = after.time - before.time;
    return before.progress + (after.progress - before.progress) * (lasts > 0.0 ? (time - before.time) / lasts : 1.0);
}

double SetPointHistory::away(const double *q, const double *weights, int age, double share) const {
    const double *from = at(slot(age)), *to = at(slot(std::max(age - 1, 0)));
    double most = 0.0;
    for (int j = 0; j < joints_; ++j)
        most = std::max(most, weights[j] * std::fabs(q[j] - from[j] - share * (to[j] - from[j])));
    return most;
}

// On each line the place is that of the least sum of squares; on the best one and beside it it is narrowed down.
// A robot a little ahead of its last set-point is nearer to an older one where it goes back the way that it came. So
// its progress is that of the last passage that is farther off by no more than its line is long.
NearestPlace SetPointHistory::nearest(const double *q, const double *weights, double *off) const {
    std::vector<double> shares(filled_, 0.0), sizes(filled_), lengths(filled_, 0.0);
    sizes[0] = away(q, weights, 0, 0.0);
    for (int age = 1; age < filled_; ++age) {
        const double *from = at(slot(age)), *to = at(slot(age - 1));
        double along = 0.0, length = 0.0;
        for (int j = 0; j < joints_; ++j) {
            const double way = weights[j] * (to[j] - from[j]);
            along += way * weights[j] * (q[j] - from[j]), length += way * way;
            lengths[age] = std::max(lengths[age], std::fabs(way));
        }
        shares[age] = length > 0.0 ? std::clamp(along / length, 0.0, 1.0) : 1.0;
        sizes[age] = away(q, weights, age, shares[age]);
    }
    const double alike = *std::min_element(sizes.begin(), sizes.end()) + ALIKE;
    lengths[0] = lengths[std::min(1, filled_ - 1)];
    const auto last_passage = [&](double lines) {
        int age = 0;
        while (sizes[age] > alike + lines * lengths[age]) ++age;
        while (age + 1 < filled_ && sizes[age + 1] < sizes[age]) ++age;
        return age;
    };
    int best = last_passage(0.0);
    const int recent = last_passage(1.0);
    double share = shares[best], least = sizes[best];
    const int about = best;
    for (int age = std::max(about - 1, 1); age <= std::min(about + 1, filled_ - 1); ++age) {
        double low = 0.0, high = 1.0;  // the distance is convex along a line
        for (int k = 0; k < NARROWINGS; ++k) {
            const double third = (high - low) / 3.0;
            if (away(q, weights, age, low + third) < away(q, weights, age, high - third))
                high -= third;
            else
                low += third;
        }
        const double found = 0.5 * (low + high), away_there = away(q, weights, age, found);
        if (away_there < least) best = age, share = found, least = away_there;
    }
    const Row &from = rows_[slot(best)], &to = rows_[slot(std::max(best - 1, 0))];
    const double *a = at(slot(best)), *b = at(slot(std::max(best - 1, 0)));
    for (int j = 0; j < joints_; ++j) off[j] = std::fabs(q[j] - a[j] - share * (b[j] - a[j]));
    const bool over = from.epoch != to.epoch;  // where another motion took over
    NearestPlace found{over ? to.place : from.place + share * (to.place - from.place),
                       over ? to.progress : from.progress + share * (to.progress - from.progress),
                       over ? to.epoch : from.epoch};
    if (recent != about) {
        const Row &before = rows_[slot(recent)], &after = rows_[slot(std::max(recent - 1, 0))];
        found.progress = before.progress + shares[recent] * (after.progress - before.progress);
    }
    return found;
}

}  // namespace optiplan
