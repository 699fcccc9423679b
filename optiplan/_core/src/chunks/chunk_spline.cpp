#include "chunks/chunk_spline.hpp"

#include <algorithm>
#include <cmath>

#include "control/braking.hpp"

namespace optiplan {

static constexpr double SAME_TIME = 1e-9;  // s; phases of joints that end nearer than this end together

ChunkSpline::ChunkSpline(const Vec &times, bool rests) : rests_(rests) {
    const std::size_t k = times.size();
    if (rests && k == 1) {
        knots_ = {0.0, times[0] / 3.0, 2.0 * times[0] / 3.0, times[0]};
        return;
    }
    knots_ = {0.0, 0.5 * times[0]};
    knots_.insert(knots_.end(), times.begin(), times.end());
    if (rests) knots_.insert(knots_.end() - 1, 0.5 * (times[k - 2] + times[k - 1]));
}

std::size_t ChunkSpline::knot_of(std::size_t set_point) const {
    const std::size_t last = knots_.size() - 1, count = last - (rests_ ? 2 : 1);
    return set_point + 1 >= count ? last : set_point + 2;
}

double ChunkSpline::knot(std::size_t i) const { return knots_[std::clamp<std::size_t>(i, 3, knots_.size() + 2) - 3]; }

Stencil ChunkSpline::at(double time) const {
    const std::size_t last = knots_.size() - 2;
    const auto after = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, time);
    const std::size_t span = std::min<std::size_t>(static_cast<std::size_t>(after - knots_.begin()) - 1, last);
    double N[4] = {1.0, 0.0, 0.0, 0.0};  // Cox and de Boor, by rising degree
    for (std::size_t d = 1; d <= 3; ++d) {
        double saved = 0.0;
        for (std::size_t r = 0; r < d; ++r) {
            const double right = knot(span + 4 + r), left = knot(span + 4 + r - d);
            const double share = N[r] / (right - left);
            N[r] = saved + (right - time) * share;
            saved = (time - left) * share;
        }
        N[d] = saved;
    }
    Stencil found{span, 4, {}};
    std::copy_n(N, 4, found.weights.begin());
    return found;
}

Stencil ChunkSpline::derivative(int order, std::size_t row) const {
    Stencil found{row, static_cast<std::size_t>(order) + 1, {}};
    found.weights[0] = 1.0;
    // By falling order: the row of order k is a difference of neighbouring rows of order k - 1.
    for (int k = order; k >= 1; --k) {
        const int degree = 4 - k;
        std::array<double, REACH> lower{};
        for (std::size_t i = 0; i + k <= static_cast<std::size_t>(order); ++i) {
            const std::size_t p = row + i;
            const double scale = degree / (knot(p + 4) - knot(p + static_cast<std::size_t>(k)));
            lower[i] -= scale * found.weights[i], lower[i + 1] += scale * found.weights[i];
        }
        found.weights = lower;
    }
    return found;
}

Vec ChunkSpline::through(const JointState &start, const double *Q) const {
    const std::size_t n = start.q.size(), last = knots_.size() - 1, count = last - (rests_ ? 2 : 1);
    Vec c(points() * n);
    const double first = knots_[1] - knots_[0], second = knots_[2] - knots_[0];
    for (std::size_t j = 0; j < n; ++j) {
        c[j] = start.q[j];
        c[n + j] = c[j] + start.v[j] * first / 3.0;
        c[2 * n + j] = c[n + j] + (start.v[j] + 0.5 * start.a[j] * first) * second / 3.0;
        for (std::size_t k = 0; k < (rests_ ? 3u : 1u); ++k) c[(last + 2 - k) * n + j] = Q[(count - 1) * n + j];
    }
    // Unknown: the control points from 3 on, of which the row of each knot has three: tridiagonal.
    const std::size_t unknown = rests_ ? last - 3 : last - 1;
    Vec diagonal(unknown), right(unknown), rest(unknown * n);
    for (std::size_t u = 0; u < unknown; ++u) {
        double low, middle, high;
        const std::size_t i = u + 2;
        if (!rests_ && u + 1 == unknown) {  // no acceleration at the end
            const double h = knots_[last] - knots_[last - 1], wide = knots_[last] - knots_[last - 2];
            low = -1.0 / wide, middle = 1.0 / h + 1.0 / wide, high = -1.0 / h;
        } else {
            const Stencil row = at(knots_[i]);
            low = row.weights[0], middle = row.weights[1], high = row.weights[2];
            for (std::size_t j = 0; j < n; ++j) rest[u * n + j] = Q[u * n + j];
        }
        const double *before = c.data() + i * n, *after = c.data() + (i + 2) * n;
        if (u == 0)
            for (std::size_t j = 0; j < n; ++j) rest[j] -= low * before[j];
        if (u + 1 == unknown)
            for (std::size_t j = 0; j < n; ++j) rest[u * n + j] -= high * after[j];
        const double share = u ? low / diagonal[u - 1] : 0.0;
        diagonal[u] = middle - (u ? share * right[u - 1] : 0.0), right[u] = high;
        if (u)
            for (std::size_t j = 0; j < n; ++j) rest[u * n + j] -= share * rest[(u - 1) * n + j];
    }
    for (std::size_t u = unknown; u-- > 0;)
        for (std::size_t j = 0; j < n; ++j) {
            const double after = u + 1 < unknown ? right[u] * c[(u + 4) * n + j] : 0.0;
            c[(u + 3) * n + j] = (rest[u * n + j] - after) / diagonal[u];
        }
    return c;
}

