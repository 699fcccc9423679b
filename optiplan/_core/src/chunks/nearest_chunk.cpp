#include "chunks/nearest_chunk.hpp"

#include <algorithm>
#include <cmath>

#include "control/braking.hpp"

namespace optiplan {

static constexpr double SCALE = 0.05;     // rad or m: unit of the program's variables
static constexpr double UNIT = 0.01;      // m: unit of the program's distances
static constexpr double PRICE = 100.0;  // of a unit of distance that lacks
static constexpr double HOPELESS = 0.05;  // m that lack: more steps seldom help
static constexpr double TIGHT = 1e-3;  // share of the limits that is kept free at most, times their order
static constexpr double REGULAR = 1e-3;  // cost of the change of a control point beside that of set-points
static constexpr double LIKELY =
    0.3;  // rad or m: where this change of each joint does not bring a pair near enough, it has no row
static constexpr int ITERATIONS = 30;  // a program that takes more has no solution within the limits, as a rule
static constexpr double GAP = 2e-4;  // of the program, in half the squared changes, rad or m, over SCALE squared
static constexpr std::size_t FEW = 4;  // rows at one time: of the nearest pairs
static constexpr double MOST_PLACES = 200.0;  // at which pairs are queried, beside one a piece
static constexpr int MOST_QUERIES = 1000;     // after which the rest of a curve is left to the next step
static constexpr int BLOCK = 8;  // pieces in a row of which near pairs are found together

std::vector<NearPlace> near_places(const World &world, Placement &at, const Curve &curve, double window, double width) {
    const std::size_t n = static_cast<std::size_t>(curve.joints);
    const int pieces = static_cast<int>(curve.breakpoints.size()) - 1;
    std::vector<NearPlace> found, here;
    width = std::max(width, curve.breakpoints.back() / MOST_PLACES);
    Vec q(n), reach(n), low(n), high(n), reaches;
    std::vector<int> near;
    std::vector<Features> features(world.pairs().size());
    int queries = 0;
    for (int first = 0; first < pieces && queries < MOST_QUERIES; first += BLOCK) {
        const int last = std::min(first + BLOCK, pieces);
        std::fill(low.begin(), low.end(), HUGE_VAL), std::fill(high.begin(), high.end(), -HUGE_VAL);
        for (int i = first; i < last; ++i) {
            const double half = 0.5 * (curve.breakpoints[i + 1] - curve.breakpoints[i]);
            curve.around(i, curve.breakpoints[i] + half, half, q.data(), reach.data());
            for (std::size_t j = 0; j < n; ++j)
                low[j] = std::min(low[j], q[j] - reach[j]), high[j] = std::max(high[j], q[j] + reach[j]);
        }
        for (std::size_t j = 0; j < n; ++j) q[j] = 0.5 * (low[j] + high[j]), reach[j] = 0.5 * (high[j] - low[j]);
        world.place(q.data(), at);
        world.reaches(at, reaches);
        near.clear();
        for (int pair = 0; pair < static_cast<int>(world.pairs().size()); ++pair)
            if (!world.boxes_apart(at, pair, window + world.travel(reaches, reach.data(), pair))) near.push_back(pair);
        for (int i = first; i < last && !near.empty() && queries < MOST_QUERIES; ++i) {
            const double begin = curve.breakpoints[i], length = curve.breakpoints[i + 1] - begin;
            const int parts = std::max(1, static_cast<int>(std::ceil(length / width)));
            for (int k = 0; k < parts; ++k) {
                const double time = begin + (k + 0.5) * length / parts;
                curve.around(i, time, 0.0, q.data(), reach.data());
                world.place(q.data(), at);
                here.clear();
                for (int pair : near) {
                    if (world.boxes_apart(at, pair, window)) continue;
                    ++queries;
                    const Witness w = world.nearest_points(at, pair, window, &features[pair]);
                    if (w.distance >= window) continue;
                    NearPlace place{time, w.distance, Vec(n), pair};
                    world.gradient(at.joints.data(), {0, pair, w}, place.gradient.data());
                    here.push_back(std::move(place));
                }
                const std::size_t count = std::min(FEW, here.size());
                std::partial_sort(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(count), here.end(),
                                  [](const NearPlace &a, const NearPlace &b) { return a.distance < b.distance; });
                for (std::size_t row = 0; row < count; ++row) found.push_back(std::move(here[row]));
            }
        }
    }
    return found;
}

NearestChunk::NearestChunk(const ChunkSpline &spline, const JointState &start, const double *Q,
                           const JointLimits &limits, double radius)
    : spline_(spline), limits_(limits), radius_(radius), n_(start.q.size()),
      count_(spline.knots().size() - (spline.rests() ? 3 : 2)), first_(spline.through(start, Q)), control_(first_) {
    base();
}

// Control points 3, 4, …; one that rests ends with three that move together.
std::size_t NearestChunk::variables() const { return spline_.points() - (spline_.rests() ? 5 : 3); }

Stencil NearestChunk::free_part_of(const Stencil &stencil) const {
    return free_part(stencil, 3, variables(), spline_.rests());
}

void NearestChunk::base() {
    ArrowProgram &p = program_;
    p.points = variables(), p.joints = padded(n_);
    const std::size_t wide = p.joints, size = p.points * wide, derivatives = 3 * spline_.points() - 6;
    p.hessian.assign(size * REACH, 0.0), p.gradient.assign(size, 0.0);
    p.gradient_t = PRICE, p.low_t = -TIGHT, p.high_t = 0.0;
    p.regularisation = REGULAR, p.regularisation_t = p.regularisation_slack = 1e-6;
    for (std::size_t i = 0; i < count_; ++i) {
        const Stencil s = free_part_of(spline_.at(spline_.knots()[spline_.knot_of(i)]));
        for (std::size_t a = 0; a < s.count; ++a)
            for (std::size_t b = a; b < s.count; ++b)
                for (std::size_t j = 0; j < n_; ++j)
                    p.hessian[((s.first + a) * REACH + b - a) * wide + j] += s.weights[a] * s.weights[b];
    }
    p.low.assign(size, -1.0), p.high.assign(size, 1.0);
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t j = 0; j < n_; ++j) {
            const double here = first_[(i + 3) * n_ + j];
            double low = std::max(limits_.lower[j] - here, -radius_), high = std::min(limits_.upper[j] - here, radius_);
            if (low > -1e-3) high = std::max(high, low + 1e-3);  // some room, also where the chunk is beyond its limits
            if (high < 1e-3) low = std::min(low, high - 1e-3);
            p.low[i * wide + j] = low / SCALE, p.high[i * wide + j] = high / SCALE;
        }
    DerivativeRows &rows = p.derivatives;
    rows.stencils.clear(), rows.order.clear();
    rows.weight.assign(derivatives * wide, 0.0), rows.share.assign(derivatives * wide, 0.0);
    for (int order = 1; order <= 3; ++order)
        for (std::size_t row = 0; row + order < spline_.points(); ++row) {
            const Stencil whole = spline_.derivative(order, row), s = free_part_of(whole);
            if (s.count == 0) continue;
            const std::size_t r = rows.order.size();
            for (std::size_t j = 0; j < n_; ++j) {
                const double limit = limits_.rates[order - 1][j];
                if (!std::isfinite(limit)) continue;
                double value = 0.0;
                for (std::size_t k = 0; k < whole.count; ++k)
                    value += whole.weights[k] * first_[(whole.first + k) * n_ + j];
                rows.weight[r * wide + j] = SCALE / limit, rows.share[r * wide + j] = value / limit;
            }
            rows.stencils.push_back(s), rows.order.push_back(order);
        }
    rows.weight.resize(rows.order.size() * wide), rows.share.resize(rows.order.size() * wide);
}

