// Convex cores and their support functions, which the iterative distance works on.
//
// A core and a ball about each of its points make a shape: a sphere is a point and a radius, a capsule a segment and a
// radius. Each core tells its farthest point along a direction, a point of it (or of a box around it) near to a given
// one, and a ball and a box along its axes, about the same middle, that hold it.
#pragma once

#include <algorithm>
#include <cmath>

#include "shape.hpp"

namespace optiplan {

inline double clamped(double value, double half) { return std::max(-half, std::min(half, value)); }

struct PointCore {
    static constexpr Kind kind = Kind::sphere;
    static constexpr bool curved = false;
    Vec3 support(const Vec3 &) const { return {}; }
    Vec3 near(const Vec3 &) const { return {}; }
    Vec3 middle() const { return {}; }
    Vec3 half_edges() const { return {}; }
    double radius_about_middle() const { return 0.0; }
};

struct SegmentCore {  // along z
    static constexpr Kind kind = Kind::capsule;
    static constexpr bool curved = false;
    double half_length;
    Vec3 support(const Vec3 &d) const { return {0.0, 0.0, std::copysign(half_length, d.z)}; }
    Vec3 near(const Vec3 &p) const { return {0.0, 0.0, clamped(p.z, half_length)}; }
    Vec3 middle() const { return {}; }
    Vec3 half_edges() const { return {0.0, 0.0, half_length}; }
    double radius_about_middle() const { return half_length; }
};

struct BoxCore {
    static constexpr Kind kind = Kind::box;
    static constexpr bool curved = false;
    Vec3 half;
    Vec3 support(const Vec3 &d) const {
        return {std::copysign(half.x, d.x), std::copysign(half.y, d.y), std::copysign(half.z, d.z)};
    }
    Vec3 near(const Vec3 &p) const { return {clamped(p.x, half.x), clamped(p.y, half.y), clamped(p.z, half.z)}; }
    Vec3 middle() const { return {}; }
    Vec3 half_edges() const { return half; }
    double radius_about_middle() const { return norm(half); }
};

struct CylinderCore {  // about z
    static constexpr Kind kind = Kind::cylinder;
    static constexpr bool curved = true;
    double radius, half_length;
    Vec3 support(const Vec3 &d) const {
        const double across = std::sqrt(d.x * d.x + d.y * d.y);
        const double s = across > 0.0 ? radius / across : 0.0;
        return {s * d.x, s * d.y, std::copysign(half_length, d.z)};
    }
    Vec3 near(const Vec3 &p) const {
        const double across = std::sqrt(p.x * p.x + p.y * p.y);
        const double s = across > radius ? radius / across : 1.0;
        return {s * p.x, s * p.y, clamped(p.z, half_length)};
    }
    Vec3 middle() const { return {}; }
    Vec3 half_edges() const { return {radius, radius, half_length}; }
    double radius_about_middle() const { return std::sqrt(radius * radius + half_length * half_length); }
};

struct HullCore {
    static constexpr Kind kind = Kind::hull;
    static constexpr bool curved = false;
    const Hull *hull;
    Vec3 support(const Vec3 &d) const { return hull->support(d); }
    Vec3 near(const Vec3 &p) const {
        const Vec3 c = hull->centre(), h = hull->half(), l = p - c;
        return c + Vec3{clamped(l.x, h.x), clamped(l.y, h.y), clamped(l.z, h.z)};
    }
    Vec3 middle() const { return hull->centre(); }
    Vec3 half_edges() const { return hull->half(); }
    double radius_about_middle() const { return hull->radius(); }
};

struct TriangleCore {
    static constexpr bool curved = false;
    Vec3 corners[3];
    Vec3 support(const Vec3 &d) const {
        const double a = dot(corners[0], d), b = dot(corners[1], d), c = dot(corners[2], d);
        return a >= b ? (a >= c ? corners[0] : corners[2]) : (b >= c ? corners[1] : corners[2]);
    }
    Vec3 near(const Vec3 &) const { return middle(); }
    Vec3 middle() const { return (1.0 / 3.0) * (corners[0] + corners[1] + corners[2]); }
};

// Calls f(core) with the core of a bounded convex shape.
template <class F> auto with_core(const Shape &shape, F &&f) {
    switch (shape.kind) {
    case Kind::capsule:
        return f(SegmentCore{shape.half_length});
    case Kind::box:
        return f(BoxCore{shape.half});
    case Kind::cylinder:
        return f(CylinderCore{shape.radius, shape.half_length});
    case Kind::hull:
        return f(HullCore{shape.hull.get()});
    default:
        return f(PointCore{});
    }
}

// Radius of the ball about each point of the core.
inline double rounding_radius(const Shape &shape) {
    return shape.kind == Kind::sphere || shape.kind == Kind::capsule ? shape.radius : 0.0;
}

// The difference A - B of two cores, in the frame of A: a point w = a - b of it and the point a of A.
struct DifferencePoint {
    Vec3 w, a;
};

template <class A, class B> struct Difference {
    A a;
    B b;
    Pose X_AB;
    static constexpr bool curved = A::curved || B::curved;

    // The point of A - B farthest along d.
    DifferencePoint support(const Vec3 &d) const {
        const Vec3 p = a.support(d);
        return {p - X_AB * b.support(transposed(X_AB.R, -d)), p};
    }

    // That of a point of A and one of B, each in its own frame; and the point of B of such a one.
    DifferencePoint of(const Vec3 &on_a, const Vec3 &on_b) const { return {on_a - X_AB * on_b, on_a}; }
    Vec3 on_b(const DifferencePoint &point) const { return transposed(X_AB.R, point.a - point.w - X_AB.p); }

    // A vector from B towards A to begin with: that between points that are near each other.
    Vec3 first_guess() const {
        const Vec3 on_b = X_AB * b.near(transposed(X_AB.R, a.middle() - X_AB.p));
        const Vec3 apart = a.near(on_b) - on_b;
        if (squared_norm(apart) > 0.0) return apart;
        const Vec3 middles = a.middle() - X_AB * b.middle();
        return squared_norm(middles) > 0.0 ? middles : Vec3{1.0, 0.0, 0.0};
    }
};

template <class A, class B> Difference<A, B> difference_of(const A &a, const B &b, const Pose &X_AB) {
    return {a, b, X_AB};
}

}  // namespace optiplan
