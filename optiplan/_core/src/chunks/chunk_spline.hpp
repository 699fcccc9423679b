// The motion through a chunk of set-points: a cubic spline with continuous acceleration, then the stop of every joint.
#pragma once

#include <vector>

#include "program/spline.hpp"
#include "world/sweep.hpp"

namespace optiplan {

// Positions, velocities and accelerations of n joints at one instant.
struct JointState {
    Vec q, v, a;
};

// Of all joints (n,); infinite where there is none.
struct JointLimits {
    Vec lower, upper, rates[3];  // rates: velocity, acceleration, jerk
};

// Clamped cubic B-spline on the knots 0, times[0] / 2, times[0], times[1], …: the knot in the middle of the first
// interval lets it begin with any velocity and acceleration. It ends without acceleration; one that `rests` has another
// knot in the middle of the last interval, and ends without velocity, too.
class ChunkSpline {
  public:
    // `times` (k,) > 0, rising.
    ChunkSpline(const Vec &times, bool rests);

    std::size_t points() const { return knots_.size() + 2; }  // of control
    bool rests() const { return rests_; }
    const Vec &knots() const { return knots_; }               // (m + 1,)
    std::size_t knot_of(std::size_t set_point) const;         // at which it is reached

    // Control points (points, n) of the spline from `start` through Q (k, n).
    Vec through(const JointState &start, const double *Q) const;

    // Weights of the control points that give the spline at a time, and its derivatives: rows r of order 1 to 3 are
    // the control points of that derivative, r = 0, 1, …
    Stencil at(double time) const;
    Stencil derivative(int order, std::size_t row) const;

    // The same in pieces of polynomials.
    Curve curve(const Vec &control, std::size_t n) const;

  private:
    double knot(std::size_t i) const;  // of the clamped vector: the first and the last knot four times

    Vec knots_;
    bool rests_;
};

// Where a curve ends.
JointState end_of(const Curve &curve);

// Lets every joint stop as fast as its limits of acceleration and jerk allow after the end of a curve.
void append_stop(Curve &curve, const JointLimits &limits);

// The same from a state, with a `share` of the limits: a curve without pieces before it.
Curve stop_from(const JointState &state, const JointLimits &limits, double share = 1.0);

}  // namespace optiplan