Curve NearestChunk::curve() const {
    Curve made = spline_.curve(control_, n_);
    if (!spline_.rests()) append_stop(made, limits_);
    return made;
}

// distance + gradient . (change since the last step) >= what is wanted. Within the stop a joint is where the chunk ends
// plus a share of its velocity there.
void NearestChunk::add_row(const NearPlace &place, double distance) {
    ArrowProgram &p = program_;
    const std::size_t wide = p.joints;
    const double end = spline_.knots().back();
    Group group;
    group.price = PRICE, group.begin = p.soft.right.size(), group.end = group.begin + 1;
    group.offset = p.soft.entries.size();
    double moved = 0.0;
    const auto change = [&](const Stencil &whole, std::size_t j) {
        double sum = 0.0;
        for (std::size_t k = 0; k < whole.count; ++k)
            sum += whole.weights[k] * (control_[(whole.first + k) * n_ + j] - first_[(whole.first + k) * n_ + j]);
        return sum;
    };
    const Stencil here = spline_.at(std::min(place.time, end));
    for (std::size_t j = 0; j < n_; ++j) moved += place.gradient[j] * change(here, j);
    if (place.time <= end || spline_.rests()) {
        group.over = free_part_of(here);
        if (group.over.count == 0) return;
        p.soft.entries.resize(group.offset + p.stride(group), 0.0);
        for (std::size_t j = 0; j < n_; ++j) p.soft.entries[group.offset + j] = -place.gradient[j] * SCALE / UNIT;
    } else {
        const Stencil rate = spline_.derivative(1, spline_.points() - 2);
        const JointState last = end_of(spline_.curve(control_, n_));
        group.compact = false;
        group.over.first = p.points > REACH ? p.points - REACH : 0;
        p.soft.entries.resize(group.offset + p.stride(group), 0.0);
        for (std::size_t j = 0; j < n_; ++j) {
            const JointStop stop = Brakes{limits_.rates[1][j], limits_.rates[2][j]}.stop(last.v[j], last.a[j]);
            double q = 0.0, v = last.v[j], a = last.a[j];
            stop.after(place.time - end, q, v, a);
            const double lasting = std::fabs(last.v[j]) > 1e-6 ? q / last.v[j] : 0.0;
            moved += place.gradient[j] * lasting * change(rate, j);
            for (const auto &[stencil, weight] : {std::pair{here, 1.0}, std::pair{rate, lasting}}) {
                const Stencil s = free_part_of(stencil);
                for (std::size_t k = 0; k < s.count; ++k)
                    p.soft.entries[group.offset + (s.first + k - group.over.first) * wide + j] -=
                        weight * s.weights[k] * place.gradient[j] * SCALE / UNIT;
            }
        }
    }
    p.soft.right.push_back((place.distance - distance - moved) / UNIT);
    p.soft.groups.push_back(group);
}

