// Nearest points of cores for which a formula exists; signed, in the frame of A.
#pragma once

#include "epa.hpp"

namespace optiplan {

constexpr double kCoincident = 1e-13;  // m; points nearer than this tell no direction

// Of points of A and B; `fallback` is the normal where they coincide.
inline Witness between(const Vec3 &a, const Vec3 &b, const Vec3 &fallback) {
    const Vec3 apart = b - a;
    const double length = norm(apart);
    return {length, a, b, length > kCoincident ? (1.0 / length) * apart : fallback};
}

// The point of a segment p + t d, 0 <= t <= 1, that is nearest to q.
inline double nearest_parameter(const Vec3 &p, const Vec3 &d, const Vec3 &q) {
    const double length = squared_norm(d);
    return length > 0.0 ? std::max(0.0, std::min(1.0, dot(q - p, d) / length)) : 0.0;
}

// Segments a + s u and b + t v with s and t in [-1, 1].
inline Witness segments(const Vec3 &a, const Vec3 &u, const Vec3 &b, const Vec3 &v) {
    const Vec3 c = cross(u, v), apart = b - a;
    const double area = squared_norm(c), uu = squared_norm(u), vv = squared_norm(v), uv = dot(u, v);
    const auto unit_clamp = [](double t) { return std::max(-1.0, std::min(1.0, t)); };
    double s, t;
    if (area > 1e-20 * uu * vv) {
        s = unit_clamp(dot(cross(apart, v), c) / area);
    } else {  // parallel: the middle of what they have side by side
        const double centre = uu > 0.0 ? dot(apart, u) / uu : 0.0, reach = uu > 0.0 ? std::fabs(uv) / uu : 0.0;
        s = 0.5 * (unit_clamp(centre - reach) + unit_clamp(centre + reach));
    }
    t = vv > 0.0 ? unit_clamp((s * uv - dot(apart, v)) / vv) : 0.0;
    s = uu > 0.0 ? unit_clamp((t * uv + dot(apart, u)) / uu) : 0.0;
    Vec3 fallback{1, 0, 0};
    if (area > 0.0)
        fallback = (1.0 / std::sqrt(area)) * c;
    else if (uu > 0.0 || vv > 0.0)
        fallback = perpendicular(uu > 0.0 ? u : v);
    return between(a + s * u, b + t * v, fallback);
}

// A point p of A against a box about the origin of A's frame; here the box is A and the point is B.
inline Witness box_to_point(const Vec3 &half, const Vec3 &p) {
    const double x = half.x - std::fabs(p.x), y = half.y - std::fabs(p.y), z = half.z - std::fabs(p.z);
    if (std::min({x, y, z}) < -kCoincident) return between(BoxCore{half}.near(p), p, {1, 0, 0});
    Witness result{-std::min({x, y, z}), p, p, {}};
    if (x <= y && x <= z)
        result.normal.x = std::copysign(1.0, p.x), result.a.x = std::copysign(half.x, p.x);
    else if (y <= z)
        result.normal.y = std::copysign(1.0, p.y), result.a.y = std::copysign(half.y, p.y);
    else
        result.normal.z = std::copysign(1.0, p.z), result.a.z = std::copysign(half.z, p.z);
    return result;
}

// A cylinder about z and a point.
inline Witness cylinder_to_point(double radius, double half_length, const Vec3 &p) {
    const double across = std::sqrt(p.x * p.x + p.y * p.y);
    const Vec3 outward = across > 0.0 ? Vec3{p.x / across, p.y / across, 0.0} : Vec3{1, 0, 0};
    const double to_side = radius - across, to_cap = half_length - std::fabs(p.z);
    if (std::min(to_side, to_cap) < -kCoincident) {
        Vec3 on = to_side < 0.0 ? radius * outward : Vec3{p.x, p.y, 0.0};
        on.z = clamped(p.z, half_length);
        return between(on, p, outward);
    }
    if (to_side <= to_cap) {
        const Vec3 on = radius * outward;
        return {-to_side, {on.x, on.y, p.z}, p, outward};
    }
    const double sign = std::copysign(1.0, p.z);
    return {-to_cap, {p.x, p.y, sign * half_length}, p, {0.0, 0.0, sign}};
}

// A core and the half-space of all points with n . p <= offset, in the core's frame.
template <class A> Witness to_half_space(const A &core, const Vec3 &n, double offset) {
    const Vec3 lowest = core.support(-n);
    const double height = dot(n, lowest) - offset;
    return {height, lowest, lowest - height * n, -n};
}

}  // namespace optiplan
