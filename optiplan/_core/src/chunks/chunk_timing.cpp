#include "chunks/chunk_timing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace optiplan {

static constexpr int ROUNDS = 60;
static constexpr double SHORTEST = 1e-4;  // s, of an interval
static constexpr double SPARE = 1.0 + 1e-7;
static constexpr double PACE = 0.6;       // power of the ratio by which an interval is changed

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
            const double speed = std::max({std::fabs(v), std::fabs(v + 0.5 * a * h), std::fabs(v + h * (a + 0.5 * jerk * h))});
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

Vec chunk_times(const JointState &start, const double *Q, std::size_t k, const JointLimits &limits) {
    const std::size_t n = start.q.size();
    Vec h(k), times(k), best;
    for (std::size_t i = 0; i < k; ++i) {
        const double *from = i ? Q + (i - 1) * n : start.q.data();
        h[i] = SHORTEST;
        for (std::size_t j = 0; j < n; ++j) h[i] = std::max(h[i], std::fabs(Q[i * n + j] - from[j]) / limits.rates[0][j]);
    }
    bool rests = true;
    for (std::size_t j = 0; j < n; ++j) rests &= start.v[j] == 0.0 && start.a[j] == 0.0;
    for (int round = 0; round < ROUNDS; ++round) {
        std::partial_sum(h.begin(), h.end(), times.begin());
        const ChunkSpline spline(times, true);
        const Vec found = ratios(spline, spline.curve(spline.through(start, Q), n), limits, k);
        const double worst = *std::max_element(found.begin(), found.end());
        if (!std::isfinite(worst)) return {};
        // From rest, all of it slower by one factor keeps its shape; in motion only what keeps the limits counts.
        const double scale = rests ? std::max(worst * SPARE, 1e-9) : 1.0;
        if ((rests || worst <= SPARE) && (best.empty() || scale * times[k - 1] < best[k - 1])) {
            best = times;
            for (double &t : best) t *= scale;
        }
        for (std::size_t i = 0; i < k; ++i)
            h[i] = std::max(SHORTEST, h[i] * std::pow(std::clamp(found[i], 0.3, 3.0), PACE));
        if (!rests && worst > 1.0 && round > ROUNDS / 2)  // towards what can be kept
            for (double &each : h) each *= 1.02;
    }
    return best;
}

}  // namespace optiplan
