// Proof that a motion keeps the limits of its joints at all times, by Bernstein coefficients.
#pragma once

#include <vector>

#include "world/sweep.hpp"

namespace optiplan {

constexpr double ROUNDED = 1e-7;  // share of a limit

// Of all joints (n,), tolerances of the verifier included; infinite where there is none.
struct RateLimits {
    std::vector<double> lower, upper, rates[3];  // rates: velocity, acceleration, jerk
    std::vector<double> steps[3];                // sums of steps of position, velocity, acceleration at breakpoints
};

// What is beyond its limit first. order: 0 position to 3 jerk; 4 to 6: steps of position, velocity or acceleration; 7
// to 9: the same off where the motion is to begin; 10 and 11: velocity and acceleration at its end; 12: large terms
// cancel, so that rounding may pass `ROUNDED` of a limit. -1: nothing is.
struct Beyond {
    int order = -1, joint = 0;
    double time = 0.0, value = 0.0, limit = 0.0;
};

// low <= p^(order) <= high on every piece. A polynomial lies between the least and the largest of
// its Bernstein coefficients; where that is not enough it is halved by de Casteljau's algorithm.
Beyond beyond_limits(const Curve &curve, const RateLimits &limits);

// It begins in `state` (3, n), position, velocity and acceleration, and ends at rest, both within `steps`.
Beyond beyond_ends(const Curve &curve, const RateLimits &limits, const double *state);

// Least and largest values of a polynomial in Bernstein form on [0, 1] are within [low, high].
bool stays_between(const double *bernstein, int size, double low, double high, int halvings = 40);

}  // namespace optiplan
