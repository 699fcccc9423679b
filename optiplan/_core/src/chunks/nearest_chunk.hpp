// The nearest chunk that keeps the limits and a distance from everything: sequential quadratic programs.
#pragma once

#include "chunks/chunk_spline.hpp"
#include "program/arrow_qp.hpp"

namespace optiplan {

// A pair near each other at a time of a curve; `gradient` (n,) of its distance in the joints, m/rad.
struct NearPlace {
    double time, distance;
    Vec gradient;
    int pair = -1;
};

// Pairs nearer than `window`, m, in the middles of parts of a curve of `width` s at most, with obstacles where `at` has
// them.
std::vector<NearPlace> near_places(const World &world, Placement &at, const Curve &curve, double window, double width);

// Minimise the sum of |x_i - Q_i|^2 over set-points x_i (k, n) of which the spline keeps the limits of its joints, and
// keeps `distance` from everything to first order. Each step solves one quadratic program with the distances linearised
// about the spline of the step before.
class NearestChunk {
  public:
    // `radius`, rad or m: no control point changes by more.
    NearestChunk(const ChunkSpline &spline, const JointState &start, const double *Q, const JointLimits &limits,
                 double radius);

    // Of the present control points, with the stop.
    Curve curve() const;

    // False where the program has no solution within the limits, or none near enough to the distance.
    bool step(const std::vector<NearPlace> &near, double distance);

    Vec set_points() const;  // (k, n)

  private:
    Stencil free_part_of(const Stencil &stencil) const;
    std::size_t variables() const;
    void base();
    void add_row(const NearPlace &place, double distance);
    void add_stop_rows(double distance);

    ChunkSpline spline_;
    JointLimits limits_;
    double radius_;
    std::size_t n_, count_;
    Vec first_, control_;  // of the chunk as it is, and of the last step
    ArrowProgram program_;
    ArrowQp qp_;
};

}  // namespace optiplan
