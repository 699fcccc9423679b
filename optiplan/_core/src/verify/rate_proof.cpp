#include "verify/rate_proof.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr int MOST = 16;          // coefficients of a polynomial
static constexpr double UNIT = 0x1p-53;  // rounding of one operation

bool stays_between(const double *b, int size, double low, double high, int halvings) {
    const auto out = [&](double x) { return !(x >= low && x <= high); };  // NaN always is
    if (std::none_of(b, b + size, out)) return true;
    if (halvings == 0 || out(b[0]) || out(b[size - 1])) return false;
    double left[MOST], right[MOST];
    std::copy_n(b, size, right);
    for (int i = 0; i < size; ++i) {
        left[i] = right[0];
        for (int k = 0; k + i + 1 < size; ++k) right[k] = 0.5 * (right[k] + right[k + 1]);
    }
    return stays_between(left, size, low, high, halvings - 1) && stays_between(right, size, low, high, halvings - 1);
}

// Bernstein coefficients of the derivative of this order on a piece, of which c (size,) are the powers of time.
static int bernstein_of(const double *c, int size, int order, double width, double *b) {
    if (size <= order) {
        b[0] = 0.0;
        return 1;
    }
    const int degree = size - order - 1;
    double unit[MOST], power = 1.0;
    for (int k = 0; k <= degree; ++k, power *= width) {
        unit[k] = c[k + order] * power;
        for (int f = 0; f < order; ++f) unit[k] *= k + order - f;
    }
    for (int i = 0; i <= degree; ++i) {
        double share = 1.0;  // C(i, k) / C(degree, k)
        b[i] = unit[0];
        for (int k = 1; k <= i; ++k)
            share *= static_cast<double>(i - k + 1) / (degree - k + 1), b[i] += share * unit[k];
    }
    return degree + 1;
}

Beyond beyond_limits(const Curve &curve, const RateLimits &limits) {
    const int n = curve.joints, size = curve.degree + 1, pieces = static_cast<int>(curve.breakpoints.size()) - 1;
    std::vector<double> sums(3 * n, 0.0), ends(3 * n);
    double c[MOST], b[MOST];
    for (int i = 0; i < pieces; ++i) {
        const double begin = curve.breakpoints[i], width = curve.breakpoints[i + 1] - begin;
        for (int j = 0; j < n; ++j) {
            for (int k = 0; k < size; ++k) c[k] = curve.coefficients[(static_cast<std::size_t>(i) * size + k) * n + j];
            for (int order = 0; order < 4; ++order) {
                const int count = bernstein_of(c, size, order, width, b);
                const double high = order ? limits.rates[order - 1][j] : limits.upper[j];
                const double low = order ? -high : limits.lower[j];
                double terms = 0.0, factor = 1.0;
                for (int k = order; k < size; ++k, factor *= width) {
                    double term = std::fabs(c[k]) * factor;
                    for (int f = 0; f < order; ++f) term *= k - f;
                    terms += term;
                }
                const double allowed = order ? ROUNDED * std::min(high, 1e9) : limits.steps[0][j];
                if (!(UNIT * (size + 1) * terms <= allowed)) return {12, j, begin, UNIT * (size + 1) * terms, allowed};
                if (order < 3) {
                    double &sum = sums[order * n + j];
                    if (i > 0) sum += std::fabs(b[0] - ends[order * n + j]);
                    ends[order * n + j] = b[count - 1];
                    if (sum > limits.steps[order][j]) return {4 + order, j, begin, sum, limits.steps[order][j]};
                }
                if (stays_between(b, count, low, high)) continue;
                double worst = b[0];
                for (int k = 1; k < count; ++k)
                    if (std::max(b[k] - high, low - b[k]) > std::max(worst - high, low - worst)) worst = b[k];
                return {order, j, begin, worst, worst > high ? high : low};
            }
        }
    }
    return {};
}

Beyond beyond_ends(const Curve &curve, const RateLimits &limits, const double *state) {
    const std::size_t n = static_cast<std::size_t>(curve.joints), size = static_cast<std::size_t>(curve.degree) + 1;
    const std::size_t last = curve.breakpoints.size() - 2;
    const double width = curve.breakpoints[last + 1] - curve.breakpoints[last];
    double c[MOST], b[MOST];
    for (std::size_t j = 0; j < n; ++j)
        for (int order = 0; order < 3; ++order) {
            const double allowed = limits.steps[order][j];
            const double first =
                order < static_cast<int>(size) ? curve.coefficients[order * n + j] * (order == 2 ? 2.0 : 1.0) : 0.0;
            const double off = std::fabs(first - state[order * n + j]);
            if (!(off <= allowed)) return {7 + order, static_cast<int>(j), 0.0, off, allowed};
            if (order == 0) continue;
            for (std::size_t k = 0; k < size; ++k) c[k] = curve.coefficients[(last * size + k) * n + j];
            const int count = bernstein_of(c, static_cast<int>(size), order, width, b);
            const double rest = std::fabs(b[count - 1]);
            if (!(rest <= allowed)) return {9 + order, static_cast<int>(j), curve.breakpoints.back(), rest, allowed};
        }
    return {};
}

}  // namespace optiplan
