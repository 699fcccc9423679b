// The configurations that a robot passes if all its joints brake, each as quickly as its limits let it.
#pragma once

#include <vector>

#include "control/braking.hpp"

namespace optiplan {

// A joint that goes its own way: its position is a polynomial of time, coefficients in ascending powers, up to `until`.
struct Drift {
    std::vector<double> coefficients;
    double until;

    double at(double t) const;
    double way(double t) const;                           // at most, until t
    double strongest(double begin, double end) const;     // acceleration at most; a sudden stop counts as it strays
};

struct StopPath {
    std::vector<double> q, v;       // (n,), at the end of the present step
    std::vector<JointStop> stops;   // (n,)
    double dt = 0.0;                // s, at whose multiples the stop is looked at
    std::vector<double> end;        // (n,), where it stands
    std::vector<double> way;        // (n,), how far each joint gets from q at most, rad or m
    int steps = 0;                  // until the last joint stands
    std::vector<Drift> drifts;      // of joints behind the robot's, which do not brake

    std::size_t size() const { return q.size() + drifts.size(); }

    // Takes joints along that do not brake, for `horizon` s at least; `end` and `way` then have theirs, too.
    void carry(std::vector<Drift> joints, double horizon);

    // Configuration (size,) after so many steps.
    void whole(int step, double *out) const;

    // A stop from q, v, a (n,) with limits (n,) of acceleration and jerk.
    void start(const double *q, const double *v, const double *a, const double *limit, const double *jerk,
               std::size_t n, double dt);

    // Configuration (n,) after so many steps, and velocities (n,) unless null.
    void at(int step, double *q_out, double *v_out = nullptr) const;

    // The largest acceleration of joint j, of all, in the steps first + 1 … last, without its sign.
    double strongest(std::size_t j, int first, int last) const;
};

}  // namespace optiplan
