#include "control/limit_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pose.hpp"

namespace optiplan {

void LimitRows::normalise(std::size_t k, double least) {
    double *row = G.data() + k * n, squares = 0.0;
    for (std::size_t j = 0; j < n; ++j) squares += row[j] * row[j];
    unit[k] = std::max(std::sqrt(squares), least);
    for (std::size_t j = 0; j < n; ++j) row[j] /= unit[k];
    low[k] /= unit[k], high[k] /= unit[k];
}

LimitRows torque_rows(const double *M, const double *h, const double *v, const double *torque, double dt,
                      std::size_t n) {
    LimitRows found(n, n);
    for (std::size_t k = 0; k < n; ++k) {
        const double *row = M + k * n, unit = found.unit[k] = std::max(row[k], 1e-9) / dt;
        double moved = 0.0;
        for (std::size_t j = 0; j < n; ++j) moved += row[j] * v[j], found.G[k * n + j] = row[j] / (dt * unit);
        const double still = h[k] - moved / dt;
        found.low[k] = (-torque[k] - still) / unit, found.high[k] = (torque[k] - still) / unit;
    }
    return found;
}

// An orthonormal basis whose first vector lies along a motion.
static Mat3 frame_along(const Vec3 &motion) {
    const double size = norm(motion);
    if (size < 1e-9) return {};
    const Vec3 u = (1.0 / size) * motion;
    // Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017: no direction in which it loses digits.
    const double sign = std::copysign(1.0, u.z), p = -1.0 / (sign + u.z), q = u.x * u.y * p;
    return {{u, {1.0 + sign * u.x * u.x * p, sign * q, -sign * u.x}, {q, sign + u.y * u.y * p, -u.y}}};
}

LimitRows speed_rows(const double *J, const double *v, const double *delay, const double *bounds,
                     const std::vector<std::int64_t> &parts, double dt, std::size_t n) {
    LimitRows found(n, 3 * parts.size());
    for (std::size_t part = 0; part < parts.size(); ++part) {
        const double *own = J + parts[part] * n;
        double motion[3] = {0.0, 0.0, 0.0};
        for (int i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < n; ++j) motion[i] += own[i * n + j] * v[j];
        const Mat3 basis = frame_along({motion[0], motion[1], motion[2]});
        for (std::size_t k = 3 * part; k < 3 * part + 3; ++k) {
            const Vec3 &along = basis.rows[k - 3 * part];
            double held = 0.0;
            for (std::size_t j = 0; j < n; ++j) {
                const double g = along.x * own[j] + along.y * own[n + j] + along.z * own[2 * n + j];
                const double late = delay[j] / dt;
                held += g * late * v[j];
                found.G[k * n + j] = g * (1.0 + late);
            }
            found.low[k] = held - bounds[k], found.high[k] = held + bounds[k];
            found.normalise(k, 1e-9);
        }
    }
    return found;
}

LimitRows stop_rows(const NearPairs &near, const double *v, const StopRules &rules, std::size_t n) {
    LimitRows found(n, near.size);
    const double share = std::min(1.0, rules.rate * rules.dt);
    for (std::size_t k = 0; k < near.size; ++k) {
        double held = 0.0, stops = 0.0;
        for (std::size_t j = 0; j < n; ++j) {
            const double g = near.gradient[k * near.columns + j];
            const bool towards = g * v[j] < 0.0;
            const double slope = rules.delay[j] + (towards ? std::fabs(v[j]) * rules.brake[j] : 0.0);
            found.G[k * n + j] = g * (rules.dt + slope);
            held += g * slope * v[j];
            if (towards) stops += g * (v[j] * std::fabs(v[j]) * rules.brake[j]);
        }
        const std::int64_t pair = near.near[k];
        const double d = near.distance[k], b = d - (rules.margin[pair] + rules.lost[k]) + held - 0.5 * stops;
        found.low[k] = held - rules.drift[k] - (d < rules.least[pair] ? std::min(b, 0.0) : share * b);
        found.high[k] = std::numeric_limits<double>::infinity();
        found.normalise(k, 1e-6);
    }
    return found;
}

void raise_least(double *least, const double *asked, std::size_t pairs, const NearPairs &near, double slip) {
    std::vector<double> now(near.size);
    for (std::size_t k = 0; k < near.size; ++k) now[k] = std::max(least[near.near[k]], near.distance[k] - slip);
    std::copy_n(asked, pairs, least);
    for (std::size_t k = 0; k < near.size; ++k) least[near.near[k]] = std::min(now[k], asked[near.near[k]]);
}

bool rows_hold(const double *C, const double *low, const double *high, const double *x, std::size_t m, std::size_t n,
               double slack) {
    for (std::size_t k = 0; k < m; ++k) {
        double y = 0.0;
        for (std::size_t j = 0; j < n; ++j) y += C[k * n + j] * x[j];
        if (!(y >= low[k] - slack && y <= high[k] + slack)) return false;
    }
    return true;
}

}  // namespace optiplan
