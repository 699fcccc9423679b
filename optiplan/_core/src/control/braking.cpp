#include "control/braking.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();

double JointStop::travel(double v, double dt) const {
    double total = 0.0;
    for (int i = 0; i < size; ++i) {
        const double k = phases[i].count, b = phases[i].first, g = phases[i].change;
        total += dt * (k * v + dt * (0.5 * b * k * (k + 1.0) + g * (k - 1.0) * k * (k + 1.0) / 6.0));
        v += dt * (k * b + 0.5 * g * k * (k - 1.0));
    }
    return total;
}

double Brakes::velocity_to_zero(double alpha) const {
    if (change == INF || alpha <= change) return dt * alpha;
    const double m = std::ceil(alpha / change);
    return dt * (m * alpha - 0.5 * change * m * (m - 1.0));
}

double Brakes::acceleration(double u) const {
    if (change == INF) return u / dt;
    const double m =
        std::max(1.0, std::ceil(0.5 * (std::sqrt(1.0 + 8.0 * u / (change * dt)) - 1.0) - 1e-12));
    return (u / dt + 0.5 * change * m * (m - 1.0)) / m;
}

JointStop Brakes::stop(double v, double a) const {
    const double best = -std::copysign(acceleration(std::fabs(v)), v);
    if (best <= a) return falling(v, a);
    JointStop mirrored = falling(-v, -a);
    for (Phase &phase : mirrored.phases) phase.first = -phase.first, phase.change = -phase.change;
    return mirrored;
}

// The stop where the acceleration falls at first.
JointStop Brakes::falling(double v, double a) const {
    JointStop found;
    if (change != INF) {
        const double steps = falling_steps(v, a);
        if (steps > 0.0) {
            found.add({steps, a - change, -change});
            v += dt * (steps * a - 0.5 * change * steps * (steps + 1.0));
        }
    }
    const double hold = velocity_to_zero(limit);
    if (v >= hold) {
        const double steps = std::trunc((v - hold) / (limit * dt)) + 1.0;
        found.add({steps, -limit, 0.0});
        v -= steps * limit * dt;
    }
    const double size = acceleration(std::fabs(v));
    if (size > 0.0) {
        const double steps = change == INF ? 1.0 : std::max(1.0, std::ceil(size / change - 1e-12));
        const double sign = -std::copysign(1.0, v);
        found.add({steps, sign * size, steps == 1.0 ? 0.0 : -sign * change});
    }
    return found;
}

// How many whole changes the acceleration falls before the limit, or before it has to run back to zero.
double Brakes::falling_steps(double v, double a) const {
    // Whether k steps are too many: the velocity would be below zero once the acceleration is back at zero.
    const auto runs_out = [&](double k) {
        const double last = a - k * change;
        const double after = v + dt * (k * a - 0.5 * change * k * (k + 1.0));
        const double back = velocity_to_zero(std::fabs(last)) - dt * std::fabs(last);
        return after + std::copysign(back, last) < 0.0;
    };
    const double jerk = change / dt;
    const double most = std::max(0.0, std::trunc((a + limit) / change + 1e-12));
    double k = std::trunc(std::max(0.0, a + std::sqrt(std::max(0.0, 0.5 * a * a + v * jerk))) / change);
    k = std::min(k, most);
    while (k < most && !runs_out(k + 1.0)) k += 1.0;
    while (k > 0.0 && runs_out(k)) k -= 1.0;
    return k;
}

// Travel until the velocity of a stop changes its sign for the first time.
static double forward(const JointStop &stop, double v, double dt) {
    double best = 0.0, total = 0.0;
    for (int p = 0; p < stop.size; ++p) {
        const Phase &phase = stop.phases[p];
        for (double i = 0.0; i < phase.count; i += 1.0) {
            v += dt * (phase.first + i * phase.change);
            if (v <= 0.0) return best;
            total += dt * v;
            best = std::max(best, total);
        }
    }
    return best;
}

double Brakes::farthest(double v, double a) const {
    if (v == 0.0 && std::fabs(a) <= change) return 0.0;
    const JointStop found = stop(v, a);
    const double total = found.travel(v, dt);
    if (v > 0.0 && found.size > 0 && found.phases[0].change > 0.0)  // over-braked: forward first, then back
        return std::max({0.0, total, forward(found, v, dt)});
    return std::max(0.0, total);
}

double Brakes::farthest(double v, double a, const JointStop &stop) const {
    if (v == 0.0 && std::fabs(a) <= change) return 0.0;
    const double total = std::fabs(stop.travel(v, dt));
    if (!(stop.size > 0 && v * stop.phases[0].change > 0.0)) return total;
    if (v > 0.0) return std::max(total, forward(stop, v, dt));
    JointStop mirrored = stop;
    for (Phase &phase : mirrored.phases) phase.first = -phase.first, phase.change = -phase.change;
    return std::max(total, forward(mirrored, -v, dt));
}

double Brakes::fastest(double room, double v, double low, double high) const {
    if (limit == INF) return std::min(std::max(room / dt, low), high);
    const auto left = [&](double x) { return room + POSITION_ROUNDING - dt * x - farthest(x, (x - v) / dt); };
    double over = left(high);
    if (over >= 0.0) return high;
    double under = left(low);
    if (under < 0.0) return low;
    int side = 0;  // by false position (Illinois), whose lower end always has the property
    for (int round = 0; round < 60; ++round) {
        if (under <= POSITION_ROUNDING || high - low <= 1e-12) break;
        const double x = (low * over - high * under) / (over - under);
        const double found = left(x);
        if (found >= 0.0) {
            low = x, under = found;
            if (side == 1) over *= 0.5;
            side = 1;
        } else {
            high = x, over = found;
            if (side == -1) under *= 0.5;
            side = -1;
        }
    }
    return low;
}

}  // namespace optiplan
