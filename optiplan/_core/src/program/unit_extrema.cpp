#include "program/unit_extrema.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

namespace {

constexpr int NEWTON_STEPS = 100;
constexpr double ROUNDING = 0x1p-51;  // share of the sum of the sizes of the terms below which a value is rounding
constexpr double INF = std::numeric_limits<double>::infinity();

double evaluate(const double *c, int degree, double x) {
    if (degree == 0) return c[0];
    double value = c[degree] * x;
    value += c[degree - 1];
    for (int k = degree - 2; k >= 0; --k) {
        value *= x;
        value += c[k];
    }
    return value;
}

// Of a quotient that is no number, as where there is no root at all: an end.
double clipped(double x) { return std::isnan(x) ? 0.0 : std::min(std::max(x, 0.0), 1.0); }

// The root of a monotone polynomial in its bracket: Newton's method, else bisection.
double solved(const double *c, int degree, double low, double high, bool rising) {
    double slope[MOST_UNIT_COEFFICIENTS];
    for (int k = 1; k <= degree; ++k) slope[k - 1] = c[k] * k;
    double x = 0.5 * (low + high), last = high - low;
    for (int step = 0; step < NEWTON_STEPS; ++step) {
        const double value = evaluate(c, degree, x);
        ((value < 0.0) == rising ? low : high) = x;
        const double change = -value / evaluate(slope, degree - 1, x);
        double next = x + change;
        if (!(next >= low && next <= high && std::fabs(change) <= 0.5 * last)) next = 0.5 * (low + high);
        last = std::fabs(next - x);
        x = next;
        if (last <= 1e-15) break;
    }
    return x;
}

// Points of [0, 1] that include all roots there, `degree` of them; see `unit_roots` of `trajectory.polynomial`.
void roots(const double *c, int degree, double *found) {
    if (degree == 1) {
        found[0] = clipped(-c[0] / c[1]);
        return;
    }
    if (degree == 2) {
        double scale = std::max({std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2])});
        if (scale == 0.0) scale = 1.0;
        const double c0 = c[0] / scale, c1 = c[1] / scale, c2 = c[2] / scale;
        const double root = std::sqrt(std::max(c1 * c1 - 4.0 * c2 * c0, 0.0));
        const double s = -0.5 * (c1 + std::copysign(root, c1));
        found[0] = clipped(s / c2), found[1] = clipped(c0 / s);
        return;
    }
    double slope[MOST_UNIT_COEFFICIENTS], edges[MOST_UNIT_COEFFICIENTS + 1], size = 0.0;
    for (int k = 1; k <= degree; ++k) slope[k - 1] = c[k] * k;
    for (int k = 0; k <= degree; ++k) size += std::fabs(c[k]);
    edges[0] = 0.0, edges[degree] = 1.0;
    roots(slope, degree - 1, edges + 1);
    std::sort(edges + 1, edges + degree);
    double before = evaluate(c, degree, edges[0]);
    for (int k = 0; k < degree; ++k) {
        const double after = evaluate(c, degree, edges[k + 1]);
        const bool nothing = std::fabs(before) <= ROUNDING * size, then = std::fabs(after) <= ROUNDING * size;
        found[k] = then && !nothing ? edges[k + 1] : edges[k];
        if (!nothing && !then && (before < 0.0) != (after < 0.0))
            found[k] = solved(c, degree, edges[k], edges[k + 1], before < 0.0);
        before = after;
    }
}

// Bernstein coefficients b_i = sum_k C(i, k) / C(d, k) c_k.
void bernstein(const double *c, int degree, double *b) {
    for (int i = 0; i <= degree; ++i) {
        double share = 1.0;
        b[i] = c[0];
        for (int k = 1; k <= i; ++k) share *= static_cast<double>(i - k + 1) / (degree - k + 1), b[i] += share * c[k];
    }
}

}  // namespace

UnitExtrema unit_extrema(const double *c, std::size_t pieces, std::size_t stride, int size) {
    const int degree = size - 1;
    double b[MOST_UNIT_COEFFICIENTS], slope[MOST_UNIT_COEFFICIENTS], x[MOST_UNIT_COEFFICIENTS + 2];
    double lowest = INF, highest = -INF;
    for (std::size_t i = 0; i < pieces; ++i)
        for (double end : {0.0, 1.0}) {
            const double value = evaluate(c + i * stride, degree, end);
            lowest = std::min(lowest, value), highest = std::max(highest, value);
        }
    UnitExtrema found{INF, -INF};
    for (std::size_t i = 0; i < pieces; ++i) {
        const double *own = c + i * stride;
        bernstein(own, degree, b);
        const auto [least, most] = std::minmax_element(b, b + size);
        // A margin, since values here and there are sums in another order.
        const double margin = 1e-12 * std::max(std::fabs(*least), std::fabs(*most));
        if (*least - margin > lowest && *most + margin < highest) continue;
        x[0] = 0.0, x[1] = 1.0;
        for (int k = 1; k <= degree; ++k) slope[k - 1] = own[k] * k;
        if (degree > 1) roots(slope, degree - 1, x + 2);
        for (int k = 0; k < (degree > 0 ? degree + 1 : 1); ++k) {
            const double value = evaluate(own, degree, x[k]);
            if (value < found.low) found.low = value, found.x_low = x[k], found.piece_low = i;
            if (value > found.high) found.high = value, found.x_high = x[k], found.piece_high = i;
        }
    }
    return found;
}

}  // namespace optiplan
