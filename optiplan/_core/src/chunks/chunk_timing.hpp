// Times of the set-points of a chunk that has none, near the fastest that the joints' limits admit.
#pragma once

#include "chunks/chunk_spline.hpp"

namespace optiplan {

// Rising times (k,) > 0 at which the spline from `start` through Q (k, n) to rest keeps velocity, acceleration and
// jerk. The first guess are the fastest speeds along the path without limits of jerk. Then every interval is made
// longer or shorter by what the spline asks of the joints there, again and again; the fastest times within the limits
// are kept. Of a robot in motion slower speeds are tried, too; where all fail, the times are those that pass the limits
// least. Empty where numbers are not finite.
Vec chunk_times(const JointState &start, const double *Q, std::size_t k, const JointLimits &limits);

}  // namespace optiplan
