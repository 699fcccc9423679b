// What the limits of single joints leave of the velocities at the end of a step; see
// optiplan/control/limits/joint_box.py.
#pragma once

#include <cstdint>
#include <vector>

#include "control/braking.hpp"

namespace optiplan {

enum class JointLimit : std::int64_t { acceleration, jerk, velocity, position };

// Rows (n,) each: velocity, acceleration, jerk, lower and upper ends of positions, ends between
// which positions need no look, and velocities below which no acceleration is too much.
struct JointTable {
    std::size_t n;
    const double *velocity, *acceleration, *jerk, *lower, *upper, *safe_lower, *safe_upper, *slow;
};

struct JointBounds {
    std::vector<double> low, high;       // (n,)
    std::vector<double> intervals;       // (k, 2, n), each limit's own
    std::vector<std::int64_t> made;      // (k,), by which limit
    std::vector<double> brake;  // (4, n), q, v, a after dt of the quickest stop; v of the step nearest to it
};

// `order`: limits, the most important first.
JointBounds joint_bounds(const double *q, const double *v, const double *a, const JointTable &table,
                         const std::vector<std::int64_t> &order, const StepRule &step);

}  // namespace optiplan
