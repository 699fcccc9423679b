// Distance, nearest points and penetration of two shapes.
#pragma once

#include <limits>

#include "shape.hpp"
#include "witness.hpp"

namespace optiplan {

// Signed distance of two shapes at poses X_WA and X_WB.
//
// Where it exceeds `cutoff` (m) the search may stop early: `distance` is then a lower bound above the cutoff, and
// points and normal are not set. Exact to rounding for spheres, capsules, boxes, hulls, triangles and half-spaces, to
// 1e-9 m for cylinders, whose searches end where the distance is known to `gap`, which may be wider. Meshes are
// surfaces: 0 where a triangle meets the other shape. Nothing is remembered from call to call, but in `features`: those
// of the same shapes at poses not far from these make the search shorter, and are replaced by the present ones. Answers
// then differ by rounding, and by which points are told where several pairs are equally near.
Witness distance(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &X_WB,
                 double cutoff = std::numeric_limits<double>::infinity(), Features *features = nullptr,
                 double gap = kDistanceGap);

// Whether two shapes are nearer than `margin` (m, >= 0), or touch.
bool overlap_within(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &X_WB, double margin,
                    Features *features = nullptr);

}  // namespace optiplan
