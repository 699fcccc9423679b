#include "control/braking.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();

double JointStop::travel(double v) const {
    double total = 0.0;
    for (int i = 0; i < size; ++i) {
        const double t = phases[i].lasting, first = phases[i].first, jerk = phases[i].jerk;
        total += t * (v + t * (0.5 * first + t * (jerk / 6.0)));
        v += t * (first + 0.5 * jerk * t);
    }
    return total;
}

void JointStop::after(double left, double &q, double &v, double &a) const {
    for (int i = 0; i < size; ++i) {
        const double first = phases[i].first, jerk = phases[i].jerk, t = std::min(left, phases[i].lasting);
        q += t * (v + t * (0.5 * first + t * (jerk / 6.0)));
        v += t * (first + 0.5 * jerk * t);
        if (left < phases[i].lasting) {
            a = first + jerk * t;
            return;
        }
        left -= phases[i].lasting;
    }
    v = a = 0.0;  // what is left of a velocity is rounding
}

double Brakes::acceleration(double u, double dt) const { return 2.0 * u / (dt + std::sqrt(dt * dt + 2.0 * u / jerk)); }

double Brakes::clamped(double a) const { return std::min(std::max(a, -limit), limit); }

JointStop Brakes::stop(double v, double a) const {
    JointStop found;
    if (jerk == INF) {
        if (limit != INF && v != 0.0) found.add({std::fabs(v) / limit, -std::copysign(limit, v), 0.0});
        return found;
    }
    a = clamped(a);
    if (v + 0.5 * a * std::fabs(a) / jerk >= 0.0) return falling(v, a);
    found = falling(-v, -a);
    for (Phase &phase : found.phases) phase.first = -phase.first, phase.jerk = -phase.jerk;
    return found;
}

// The stop where the acceleration falls at first.
JointStop Brakes::falling(double v, double a) const {
    JointStop found;
    const double square = std::max(0.0, jerk * v + 0.5 * a * a), size = std::sqrt(square);
    if (size > limit) {
        found.add({(a + limit) / jerk, a, -jerk});
        found.add({(square - limit * limit) / (jerk * limit), -limit, 0.0});
        found.add({limit / jerk, -limit, jerk});
    } else {
        found.add({std::max(0.0, (a + size) / jerk), a, -jerk});
        found.add({size / jerk, -size, jerk});
    }
    return found;
}

// How far a joint gets from v > 0 that brakes so hard, with a < 0, that its velocity changes its sign.
static double turn(double v, double a, double jerk) {
    const double t = 2.0 * v / (std::sqrt(std::max(0.0, a * a - 2.0 * jerk * v)) - a);
    return t * (v + t * (0.5 * a + t * (jerk / 6.0)));
}

double Brakes::farthest(double v, double a) const {
    if (jerk < INF && v > 0.0) {
        a = clamped(a);
        if (v + 0.5 * a * std::fabs(a) / jerk < 0.0) return turn(v, a, jerk);
    }
    return std::max(0.0, stop(v, a).travel(v));
}

double Brakes::farthest(double v, double a, const JointStop &stop) const {
    const double total = std::fabs(stop.travel(v));
    a = clamped(a);
    if (jerk == INF || v == 0.0 || v * (v + 0.5 * a * std::fabs(a) / jerk) >= 0.0) return total;
    return std::max(total, turn(std::fabs(v), -std::fabs(a), jerk));
}

double fastest(const Brakes &brakes, const StepRule &step, double room, double v, double low, double high) {
    if (brakes.limit == INF && brakes.jerk == INF)  // stops at once
        return std::min(std::max(room / (step.moves + step.lag), low), high);
    if (high == INF) high = std::max(room, 0.0) / step.moves;  // a step alone takes all of the room
    if (low == -INF) low = std::min({v, 0.0, high});           // none of it
    const double slow = brakes.limit < INF ? brakes.limit * (0.5 * brakes.limit / brakes.jerk + 2.0 * step.lag) : INF;
    const auto left = [&](double x) {
        const double a = (x - v) / step.dt;
        const double top = std::min(std::max(x + (a > 0.0 ? 0.5 * a * a / brakes.jerk : 0.0), 0.0), slow);
        return room + POSITION_ROUNDING - step.moves * x - (step.lag > 0.0 ? step.lag * top : 0.0) -
               brakes.farthest(x, a);
    };
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