Curve ChunkSpline::curve(const Vec &control, std::size_t n) const {
    const std::size_t pieces = knots_.size() - 1;
    Curve made{knots_, Vec(pieces * 4 * n), 3, static_cast<int>(n)};
    Vec rates((pieces + 2) * n), bends((pieces + 1) * n);
    for (std::size_t p = 0; p < pieces + 2; ++p)
        for (std::size_t j = 0; j < n; ++j)
            rates[p * n + j] = 3.0 * (control[(p + 1) * n + j] - control[p * n + j]) / (knot(p + 4) - knot(p + 1));
    for (std::size_t p = 0; p < pieces + 1; ++p)
        for (std::size_t j = 0; j < n; ++j)
            bends[p * n + j] = 2.0 * (rates[(p + 1) * n + j] - rates[p * n + j]) / (knot(p + 4) - knot(p + 2));
    for (std::size_t i = 0; i < pieces; ++i) {
        const double h = knots_[i + 1] - knots_[i], before = i ? knots_[i] - knots_[i - 1] : 0.0;
        const Stencil here = at(knots_[i]);
        double *out = made.coefficients.data() + i * 4 * n;
        for (std::size_t j = 0; j < n; ++j) {
            double q = 0.0;
            for (std::size_t k = 0; k < 4; ++k) q += here.weights[k] * control[(here.first + k) * n + j];
            out[j] = q;
            out[n + j] = (h * rates[i * n + j] + before * rates[(i + 1) * n + j]) / (h + before);
            out[2 * n + j] = 0.5 * bends[i * n + j];
            out[3 * n + j] = (bends[(i + 1) * n + j] - bends[i * n + j]) / (6.0 * h);
        }
    }
    return made;
}

JointState end_of(const Curve &curve) {
    const auto n = static_cast<std::size_t>(curve.joints), size = static_cast<std::size_t>(curve.degree) + 1;
    const std::size_t piece = curve.breakpoints.size() - 2;
    const double h = curve.breakpoints[piece + 1] - curve.breakpoints[piece];
    const double *c = curve.coefficients.data() + piece * size * n;
    JointState end{Vec(n), Vec(n), Vec(n)};
    for (std::size_t k = size; k-- > 0;)
        for (std::size_t j = 0; j < n; ++j) {
            end.a[j] = end.a[j] * h + 2.0 * end.v[j];
            end.v[j] = end.v[j] * h + end.q[j];
            end.q[j] = end.q[j] * h + c[k * n + j];
        }
    return end;
}

static void append_stop_from(Curve &curve, const JointState &state, const JointLimits &limits, double share) {
    const std::size_t n = state.q.size();
    std::vector<JointStop> stops(n);
    Vec ends;
    for (std::size_t j = 0; j < n; ++j) {
        stops[j] = Brakes{share * limits.rates[1][j], share * limits.rates[2][j]}.stop(state.v[j], state.a[j]);
        double sum = 0.0;
        for (int k = 0; k < stops[j].size; ++k) ends.push_back(sum += stops[j].phases[k].lasting);
    }
    std::sort(ends.begin(), ends.end());
    const double begin = curve.breakpoints.back();
    double from = 0.0;
    for (double to : ends) {
        if (to - from < SAME_TIME) continue;
        const double middle = 0.5 * (from + to);
        double rows[4][64];
        for (std::size_t j = 0; j < n; ++j) {
            double q = state.q[j], v = state.v[j], a = 0.0, jerk = 0.0, sum = 0.0;
            for (int k = 0; k < stops[j].size; ++k) {
                const Phase &phase = stops[j].phases[k];
                if (middle < sum + phase.lasting) {
                    const double into = from - sum;
                    q += into * (v + into * (0.5 * phase.first + into * phase.jerk / 6.0));
                    v += into * (phase.first + 0.5 * phase.jerk * into);
                    a = phase.first + phase.jerk * into, jerk = phase.jerk;
                    sum = HUGE_VAL;
                    break;
                }
                const double t = phase.lasting;
                q += t * (v + t * (0.5 * phase.first + t * phase.jerk / 6.0));
                v += t * (phase.first + 0.5 * phase.jerk * t);
                sum += t;
            }
            if (std::isfinite(sum)) v = 0.0;  // it stands; what is left of its velocity is rounding
            rows[0][j] = q, rows[1][j] = v, rows[2][j] = 0.5 * a, rows[3][j] = jerk / 6.0;
        }
        for (const auto &row : rows) curve.coefficients.insert(curve.coefficients.end(), row, row + n);
        curve.breakpoints.push_back(begin + to);
        from = to;
    }
}

void append_stop(Curve &curve, const JointLimits &limits) { append_stop_from(curve, end_of(curve), limits, 1.0); }

Curve stop_from(const JointState &state, const JointLimits &limits, double share) {
    Curve made{{0.0}, {}, 3, static_cast<int>(state.q.size())};
    append_stop_from(made, state, limits, share);
    return made;
}

}  // namespace optiplan
