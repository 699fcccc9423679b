// The configurations that a robot passes if all its joints brake, each as quickly as its limits let it.
#pragma once

#include <vector>

#include "control/braking.hpp"

namespace optiplan {

struct StopPath {
    std::vector<double> q, v;       // (n,), at the end of the present step
    std::vector<JointStop> stops;   // (n,)
    double dt = 0.0;                // s, at whose multiples the stop is looked at
    std::vector<double> end;        // (n,), where it stands
    std::vector<double> way;        // (n,), how far each joint gets from q at most, rad or m
    int steps = 0;                  // until the last joint stands

    // A stop from q, v, a (n,) with limits (n,) of acceleration and jerk.
    void start(const double *q, const double *v, const double *a, const double *limit, const double *jerk,
               std::size_t n, double dt);

    // Configuration (n,) after so many steps, and velocities (n,) unless null.
    void at(int step, double *q_out, double *v_out = nullptr) const;

    // The largest acceleration of joint j in the steps first + 1 … last, without its sign.
    double strongest(std::size_t j, int first, int last) const;
};

}  // namespace optiplan
