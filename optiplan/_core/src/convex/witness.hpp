// What is known of the distance of two bodies.
#pragma once

#include "../pose.hpp"

namespace optiplan {

struct Witness {
    double distance;  // m; negative: minus the depth of penetration
    Vec3 a, b;        // nearest points, or those that the shortest parting translation brings together
    Vec3 normal;      // unit vector from A to B; b - a = distance * normal
};

inline Witness flipped(const Witness &w) { return {w.distance, w.b, w.a, -w.normal}; }

// From the frame that X is the pose of.
inline Witness moved(const Pose &X, const Witness &w) { return {w.distance, X * w.a, X * w.b, X.R * w.normal}; }

}  // namespace optiplan
