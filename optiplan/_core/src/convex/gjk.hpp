// Distance of two convex cores by the algorithm of Gilbert, Johnson and Keerthi.
//
// "A fast procedure for computing the distance between complex objects in three-dimensional space", IEEE Journal on
// Robotics and Automation 4 (2), 1988. The distance is known from both sides at every step: |v| for the nearest point v
// of a simplex in A - B from above, v . w / |v| for the support point w against v from below.
#pragma once

#include "simplex.hpp"
#include "witness.hpp"

namespace optiplan {

constexpr double kTouching = 1e-7;  // m; nearer than this the points tell no normal: penetration is asked for
constexpr double kNormalGap = 1e-8;  // m; the latest direction is taken unless another one proves this much more
constexpr double kSureGap = 5e-8;  // m; where rounding ends the search with a wider gap, the lower bound is returned
constexpr int kGjkSteps = 200;

struct GjkResult {
    enum class Status { apart, beyond_cutoff, touching } status;
    double lower;  // bound of the distance, m
    Vec3 direction;  // from B to A, of any length: the plane across it proves the bound
    Simplex simplex;
};

// Distance, nearest points and normal in the frame of A; of a result that is apart.
//
// Close to its least value |v| hardly changes with direction, and the bound does much: the points give the distance,
// and the plane that proves the bound the normal.
inline Witness witness_of(const GjkResult &found) {
    const double upper = norm(found.simplex.v()), distance = upper - found.lower <= kSureGap ? upper : found.lower;
    const Vec3 a = found.simplex.on_a(), normal = (-1.0 / norm(found.direction)) * found.direction;
    return {distance, a, a + distance * normal, normal};
}

// The simplex of points that were nearest at other poses; empty where there are none, or they touch now.
template <class A, class B>
Simplex simplex_of(const Difference<A, B> &difference, const Features *before, double enough) {
    Simplex simplex;
    for (int k = 0; before && k < before->size; ++k) simplex.add(difference.of(before->a[k], before->b[k]));
    return simplex.squared() > enough * enough ? simplex : Simplex{};
}

// The points of A and B that a result that is apart rests on, or the direction that proves it to be beyond the cutoff.
template <class A, class B> Features features_of(const Difference<A, B> &difference, const GjkResult &found) {
    Features features;
    if (found.status == GjkResult::Status::touching) return features;
    features.direction = found.direction;
    if (found.status == GjkResult::Status::beyond_cutoff) return features;
    features.size = std::min(found.simplex.size(), 3);
    for (int k = 0; k < features.size; ++k)
        features.a[k] = found.simplex.point(k).a, features.b[k] = difference.on_b(found.simplex.point(k));
    return features;
}

// Stops early with a lower bound above `cutoff` (m), or as soon as the distance is at most `enough` (status touching);
// else where the bounds of the distance are within `gap`, m.
template <class A, class B>
GjkResult gjk(const Difference<A, B> &difference, double cutoff, double enough = kTouching,
              const Features *before = nullptr, double gap = kDistanceGap) {
    GjkResult result{GjkResult::Status::apart, -HUGE_VAL, {}, simplex_of(difference, before, enough)};
    Simplex &simplex = result.simplex;
    const bool known = simplex.size() > 0, apart = before && squared_norm(before->direction) > 0.0;
    Vec3 v = known ? simplex.v() : apart ? before->direction : difference.first_guess();
    double length = norm(v);
    for (int step = 0; step < kGjkSteps; ++step) {
        const DifferencePoint next = difference.support(-v);
        const double lower = dot(v, next.w) / length;
        if (lower >= result.lower - std::min(kNormalGap, 1e-4 * length)) result.direction = v;
        if (lower > result.lower) {
            result.lower = lower;
            if (lower > cutoff) {
                result.status = GjkResult::Status::beyond_cutoff;
                return result;
            }
        }
        if ((known || step > 0) && length - result.lower <= gap) return result;
        if (!simplex.add(next)) return result;  // rounding leaves no step
        if (simplex.origin_within() || simplex.squared() <= enough * enough) {
            result.status = GjkResult::Status::touching;
            return result;
        }
        v = simplex.v(), length = std::sqrt(simplex.squared());
    }
    return result;
}

}  // namespace optiplan
