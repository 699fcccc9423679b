#include "chunks/chunk_timing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace optiplan {

static constexpr double PACES[] = {1.0, 0.9, 0.8, 0.7,
                                   0.6, 0.5, 0.4, 0.3};  // of robots in motion, as shares of the limits
static constexpr int FEW_ROUNDS = 6;    // at each of these paces
static constexpr int ROUNDS = 30;
static constexpr double SHORTEST = 1e-4;  // s, of an interval
static constexpr double SLOWEST = 100.0;  // times the least interval: of robots that hardly move
static constexpr double SPARE = 1.0 + 1e-7;
static constexpr double PACE = 0.2;   // power of the ratio by which an interval is changed
static constexpr double SIDE = 0.9;   // share of the ratio of a neighbour that counts, too
static constexpr double SHRINK = 1.0 / 3.0, MOST = 3.0;  // ratios that count

// By how much longer each interval would have to be, were it alone, for the spline to keep its limits there: (k,).
static Vec ratios(const ChunkSpline &spline, const Curve &curve, const JointLimits &limits, std::size_t k) {
    const std::size_t n = static_cast<std::size_t>(curve.joints), pieces = curve.breakpoints.size() - 1;
    Vec found(k, 0.0);
    std::size_t interval = 0;
    for (std::size_t i = 0; i < pieces; ++i) {
        const double h = curve.breakpoints[i + 1] - curve.breakpoints[i];
        const double *c = curve.coefficients.data() + i * 4 * n;
        double &most = found[interval];
        for (std::size_t j = 0; j < n; ++j) {
            const double v = c[n + j], a = 2.0 * c[2 * n + j], jerk = 6.0 * c[3 * n + j], last = a + jerk * h;
            const double speed =
                std::max({std::fabs(v), std::fabs(v + 0.5 * a * h), std::fabs(v + h * (a + 0.5 * jerk * h))});
            const double bend = std::max(std::fabs(a), std::fabs(last)) / limits.rates[1][j];
            const double twist = std::fabs(jerk) / limits.rates[2][j];
            most = std::max(most, speed / limits.rates[0][j]);
            if (bend > most * most) most = std::sqrt(bend);
            if (twist > most * most * most) most = std::cbrt(twist);
        }
        if (interval + 1 < k && i + 1 == spline.knot_of(interval)) ++interval;
    }
    return found;
}

// The fastest speeds along a path within velocity and acceleration, x = s'^2 at G + 1 places of it, by backward and
// forward passes (Pham and Pham, A new approach to time-optimal path parameterization, T-RO 2018).
class SpeedProfile {
  public:
    SpeedProfile(const Curve &path, const JointLimits &limits, double first, double pace)
        : path_(path), limits_(limits), first_speed_(first), pace_(pace * pace) {
        const std::size_t pieces = path.breakpoints.size() - 1;
        for (std::size_t i = 0; i < pieces; ++i)
            for (int k = 0; k < GRID; ++k)
                places_.push_back(path.breakpoints[i] + (path.breakpoints[i + 1] - path.breakpoints[i]) * k / GRID);
        places_.push_back(path.breakpoints.back());
    }

    // Time at each breakpoint of the path, from the first speed at its start to rest at its end.
    Vec times() {
        const std::size_t last = places_.size() - 1;
        Vec most(last + 1, 0.0), x(last + 1);
        for (std::size_t i = last; i-- > 0;) most[i] = fastest(i, most[i + 1]);
        x[0] = std::min(first_speed_ * first_speed_, most[0]);
        Vec found{0.0};
        double t = 0.0;
        for (std::size_t i = 0; i < last; ++i) {
            const double step = places_[i + 1] - places_[i];
            double low, high;
            derivatives(i);
            range(x[i], low, high);
            x[i + 1] = std::clamp(x[i] + 2.0 * step * high, 0.0, most[i + 1]);
            t += 2.0 * step / std::max(std::sqrt(x[i]) + std::sqrt(x[i + 1]), 1e-6);
            if ((i + 1) % GRID == 0) found.push_back(t);
        }
        return found;
    }

  private:
    static constexpr int GRID = 4;

    // First and second derivatives of the path at a place, and the most x there that velocities admit.
    void derivatives(std::size_t place) {
        const std::size_t n = static_cast<std::size_t>(path_.joints), pieces = path_.breakpoints.size() - 1;
        const std::size_t piece = std::min(place / GRID, pieces - 1);
        const double s = places_[place] - path_.breakpoints[piece];
        const double *c = path_.coefficients.data() + piece * 4 * n;
        first_.resize(n), second_.resize(n);
        top_ = HUGE_VAL;
        for (std::size_t j = 0; j < n; ++j) {
            first_[j] = c[n + j] + s * (2.0 * c[2 * n + j] + s * 3.0 * c[3 * n + j]);
            second_[j] = 2.0 * c[2 * n + j] + 6.0 * s * c[3 * n + j];
            const double rate = limits_.rates[0][j] / std::max(std::fabs(first_[j]), 1e-12);
            top_ = std::min(top_, rate * rate);
        }
        top_ = std::max(pace_ * top_, std::min(top_, first_speed_ * first_speed_));
    }

