// What the limits of single joints leave of the velocities at the end of a step; see optiplan/control/limits/joint_box.py.
#pragma once

#include <cstdint>
#include <vector>

namespace optiplan {

enum class JointLimit : std::int64_t { acceleration, jerk, velocity, position };

// Rows (n,) each: velocity, acceleration, change of it from step to step, lower and upper ends of positions, ends between
// which positions need no look, and velocities below which no acceleration is too much.
struct JointTable {
    std::size_t n;
    const double *velocity, *acceleration, *change, *lower, *upper, *safe_lower, *safe_upper, *slow;
};

struct JointBounds {
    std::vector<double> low, high;       // (n,)
    std::vector<double> intervals;       // (k, 2, n), each limit's own
    std::vector<std::int64_t> made;      // (k,), by which limit
    std::vector<double> brake;           // (n,), velocities of the quickest stop
};

// `order`: limits, the most important first; `shift` v is what q moves on before the new velocity counts, s.
JointBounds joint_bounds(const double *q, const double *v, const double *a, const JointTable &table,
                         const std::vector<std::int64_t> &order, double dt, double shift);

// Singular values of J (rows, columns), rows <= columns, falling: roots of the eigenvalues of J J', by Jacobi's method.
std::vector<double> singular_values(const double *J, std::size_t rows, std::size_t columns);

}  // namespace optiplan
