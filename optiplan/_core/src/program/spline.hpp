// The curve that is optimised: a clamped B-spline in u = t / T, its samples, and the bounds on its derivatives.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "program/sums.hpp"

namespace optiplan {

// Neighbouring control points that one sample of the curve depends on: degree of the spline + 1.
inline constexpr std::size_t REACH = 5;

// A row of a basis matrix: `weights` of the control points `first`, `first` + 1, …
struct Stencil {
    std::size_t first = 0, count = 0;
    std::array<double, REACH> weights{};
};

// Weights of a stencil over the free control points alone; `first` counts from the first free one. With an open end the
// last `fixed` control points, which are equal there, count as one more free one.
Stencil free_part(const Stencil &stencil, std::size_t fixed, std::size_t free, bool open_end = false);

// Row r of a dense matrix, whose entries away from zero are at most REACH neighbours.
Stencil stencil_of(const double *row, std::size_t count);

// What depends on the spline and the robot's limits alone.
struct Spline {
    std::size_t points = 0, joints = 0,
                fixed = 0;  // K control points of n joints, of which `fixed` are held at each end
    std::vector<Stencil> derivatives;               // (R,) control points of the first three derivatives by u
    std::vector<int> order;                         // (R,) 1 to 3
    Vec rates;                                      // (3, n) limits of velocity, acceleration, jerk
    Vec gram;                                       // (K, K) of the third derivative
    Vec lower, upper;                               // (n,) of the joints
    double time = 1.0, jerk = 0.0;                  // the objective: time T + jerk (integral of squared jerk)

    bool open_end = false;                          // whether the end is free: the last `fixed` points move as one

    std::size_t free() const { return points - 2 * fixed + (open_end ? 1 : 0); }

    // The control points that variable i moves: the first of them, and how many.
    std::size_t count(std::size_t i) const { return open_end && i + 1 == free() ? fixed : 1; }
    const double *limit(std::size_t row) const { return rates.data() + (order[row] - 1) * joints; }

    // D C of row r: (n,)
    void derivative(std::size_t row, const double *control, double *out) const;

    // The least T at which all derivative control points respect their limits.
    double shortest_duration(const double *control) const;

    // w T^-5 C' H C.
    double jerk_cost(const double *control, double duration) const;
};

}  // namespace optiplan