    // Accelerations s'' that joints admit at speed x: |p' s'' + p'' x| <= A; whether there are any.
    bool range(double x, double &low, double &high) const {
        low = -HUGE_VAL, high = HUGE_VAL;
        for (std::size_t j = 0; j < first_.size(); ++j) {
            const double bend = second_[j] * x, size = std::fabs(first_[j]), limit = pace_ * limits_.rates[1][j];
            if (size < 1e-9) {
                if (std::fabs(bend) > limit) return false;
                continue;
            }
            const double middle = -bend / first_[j], half = limit / size;
            low = std::max(low, middle - half), high = std::min(high, middle + half);
        }
        return low <= high;
    }

    // The most x at a place from which the next place is reached with no more than `next`.
    double fastest(std::size_t place, double next) {
        derivatives(place);
        const double step = places_[place + 1] - places_[place];
        const auto good = [&](double x) {
            double low, high;
            return range(x, low, high) && x + 2.0 * step * low <= next && x + 2.0 * step * high >= 0.0;
        };
        double low = 0.0, high = std::min(top_, 1e12);
        if (good(high)) return high;
        for (int k = 0; k < 30; ++k) (good(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
        return low;
    }

    const Curve &path_;
    const JointLimits &limits_;
    Vec places_, first_, second_;
    double first_speed_, pace_, top_ = 0.0;
};

// Intervals (k,) of the fastest way along the path of a spline, without limits of jerk.
static Vec first_intervals(const JointState &start, const double *Q, std::size_t k, const JointLimits &limits,
                           bool rests, double pace) {
    const std::size_t n = start.q.size();
    Vec h(k), times(k);
    for (std::size_t i = 0; i < k; ++i) {
        const double *from = i ? Q + (i - 1) * n : start.q.data();
        h[i] = SHORTEST;
        for (std::size_t j = 0; j < n; ++j)
            h[i] = std::max(h[i], std::fabs(Q[i * n + j] - from[j]) / limits.rates[0][j]);
    }
    double along = 0.0, way = 0.0, speed = 0.0;  // the first interval is as long as the robot's own speed makes it
    for (std::size_t j = 0; j < n; ++j) {
        const double step = Q[j] - start.q[j];
        along += step * start.v[j], way += step * step, speed += start.v[j] * start.v[j];
    }
    // Of all of its speed: where little of it is along the step, the path would begin with a large loop.
    const double scale = along > 0.0 ? std::min(std::sqrt(way / speed) / h[0], SLOWEST) : 1.0;
    for (double &each : h) each *= scale;
    std::partial_sum(h.begin(), h.end(), times.begin());
    JointState begin = start;
    if (rests)  // the path needs a direction where the robot stands
        for (std::size_t j = 0; j < n; ++j) begin.v[j] = (Q[j] - start.q[j]) / h[0];
    const ChunkSpline spline(times, false);
    const Curve path = spline.curve(spline.through(begin, Q), n);
    const Vec at = SpeedProfile(path, limits, rests ? 0.0 : 1.0, pace).times();
    for (std::size_t i = 0; i < k; ++i)
        h[i] = std::max(SHORTEST, at[spline.knot_of(i)] - (i ? at[spline.knot_of(i - 1)] : 0.0));
    return h;
}

// Times, and the largest of their ratios: 1 where they keep the limits.
struct RatedTimes {
    Vec times;
    double worst = HUGE_VAL;
};

// Improves times that begin with intervals h (k,) round by round.
static RatedTimes improved(Vec h, const JointState &start, const double *Q, const JointLimits &limits, bool rests,
                           int rounds) {
    const std::size_t n = start.q.size(), k = h.size();
    Vec times(k);
    RatedTimes best;
    for (int round = 0; round < rounds; ++round) {
        std::partial_sum(h.begin(), h.end(), times.begin());
        const ChunkSpline spline(times, true);
        const Vec found = ratios(spline, spline.curve(spline.through(start, Q), n), limits, k);
        const double worst = *std::max_element(found.begin(), found.end());
        if (!std::isfinite(worst)) break;
        // From rest, all of it slower by one factor keeps its shape.
        const double scale = rests ? std::max(worst * SPARE, 1e-9) : 1.0, left = rests ? 1.0 : std::max(worst, SPARE);
        if (left < best.worst || (left == best.worst && scale * times[k - 1] < best.times[k - 1])) {
            best = {times, left};
            for (double &t : best.times) t *= scale;
        }
        for (std::size_t i = 0; i < k; ++i) {
            // What a spline does in one interval depends on its neighbours, too.
            const double most =
                std::max({found[i], i ? SIDE * found[i - 1] : 0.0, i + 1 < k ? SIDE * found[i + 1] : 0.0});
            h[i] = std::max(SHORTEST, h[i] * std::pow(std::clamp(most, SHRINK, MOST), PACE));
        }
    }
    return best;
}

Vec chunk_times(const JointState &start, const double *Q, std::size_t k, const JointLimits &limits) {
    const std::size_t n = start.q.size();
    for (std::size_t i = 0; i < k * n; ++i)
        if (!std::isfinite(Q[i])) return {};
    bool rests = true;
    for (std::size_t j = 0; j < n; ++j) rests &= start.v[j] == 0.0 && start.a[j] == 0.0;
    if (rests) return improved(first_intervals(start, Q, k, limits, true, 1.0), start, Q, limits, true, ROUNDS).times;
    RatedTimes best;
    for (double pace : PACES) {
        RatedTimes found =
            improved(first_intervals(start, Q, k, limits, false, pace), start, Q, limits, false, FEW_ROUNDS);
        if (found.worst < best.worst) best = std::move(found);
        if (best.worst <= SPARE) break;
    }
    return best.times;
}

}  // namespace optiplan
