// What is known of the distance of two bodies.
#pragma once

#include "../pose.hpp"

namespace optiplan {

constexpr double kDistanceGap = 1e-11;  // m; between the two bounds of a distance, where a search for it ends

struct Witness {
    double distance;  // m; negative: minus the depth of penetration
    Vec3 a, b;        // nearest points, or those that the shortest parting translation brings together
    Vec3 normal;      // unit vector from A to B; b - a = distance * normal
};

inline Witness flipped(const Witness &w) { return {w.distance, w.b, w.a, -w.normal}; }

// From the frame that X is the pose of.
inline Witness moved(const Pose &X, const Witness &w) { return {w.distance, X * w.a, X * w.b, X.R * w.normal}; }

// Where a search for the same shapes at poses not far from these may begin: points of A and of B, each in its own
// frame, whose differences hold the nearest point of A - B; without points, a direction from B to A in the frame of A
// across which they were apart; without that, between the middles.
struct Features {
    int size = 0;
    Vec3 a[3], b[3], direction;
};

}  // namespace optiplan