// Joints stop within their limits of position, as near places of their own.
void NearestChunk::add_stop_rows(double distance) {
    const JointState last = end_of(spline_.curve(control_, n_));
    for (std::size_t j = 0; j < n_; ++j) {
        const JointStop stop = Brakes{limits_.rates[1][j], limits_.rates[2][j]}.stop(last.v[j], last.a[j]);
        const double travel = stop.travel(last.v[j]), end = last.q[j] + travel, side = travel > 0.0 ? -1.0 : 1.0;
        const double room = travel > 0.0 ? limits_.upper[j] - end : end - limits_.lower[j];
        if (travel == 0.0 || room > LIKELY) continue;
        NearPlace place{spline_.knots().back() + stop.lasting(), distance + room - 1e-4, Vec(n_, 0.0), -1};
        place.gradient[j] = side;
        add_row(place, distance);
    }
}

bool NearestChunk::step(const std::vector<NearPlace> &near, double distance) {
    SoftRows &soft = program_.soft;
    soft.groups.clear(), soft.entries.clear(), soft.right.clear();
    for (const NearPlace &place : near) {
        double slope = 0.0;
        for (double each : place.gradient) slope += std::fabs(each);
        if (place.distance - distance < LIKELY * slope) add_row(place, distance);
    }
    if (!spline_.rests()) add_stop_rows(distance);
    ArrowSettings settings;
    settings.gap = GAP, settings.iterations = ITERATIONS;
    const ArrowSolution found = qp_.solve(program_, settings);
    if (!found.solved) return false;
    for (double lacking : found.slack)
        if (lacking * UNIT > HOPELESS) return false;
    for (std::size_t i = 3; i < spline_.points(); ++i) {
        const std::size_t variable = std::min(i - 3, program_.points - 1);
        for (std::size_t j = 0; j < n_; ++j)
            control_[i * n_ + j] = first_[i * n_ + j] + SCALE * found.x[variable * program_.joints + j];
    }
    return true;
}

Vec NearestChunk::set_points() const {
    Vec made(count_ * n_, 0.0);
    for (std::size_t i = 0; i < count_; ++i) {
        const Stencil s = spline_.at(spline_.knots()[spline_.knot_of(i)]);
        for (std::size_t k = 0; k < s.count; ++k)
            for (std::size_t j = 0; j < n_; ++j) made[i * n_ + j] += s.weights[k] * control_[(s.first + k) * n_ + j];
    }
    return made;
}

}  // namespace optiplan
