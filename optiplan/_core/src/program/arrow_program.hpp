// The quadratic program of one step of a spline: banded in time, with the duration as its border.
#pragma once

#include "program/band_cholesky.hpp"
#include "program/spline.hpp"

namespace optiplan {

// Bounds on derivative control points: |share + a . x| <= 1 + order t, for each row r and joint j with
// a = weight[r, j] times the stencil of r over the control points.
struct DerivativeRows {
    std::vector<Stencil> stencils;  // (R,)
    Vec order;                      // (R,)
    Vec weight, share;              // (R, n)
};

// Rows of one sample and kind, which share a slack s >= 0 of price `price`:  row . z - s <= right.
// `compact`: z (n,) is the configuration at the sample, of which `over` is the basis.
// Otherwise z (REACH n + 1,) are control points from `over.first` on, one after another, and t.
struct Group {
    Stencil over;
    bool compact = true;
    double price = 0.0;
    std::size_t begin = 0, end = 0;  // rows, in `SoftRows`
    std::size_t offset = 0;          // of its first row in `entries`
};

struct SoftRows {
    std::vector<Group> groups;
    Vec entries;  // one row after another, `stride(group)` doubles each
    Vec right;    // (K,)
};

// Minimise  1/2 x' H x + gradient . x + gradient_t t + price . s + regularisation  within box, derivative and soft
// rows. x (M n,): M control points of n joints, one control point after another.
struct ArrowProgram {
    std::size_t points = 0, joints = 0;  // M, n, which must be a multiple of OCTET
    Vec hessian;   // (M, REACH, n): entry (i, d, j) couples joint j of control points i and i + d
    Vec gradient;  // (M n,)
    double gradient_t = 1.0;
    double regularisation = 0.0, regularisation_t = 0.0, regularisation_slack = 0.0;
    Vec low, high;  // (M n,)
    double low_t = -0.5, high_t = 1.0;
    DerivativeRows derivatives;
    SoftRows soft;

    std::size_t size() const { return points * joints; }
    std::size_t width(const Group &group) const { return group.compact ? joints : REACH * joints + 1; }
    std::size_t stride(const Group &group) const { return padded(width(group)); }
};

}  // namespace optiplan
