#include "control/clearance_watch.hpp"

#include <cmath>
#include <limits>

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();

ClearanceWatch::ClearanceWatch(const World &world, std::vector<double> arms, std::vector<double> reaches,
                               JointEffects effects, WatchRules rules)
    : world_(world), arms_(std::move(arms)), reaches_(std::move(reaches)), effects_(std::move(effects)),
      rules_(std::move(rules)), q_(joints()) {}

Placement ClearanceWatch::placed(const double *q) const {
    Placement at = world_.placement();
    world_.place(q, at);
    return at;
}

View ClearanceWatch::look(const double *q, const View *before) {
    const std::size_t n = joints(), count = pairs();
    View view;
    view.q.assign(q, q + n);
    view.bound.assign(count, -INF);
    seen_.assign(count, 0);
    if (before) {
        for (std::size_t j = 0; j < n; ++j) q_[j] = std::fabs(q[j] - before->q[j]);
        for (std::size_t p = 0; p < count; ++p) {
            const double *arm = arms_.data() + p * n;
            double travel = 0.0;
            for (std::size_t j = 0; j < n; ++j) travel += arm[j] * q_[j];
            view.bound[p] = before->bound[p] - travel;
        }
        for (std::size_t k = 0; k < before->near.size(); ++k) seen_[before->near[k]] = static_cast<int>(k) + 1;
    }
    const Placement at = placed(q);
    for (std::size_t p = 0; p < count; ++p) {
        const double comes = rules_.influence[p], stays = rules_.kept * comes;
        if (view.bound[p] >= (seen_[p] ? stays : comes)) continue;
        Features features = before && seen_[p] ? before->features[seen_[p] - 1] : Features{};
        const Contact contact{0, static_cast<int>(p), world_.nearest_points(at, static_cast<int>(p), INF, &features)};
        const double distance = view.bound[p] = contact.witness.distance;
        if (!(distance < stays)) continue;
        view.near.push_back(contact.pair);
        view.distance.push_back(distance);
        view.features.push_back(features);
        view.gradient.resize(view.gradient.size() + n);
        world_.gradient(at.joints.data(), contact, view.gradient.data() + view.gradient.size() - n);
    }
    return view;
}

// Distances of pairs, and whether all are at least `least` (P,).
bool ClearanceWatch::measure(const Placement &at, const std::vector<int> &which, const double *least,
                             std::vector<double> &out) const {
    out.clear();
    for (int p : which) {
        out.push_back(world_.nearest_points(at, p, INF).distance);
        if (!(out.back() >= least[p])) return false;
    }
    return true;
}

// The least distance of two points whose distances are d_0 and d_1 at the ends of a straight way against each other
// that is no longer than `chord`.
static double least_between(double d_0, double d_1, double chord) {
    if (!(d_0 > 0.0 && d_1 > 0.0)) return -INF;
    const double difference = d_0 * d_0 - d_1 * d_1, square = chord * chord;
    if (square <= std::fabs(difference)) return std::fmin(d_0, d_1);
    const double foot = (square + difference) / (2.0 * chord);
    return std::sqrt(std::fmax(d_0 * d_0 - foot * foot, 0.0));
}

// Written so that what is no number is not clear.
bool ClearanceWatch::stop_is_clear(const StopPath &path, const View &start, const double *least) {
    const std::size_t n = joints();
    for (std::size_t k = 0; k < start.near.size(); ++k)
        if (!(start.distance[k] >= least[start.near[k]])) return false;
    Part whole{0, path.steps, {}, {}, {}, {}, {}, start.q, path.end};
    for (std::size_t p = 0; p < pairs(); ++p) {
        double travel = 0.0;
        for (std::size_t j = 0; j < n; ++j) travel += arms_[p * n + j] * path.way[j];
        if (!(start.bound[p] - travel >= least[p])) {
            whole.which.push_back(static_cast<int>(p));
            whole.distance.push_back(start.bound[p]);
        }
    }
    if (whole.which.empty()) return true;
    whole.last_at = placed(path.end.data());
    if (!measure(whole.last_at, whole.which, least, whole.last_distance)) return false;
    whole.at = placed(start.q.data());
    return part_is_clear(path, whole, least);
}

bool ClearanceWatch::part_is_clear(const StopPath &path, const Part &part, const double *least) {
    if (part.last - part.first <= 1) return true;
    Part before{part.first, 0, {}, {}, {}, part.at, {}, part.q, std::vector<double>(joints())};
    std::vector<double> last;
    for (std::size_t k = 0; k < part.which.size(); ++k) {
        const int p = part.which[k];
        const double straight = least_between(part.distance[k], part.last_distance[k], chord(part.at, part.last_at, p));
        if (!(straight >= least[p] && straight - deviation(path, part, p) >= least[p])) {
            before.which.push_back(p);
            before.distance.push_back(part.distance[k]);
            last.push_back(part.last_distance[k]);
        }
    }
    if (before.which.empty()) return true;
    before.last = (part.first + part.last) / 2;
    path.whole(before.last, before.last_q.data());
    before.last_at = placed(before.last_q.data());
    if (!measure(before.last_at, before.which, least, before.last_distance)) return false;
    if (!part_is_clear(path, before, least)) return false;
    return part_is_clear(path,
                         {before.last, part.last, before.which, before.last_distance, last, before.last_at,
                          part.last_at, before.last_q, part.last_q},
                         least);
}

// How far points of the bodies of a pair stray at most from the straight ways, against each other, that `chord` tells.
double ClearanceWatch::deviation(const StopPath &path, const Part &part, int pair) const {
    const double *arms = arms_.data() + pair * joints();
    const double time = (part.last - part.first) * path.dt;
    double unsteady = 0.0, turned = 0.0, slid = 0.0, travel = 0.0;
    for (std::size_t j = 0; j < joints(); ++j) {
        if (!(arms[j] > 0.0)) continue;
        const double way = std::fabs(part.last_q[j] - part.q[j]);
        unsteady += arms[j] * path.strongest(j, part.first, part.last);
        turned += effects_.turns[j] * way, slid += effects_.slides[j] * way;
        travel += arms[j] * way;
    }
    return 0.125 * (unsteady * (time * time) + turned * (travel + slid));
}

// |p' - p| + |R' - R|_F / √2 · reach of both bodies against the joint that carries both: chords of all their points.
double ClearanceWatch::chord(const Placement &first, const Placement &second, int pair) const {
    const Pair &bodies = world_.pairs()[pair];
    const int common = world_.common(pair);
    double sum = 0.0;
    for (int side = 0; side < 2; ++side) {
        const int joint = world_.bodies()[side ? bodies.b : bodies.a].joint;
        if (joint == common) continue;
        Pose X = first.joints[joint], Y = second.joints[joint];
        if (common > 0) X = relative(first.joints[common], X), Y = relative(second.joints[common], Y);
        double turn = 0.0;
        for (int row = 0; row < 3; ++row) turn += squared_norm(Y.R.rows[row] - X.R.rows[row]);
        sum += norm(Y.p - X.p) + std::sqrt(0.5 * turn) * reaches_[2 * pair + side];
    }
    return sum;
}

}  // namespace optiplan
