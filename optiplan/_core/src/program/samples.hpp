// Instants of the curve at which contacts and torques are looked at.
#pragma once

#include "program/spline.hpp"

namespace optiplan {

struct Samples {
    Vec u;                            // (N,) rising, shares of the duration
    std::vector<std::size_t> first;   // (N,) first control point that a sample depends on
    std::vector<std::array<std::array<double, REACH>, 3>> weights;  // its basis: position, and derivatives by u

    // From basis matrices (N, K) of the orders 0, 1 and 2.
    static Samples of(const double *u, std::size_t count, const double *const matrices[3], std::size_t points);

    std::size_t count() const { return u.size(); }

    Stencil stencil(std::size_t sample, int order, std::size_t points) const;

    // The `order`-th derivative by u at a sample: (n,)
    void at(std::size_t sample, int order, const double *control, const Spline &spline, double *out) const;
};

}  // namespace optiplan
