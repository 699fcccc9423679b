// Exact extrema of polynomials on [0, 1].
#pragma once

#include <cstddef>

namespace optiplan {

constexpr int MOST_UNIT_COEFFICIENTS = 16;

// Of one column of polynomials: the least and the largest value, where on [0, 1], and in which piece.
struct UnitExtrema {
    double low, high, x_low = 0.0, x_high = 0.0;
    std::size_t piece_low = 0, piece_high = 0;
};

// Extrema on [0, 1] of `pieces` polynomials sum_k c[k] x^k of `size` coefficients each, `stride` apart. Those whose
// Bernstein coefficients lie within the end values of the others are not looked at: they hold none. Operations are in
// the order of `trajectory.polynomial`, so that the values are the same. Infinite where no number is found.
UnitExtrema unit_extrema(const double *c, std::size_t pieces, std::size_t stride, int size);

}  // namespace optiplan
