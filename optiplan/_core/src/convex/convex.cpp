#include "convex.hpp"

#include <stdexcept>
#include <type_traits>

#include "closed_forms.hpp"
#include "triangle_mesh.hpp"

namespace optiplan {

Shape Shape::sphere(double radius) {
    Shape s;
    s.kind = Kind::sphere, s.radius = radius;
    return s;
}

Shape Shape::capsule(double radius, double half_length) {
    Shape s;
    s.kind = Kind::capsule, s.radius = radius, s.half_length = half_length;
    return s;
}

Shape Shape::box(const Vec3 &half) {
    Shape s;
    s.kind = Kind::box, s.half = half;
    return s;
}

Shape Shape::cylinder(double radius, double half_length) {
    Shape s;
    s.kind = Kind::cylinder, s.radius = radius, s.half_length = half_length;
    return s;
}

Shape Shape::convex_hull(std::vector<Vec3> points) {
    Shape s;
    s.kind = Kind::hull, s.hull = std::make_shared<const Hull>(std::move(points));
    return s;
}

Shape Shape::half_space(const Vec3 &normal, double offset) {
    Shape s;
    s.kind = Kind::half_space, s.normal = normal, s.offset = offset;
    return s;
}

Shape Shape::triangles(std::shared_ptr<const TriangleMesh> mesh) {
    Shape s;
    s.kind = Kind::mesh, s.mesh = std::move(mesh);
    return s;
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Whether a pair of such cores, in the order of their kinds, comes to the iteration: the others have closed forms.
constexpr bool is_iterated(Kind a, Kind b) {
    return a <= b && (b == Kind::hull || (a != Kind::sphere && (a != Kind::capsule || b != Kind::capsule)));
}

// f(core of a, core of b), compiled for the pairs that come to it only: each takes a second of a compiler.
template <class Found, class F> Found with_cores(const Shape &a, const Shape &b, F &&f) {
    return with_core(a, [&](const auto &core_a) {
        return with_core(b, [&](const auto &core_b) -> Found {
            if constexpr (is_iterated(std::decay_t<decltype(core_a)>::kind, std::decay_t<decltype(core_b)>::kind))
                return f(core_a, core_b);
            else
                throw std::logic_error("cores that are not in order, or whose distance has a closed form");
        });
    });
}

template <class A, class B>
Witness iterative(const A &a, const B &b, const Pose &X_AB, double cutoff, Features *features, double gap) {
    const auto difference = difference_of(a, b, X_AB);
    const GjkResult found = gjk(difference, cutoff, kTouching, features, difference.curved ? gap : kDistanceGap);
    if (features) *features = features_of(difference, found);
    switch (found.status) {
    case GjkResult::Status::beyond_cutoff:
        return {found.lower, {}, {}, {}};
    case GjkResult::Status::touching:
        return penetration(difference, found.simplex);
    default:
        return witness_of(found);
    }
}

Vec3 along_axis(const Pose &X, double length) {
    return {length * X.R.rows[0].z, length * X.R.rows[1].z, length * X.R.rows[2].z};
}

// Cores of A and B, a.kind <= b.kind, both bounded; in the frame of A.
Witness cores(const Shape &a, const Shape &b, const Pose &X_AB, double cutoff, Features *features = nullptr,
              double gap = kDistanceGap) {
    if (a.kind == Kind::sphere) {
        const Pose X_BA = X_AB.inverse();
        switch (b.kind) {
        case Kind::sphere:
            return between({}, X_AB.p, {1, 0, 0});
        case Kind::capsule:
            return segments({}, {}, X_AB.p, along_axis(X_AB, b.half_length));
        case Kind::box:
            return flipped(moved(X_AB, box_to_point(b.half, X_BA.p)));
        case Kind::cylinder:
            return flipped(moved(X_AB, cylinder_to_point(b.radius, b.half_length, X_BA.p)));
        default:
            break;
        }
    }
    if (a.kind == Kind::capsule && b.kind == Kind::capsule)
        return segments({}, {0.0, 0.0, a.half_length}, X_AB.p, along_axis(X_AB, b.half_length));
    return with_cores<Witness>(a, b, [&](const auto &core_a, const auto &core_b) {
        return iterative(core_a, core_b, X_AB, cutoff, features, gap);
    });
}

// A shape against a half-space; two half-spaces are nowhere apart.
Witness above(const Shape &a, const Shape &plane, const Pose &X_AB) {
    const Vec3 n = X_AB.R * plane.normal;
    const double offset = plane.offset + dot(n, X_AB.p);
    if (a.kind == Kind::half_space) return {-kInfinity, {}, {}, -n};
    if (a.kind == Kind::mesh) return a.mesh->above(n, offset);
    return with_core(a, [&](const auto &core) { return to_half_space(core, n, offset); });
}

Witness between_meshes(const Shape &a, const Shape &b, const Pose &X_AB, double cutoff, double enough) {
    if (a.kind == Kind::mesh) return a.mesh->distance(*b.mesh, X_AB, cutoff, enough);
    return flipped(moved(X_AB, b.mesh->distance(a, X_AB.inverse(), cutoff, enough)));
}

}  // namespace

Witness distance(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &X_WB, double cutoff, Features *features,
                 double gap) {
    if (a.kind > b.kind) return flipped(distance(b, X_WB, a, X_WA, cutoff, features, gap));
    const Pose X_AB = relative(X_WA, X_WB);
    const double radius_a = rounding_radius(a), radius_b = rounding_radius(b), radii = radius_a + radius_b;
    const Witness found = b.kind == Kind::half_space ? above(a, b, X_AB)
                          : b.kind == Kind::mesh     ? between_meshes(a, b, X_AB, cutoff + radii, 0.0)
                                                     : cores(a, b, X_AB, cutoff + radii, features, gap);
    const double distance = found.distance - radii;
    if (distance > cutoff) return {distance, {}, {}, {}};
    const Vec3 normal = X_WA.R * found.normal;
    return {distance, X_WA * found.a + radius_a * normal, X_WA * found.b - radius_b * normal, normal};
}

bool overlap_within(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &X_WB, double margin,
                    Features *features) {
    if (a.kind > b.kind) return overlap_within(b, X_WB, a, X_WA, margin, features);
    const Pose X_AB = relative(X_WA, X_WB);
    const double within = margin + rounding_radius(a) + rounding_radius(b);
    // Written so that shapes at no number are not apart.
    if (b.kind == Kind::half_space) return !(above(a, b, X_AB).distance > within);
    if (b.kind == Kind::mesh) return !(between_meshes(a, b, X_AB, within, within).distance > within);
    if (a.kind == Kind::sphere || (a.kind == Kind::capsule && b.kind == Kind::capsule))
        return !(cores(a, b, X_AB, within).distance > within);
    return with_cores<bool>(a, b, [&](const auto &core_a, const auto &core_b) {
        const GjkResult found = gjk(difference_of(core_a, core_b, X_AB), within, within, features);
        const bool apart = found.status == GjkResult::Status::beyond_cutoff;
        if (features) features->direction = apart ? found.direction : Vec3{};
        return !apart;
    });
}

}  // namespace optiplan
