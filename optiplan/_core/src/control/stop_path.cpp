#include "control/stop_path.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

void StopPath::start(const double *q_now, const double *v_now, const double *a, const double *limit, const double *jerk,
                     std::size_t n, double step) {
    q.assign(q_now, q_now + n), v.assign(v_now, v_now + n);
    dt = step;
    stops.resize(n), end.resize(n), way.resize(n);
    double most = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
        const Brakes brakes{limit[j], jerk[j]};
        stops[j] = brakes.stop(v[j], a[j]);
        end[j] = q[j] + stops[j].travel(v[j]);
        way[j] = brakes.farthest(v[j], a[j], stops[j]);
        most = std::max(most, stops[j].lasting());
    }
    steps = static_cast<int>(std::min(std::ceil(most / dt), 1e9));
}

void StopPath::at(int step, double *q_out, double *v_out) const {
    for (std::size_t j = 0; j < q.size(); ++j) {
        double x = q[j], speed = v[j], a = 0.0;
        if (step > 0) stops[j].after(step * dt, x, speed, a);
        q_out[j] = x;
        if (v_out) v_out[j] = speed;
    }
}

double Drift::at(double t) const {
    double found = 0.0;
    t = std::min(t, until);
    for (std::size_t k = coefficients.size(); k-- > 0;) found = found * t + coefficients[k];
    return found;
}

double Drift::way(double t) const {
    double found = 0.0, power = t = std::min(t, until);
    for (std::size_t k = 1; k < coefficients.size(); ++k, power *= t) found += k * std::fabs(coefficients[k]) * power;
    return found;
}

double Drift::strongest(double begin, double end) const {
    const double t = std::min(end, until);
    double bend = 0.0, speed = 0.0, power = 1.0, before = 0.0;  // t^(k - 1), and the power before it
    for (std::size_t k = 1; k < coefficients.size(); ++k) {
        const double size = k * std::fabs(coefficients[k]);
        speed += size * power;
        bend += (k - 1) * size * before;
        before = power, power *= t;
    }
    return begin < until && until < end ? bend + 2.0 * speed / (end - begin) : bend;
}

void StopPath::carry(std::vector<Drift> joints, double horizon) {
    drifts = std::move(joints);
    steps = std::max(steps, static_cast<int>(std::ceil(horizon / dt)));
    end.resize(q.size()), way.resize(q.size());
    for (const Drift &drift : drifts) {
        end.push_back(drift.at(steps * dt));
        way.push_back(drift.way(steps * dt));
    }
}

void StopPath::whole(int step, double *out) const {
    at(step, out);
    for (std::size_t k = 0; k < drifts.size(); ++k) out[q.size() + k] = drifts[k].at(step * dt);
}

double StopPath::strongest(std::size_t j, int first, int last) const {
    if (j >= q.size()) return drifts[j - q.size()].strongest(first * dt, last * dt);
    double most = 0.0, before = 0.0;
    for (int p = 0; p < stops[j].size; ++p) {
        const Phase &phase = stops[j].phases[p];
        const double begin = std::max(first * dt - before, 0.0), stop = std::min(last * dt - before, phase.lasting);
        if (begin < stop)
            most = std::max(
                {most, std::fabs(phase.first + begin * phase.jerk), std::fabs(phase.first + stop * phase.jerk)});
        before += phase.lasting;
    }
    return most;
}

}  // namespace optiplan
