#include "control/stop_path.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

void StopPath::start(const double *q_now, const double *v_now, const double *a, const double *limit,
                     const double *change, std::size_t n, double step, bool mean) {
    q.assign(q_now, q_now + n), v.assign(v_now, v_now + n);
    dt = step, trapezoid = mean;
    stops.resize(n), end.resize(n), way.resize(n);
    double most = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
        const Brakes brakes{limit[j], change[j], dt};
        stops[j] = brakes.stop(v[j], a[j]);
        end[j] = q[j] + stops[j].travel(v[j], dt);
        if (trapezoid) end[j] += 0.5 * dt * v[j];
        way[j] = brakes.farthest(v[j], a[j], stops[j]);
        // The mean velocities lag by half a step of what the velocity changes: by v at most, and what a adds to it.
        if (trapezoid) way[j] += dt * (std::fabs(v[j]) + dt * a[j] * a[j] / change[j]);
        most = std::max(most, stops[j].steps());
    }
    steps = static_cast<int>(std::min(most, 1e9));
}

// Of each phase k steps are done, with which the sums of `JointStop::travel` hold.
void StopPath::at(int step, double *q_out, double *v_out) const {
    for (std::size_t j = 0; j < q.size(); ++j) {
        double way = 0.0, sum = 0.0, before = 0.0;
        for (int p = 0; p < stops[j].size; ++p) {
            const Phase &phase = stops[j].phases[p];
            const double k = std::min(std::max(step - before, 0.0), phase.count);
            const double gained = k * phase.first + 0.5 * phase.change * k * (k - 1.0);
            sum += gained;
            way += k * (v[j] + dt * (sum - gained)) +
                   dt * (0.5 * phase.first * k * (k + 1.0) + phase.change * (k - 1.0) * k * (k + 1.0) / 6.0);
            before += phase.count;
        }
        q_out[j] = q[j] + dt * way;
        if (trapezoid) q_out[j] -= 0.5 * dt * (dt * sum);
        if (v_out) v_out[j] = v[j] + dt * sum;
    }
}

double StopPath::strongest(std::size_t j, int first, int last) const {
    double most = 0.0, before = 0.0;
    for (int p = 0; p < stops[j].size; ++p) {
        const Phase &phase = stops[j].phases[p];
        const double begin = std::max(first - before, 0.0), stop = std::min(last - before, phase.count);
        if (begin < stop)
            most = std::max({most, std::fabs(phase.first + begin * phase.change),
                             std::fabs(phase.first + (stop - 1.0) * phase.change)});
        before += phase.count;
    }
    return most;
}

}  // namespace optiplan
