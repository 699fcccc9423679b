// A curve of five control points of two joints: one polynomial of degree four, in the form of Bernstein.
#pragma once

#include <cmath>

#include "program/samples.hpp"

namespace optiplan {

inline Spline bezier() {
    Spline spline;
    spline.points = 5, spline.joints = 2, spline.fixed = 1;
    double rows[5][5] = {}, factor = 4.0;
    for (int k = 0; k < 5; ++k) rows[k][k] = 1.0;
    for (int order = 1, count = 4; order <= 3; ++order, --count, factor = count) {
        for (int i = 0; i < count; ++i)
            for (int k = 0; k < 5; ++k) rows[i][k] = factor * (rows[i + 1][k] - rows[i][k]);
        for (int i = 0; i < count; ++i)
            spline.derivatives.push_back(stencil_of(rows[i], 5)), spline.order.push_back(order);
    }
    spline.rates = {1.0, 2.0, 4.0, 5.0, 50.0, 60.0};
    spline.gram.assign(25, 0.0);
    spline.lower = {-3.0, -3.0}, spline.upper = {3.0, 3.0};
    return spline;
}

inline double bernstein(int k, int degree, double u) {
    if (k < 0 || k > degree) return 0.0;
    const double choose = std::round(std::tgamma(degree + 1) / (std::tgamma(k + 1) * std::tgamma(degree - k + 1)));
    return choose * std::pow(u, k) * std::pow(1.0 - u, degree - k);
}

inline Samples bezier_samples(const Vec &u) {
    Vec basis[3] = {Vec(5 * u.size()), Vec(5 * u.size()), Vec(5 * u.size())};
    for (std::size_t i = 0; i < u.size(); ++i)
        for (int k = 0; k < 5; ++k) {
            const auto b = [&](int from, int degree) { return bernstein(k - from, degree, u[i]); };
            basis[0][5 * i + k] = b(0, 4);
            basis[1][5 * i + k] = 4.0 * (b(1, 3) - b(0, 3));
            basis[2][5 * i + k] = 12.0 * (b(2, 2) - 2.0 * b(1, 2) + b(0, 2));
        }
    const double *const matrices[3] = {basis[0].data(), basis[1].data(), basis[2].data()};
    return Samples::of(u.data(), u.size(), matrices, 5);
}

// Control points (5, 2) of a motion that is not straight.
inline Vec control() { return {0.0, 0.0, 0.1, -0.1, 0.4, 0.3, 0.7, 0.2, 0.8, 0.5}; }

}  // namespace optiplan
