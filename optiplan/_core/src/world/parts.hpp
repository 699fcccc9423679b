// Convex parts of bodies.
#pragma once

#include <vector>

#include "convex/convex.hpp"

namespace optiplan {

// A convex shape in the frame of its body, in a ball.
struct ConvexPart {
    Shape shape;
    Vec3 centre;
    double radius;

    static ConvexPart hull(const Shape &hull);
};

// Whether two parts are nearer than `margin` (m, >= 0), or touch; also where one body has none, of which they tell
// nothing.
bool parts_within(const std::vector<ConvexPart> &a, const Pose &X_WA, const std::vector<ConvexPart> &b,
                  const Pose &X_WB, double margin);

}  // namespace optiplan
