#include "control/joint_box.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "control/braking.hpp"

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();

namespace {

struct Interval {
    double low = -INF, high = INF;
};

// Largest velocity in [low, high] from which a joint halts within `room` ahead; from beyond the end, the way back.
double before_end(const Brakes &brakes, const StepRule &step, double room, double v, double low, double high) {
    if (room < -POSITION_ROUNDING) return -fastest(brakes, step, -room, -v, -high, -low);
    return fastest(brakes, step, room, v, low, high);
}

Interval interval_of(JointLimit limit, const JointTable &t, std::size_t j, double q, double v, double a,
                     const StepRule &step, const Interval &box) {
    const Brakes brakes{t.acceleration[j], t.jerk[j]};
    const double dt = step.dt;
    switch (limit) {
    case JointLimit::acceleration:
        return {v - t.acceleration[j] * dt, v + t.acceleration[j] * dt};
    case JointLimit::jerk:
        return {v + dt * a - dt * (dt * t.jerk[j]), v + dt * a + dt * (dt * t.jerk[j])};
    case JointLimit::velocity: {
        if (t.velocity[j] == INF) return {};
        const double up = t.velocity[j] - v, down = t.velocity[j] + v;
        return {v - std::copysign(dt * brakes.acceleration(std::fabs(down), dt), down),
                v + std::copysign(dt * brakes.acceleration(std::fabs(up), dt), up)};
    }
    case JointLimit::position:
        break;
    }
    Interval found;
    const double shifted = (dt - step.moves) * v;
    if (q > t.safe_upper[j]) found.high = before_end(brakes, step, t.upper[j] - q - shifted, v, box.low, box.high);
    if (q < t.safe_lower[j]) found.low = -before_end(brakes, step, q - t.lower[j] + shifted, -v, -box.high, -box.low);
    return found;
}

bool counts(JointLimit limit, const JointTable &t, const double *q, const double *v) {
    for (std::size_t j = 0; j < t.n; ++j) {
        if (limit == JointLimit::velocity && std::fabs(v[j]) > t.slow[j]) return true;
        if (limit == JointLimit::position && (q[j] < t.safe_lower[j] || q[j] > t.safe_upper[j])) return true;
    }
    return limit == JointLimit::acceleration || limit == JointLimit::jerk;
}

double clamped(double x, double low, double high) { return std::min(std::max(x, low), high); }

}  // namespace

JointBounds joint_bounds(const double *q, const double *v, const double *a, const JointTable &t,
                         const std::vector<std::int64_t> &order, const StepRule &step) {
    const std::size_t n = t.n;
    JointBounds found;
    found.low.assign(n, -INF), found.high.assign(n, INF), found.brake.resize(4 * n);
    for (std::int64_t code : order) {
        const auto limit = static_cast<JointLimit>(code);
        if (!counts(limit, t, q, v)) continue;
        const std::size_t first = found.intervals.size();
        found.intervals.resize(first + 2 * n);
        found.made.push_back(code);
        for (std::size_t j = 0; j < n; ++j) {
            const Interval box{found.low[j], found.high[j]};
            const Interval own = interval_of(limit, t, j, q[j], v[j], a[j], step, box);
            found.intervals[first + j] = own.low, found.intervals[first + n + j] = own.high;
            found.low[j] = clamped(own.low, box.low, box.high), found.high[j] = clamped(own.high, box.low, box.high);
        }
    }
    for (std::size_t j = 0; j < n; ++j) {
        double x = q[j], speed = v[j], acceleration = a[j];
        const Brakes brakes{t.acceleration[j], t.jerk[j]};
        brakes.stop(speed, acceleration).after(step.dt, x, speed, acceleration);
        found.brake[j] = x, found.brake[n + j] = speed, found.brake[2 * n + j] = acceleration;
        const double most = t.acceleration[j], change = step.dt * t.jerk[j];
        const double wanted = -std::copysign(brakes.acceleration(std::fabs(v[j]), step.dt), v[j]);
        // An acceleration beyond its limits comes back to them at once: jerk is given up first.
        const double low = std::min(std::max(a[j] - change, -most), most);
        const double high = std::max(std::min(a[j] + change, most), -most);
        found.brake[3 * n + j] = v[j] + step.dt * clamped(wanted, low, high);
    }
    return found;
}

}  // namespace optiplan
