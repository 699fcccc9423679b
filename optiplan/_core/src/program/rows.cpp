#include "program/rows.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace optiplan {

namespace {

// Share of a pair's clearance at an end that is aimed at near this end, where the pair is nearer than the margin.
constexpr double KEPT = 0.6;

// Of the pieces of a hand near one body those get rows that are at most this much farther than the nearest, m: what a
// step turns the hand by seldom makes another one the nearest, and rows of pieces that all penetrate push every way at
// once.
constexpr double WINDOW = 0.015;

// Digits of distances, m: steps are far coarser.
constexpr double GAP = 1e-8;

// Torques above this share of their limit get a row; at rest, where a step changes them less, above the second one.
constexpr double TORQUE_SHARE = 0.6, REST_SHARE = 0.8;

// Share of the limits that torques at rest may take: slowing down does not help where they exceed them.
constexpr double HELD = 0.98;

// Runs of consecutive samples at which a pair penetrates, as places in `found`: rising samples, pair by pair.
std::vector<std::vector<std::size_t>> penetrations(const std::vector<Contact> &found) {
    std::map<int, std::vector<std::vector<std::size_t>>> runs;
    for (std::size_t k = 0; k < found.size(); ++k) {
        if (found[k].witness.distance >= 0.0) continue;
        auto &of_pair = runs[found[k].pair];
        if (of_pair.empty() || found[of_pair.back().back()].row < found[k].row - 1) of_pair.emplace_back();
        of_pair.back().push_back(k);
    }
    std::vector<std::vector<std::size_t>> all;
    for (auto &[pair, of_pair] : runs) all.insert(all.end(), of_pair.begin(), of_pair.end());
    return all;
}

void push_one_way(std::vector<Contact> &found) {
    for (const auto &run : penetrations(found)) {
        Vec3 mean;
        for (std::size_t k : run) mean += found[k].witness.normal;
        const double length = norm(mean);
        if (length > 0.0)
            for (std::size_t k : run) found[k].witness.normal = (1.0 / length) * mean;
    }
}

}  // namespace

double Margins::at(double u, int pair) const {
    return std::min(middle, KEPT * ((1.0 - u) * start[pair] + u * end[pair]));
}

NearRows RowSearch::of(const Vec &u, const Vec &Q) {
    const std::size_t n = static_cast<std::size_t>(world_.tree().planned);
    at_ = fresh_;
    trail_.forget();
    found_.clear(), joints_.clear();
    for (std::size_t i = 0; i < u.size(); ++i) {
        world_.place_outside(Q.data() + i * n, at_);
        world_.near(at_, static_cast<int>(i), cutoff_, found_, trail_, {WINDOW, GAP});
        joints_.insert(joints_.end(), at_.joints.begin(), at_.joints.end());
    }
    push_one_way(found_);
    NearRows rows;
    rows.gradient.resize(found_.size() * n);
    for (std::size_t k = 0; k < found_.size(); ++k) {
        const Contact &contact = found_[k];
        rows.sample.push_back(contact.row);
        rows.value.push_back(contact.witness.distance - margins_.at(u[contact.row], contact.pair));
        world_.gradient(joints_.data() + contact.row * at_.joints.size(), contact, rows.gradient.data() + k * n);
    }
    return rows;
}

TorqueRows::TorqueRows(const Tree &tree, Vec limit, Vec still)
    : dynamics_(tree), limit_(std::move(limit)), still_(std::move(still)),
      heavy_(std::any_of(still_.begin(), still_.end(), [](double most) { return std::isfinite(most); })) {
    for (std::size_t j = 0; j < limit_.size(); ++j)
        if (std::isfinite(limit_[j])) which_.push_back(static_cast<int>(j));
    const std::size_t n = limit_.size();
    none_.assign(which_.size(), 0);
    motion_.resize(3 * n), tau_.resize(n), share_.resize(which_.size()), derivatives_.resize(3 * n * n);
}

void TorqueRows::of(const Spline &spline, const Samples &samples, const double *control, double duration,
                    const Mask &watched, Inequalities &rows, Mask &exceeded) {
    const std::size_t n = spline.joints, count = which_.size();
    rows.compact = false;
    rows.sample.clear(), rows.value.clear(), rows.by_duration.clear(), rows.entries.clear();
    exceeded.assign(samples.count() * count, 0);
    if (!count) return;
    rows.over.resize(samples.count());
    const Vec still = heavy_ ? holding(spline, control) : Vec();
    const double *q = motion_.data(), *v = q + n, *a = v + n;
    for (std::size_t i = 0; i < samples.count(); ++i) {
        rows.over[i].first = std::max(samples.first[i], spline.fixed) - spline.fixed;
        double scale = 1.0;
        for (int order = 0; order < 3; ++order, scale /= duration) {
            double *part = motion_.data() + order * n;
            samples.at(i, order, control, spline, part);
            for (std::size_t j = 0; j < n; ++j) part[j] *= scale;
        }
        dynamics_.torques(q, v, a, tau_.data());
        const char *watching = watched.data() + i * count;
        const bool hot = near_the_limit(limit_, TORQUE_SHARE, watching);
        for (std::size_t k = 0; k < count; ++k) exceeded[i * count + k] = std::fabs(share_[k]) > 1.0;
        if (hot) add(spline, samples, i, duration, 3, limit_, rows);
        if (!heavy_) continue;
        dynamics_.at_rest(tau_.data());
        if (!near_the_limit(still, REST_SHARE, none_.data())) continue;
        std::fill(motion_.begin() + n, motion_.end(), 0.0);
        dynamics_.torques(q, v, a, tau_.data());
        add(spline, samples, i, duration, 1, still, rows);
    }
}

// The limits of torques at rest along a curve: with a reserve, but at least what its ends need.
Vec TorqueRows::holding(const Spline &spline, const double *control) {
    const std::size_t n = spline.joints;
    const Vec rest(n, 0.0);
    Vec found = still_;
    for (double &most : found) most *= HELD;
    for (const std::size_t end : {std::size_t{0}, spline.points - 1}) {
        dynamics_.torques(control + end * n, rest.data(), rest.data(), tau_.data());
        for (std::size_t j = 0; j < n; ++j) found[j] = std::max(found[j], std::fabs(tau_[j]));
    }
    return found;
}

// Sets the shares of limits that torques take, and the joints that get rows: of more than `least`, or watched.
bool TorqueRows::near_the_limit(const Vec &limit, double least, const char *watched) {
    near_.clear();
    for (std::size_t k = 0; k < which_.size(); ++k) {
        share_[k] = tau_[which_[k]] / limit[which_[k]];
        if (std::fabs(share_[k]) > least || watched[k]) near_.push_back(k);
    }
    return !near_.empty();
}

// The rows of the joints in `near_` at one sample, where `dynamics_` has just been asked: of a motion with `orders` 3,
// or at rest with 1, by position alone.
void TorqueRows::add(const Spline &spline, const Samples &samples, std::size_t i, double duration, int orders,
                     const Vec &limit, Inequalities &rows) {
    const std::size_t n = spline.joints, free = spline.free();
    double *by[3] = {derivatives_.data(), derivatives_.data() + n * n, derivatives_.data() + 2 * n * n};
    dynamics_.derivatives(by[0], by[1], by[2]);
    for (const std::size_t k : near_) {
        const double scale = (share_[k] > 0.0 ? -1.0 : share_[k] < 0.0 ? 1.0 : 0.0) / limit[which_[k]];
        const std::size_t at = rows.entries.size();
        rows.entries.resize(at + REACH * n, 0.0);
        double power = 1.0, by_duration = 0.0;
        for (int order = 0; order < orders; ++order, power /= duration) {
            const double *slope = by[order] + which_[k] * n;
            by_duration -= order * dot(slope, motion_.data() + order * n, n);
            for (std::size_t point = 0; point < REACH; ++point) {
                const std::size_t whole = samples.first[i] + point;  // among all control points
                if (whole < spline.fixed || whole >= spline.fixed + free) continue;
                const std::size_t place = whole - spline.fixed - rows.over[i].first;
                add_scaled(rows.entries.data() + at + place * n, scale * power * samples.weights[i][order][point],
                           slope, n);
            }
        }
        rows.sample.push_back(static_cast<int>(i));
        rows.value.push_back(1.0 - std::fabs(share_[k]));
        rows.by_duration.push_back(scale * by_duration / duration);
    }
}

}  // namespace optiplan
