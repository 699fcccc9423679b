// The simplex of GJK: up to four points of A - B and the point of their hull that is nearest to the origin.
#pragma once

#include "cores.hpp"

namespace optiplan {

namespace simplex {

constexpr double kFlat =
    1e-14;  // volume as a part of the edges' product: below it rounding decides on which side is what

// Points of a face by index, barycentric weights, the nearest point and its squared distance from the origin.
struct Face {
    int size;
    int at[3];
    double weights[3];
    Vec3 v;
    double squared;
};

inline Face corner(const DifferencePoint *points, int i) {
    const Vec3 &w = points[i].w;
    return {1, {i, 0, 0}, {1.0, 0.0, 0.0}, w, squared_norm(w)};
}

inline Face edge(const DifferencePoint *points, int i, int j) {
    const Vec3 &w = points[i].w;
    const Vec3 e = points[j].w - w;
    const double along = -dot(w, e), length = squared_norm(e);
    if (along <= 0.0 || length <= 0.0) return corner(points, i);
    if (along >= length) return corner(points, j);
    const double t = along / length;
    const Vec3 v = w + t * e;
    return {2, {i, j, 0}, {1.0 - t, t, 0.0}, v, squared_norm(v)};
}

inline Face nearer(const Face &a, const Face &b) { return b.squared < a.squared ? b : a; }

// Weights come from cross products of edges, which lose fewer digits in slender triangles than products of lengths do.
inline Face triangle(const DifferencePoint *points, int i, int j, int k) {
    const Vec3 &w = points[i].w;
    const Vec3 e = points[j].w - w, f = points[k].w - w, n = cross(e, f);
    const double area = squared_norm(n);
    const double s = dot(cross(f, w), n), t = dot(cross(w, e), n);
    if (s > 0.0 && t > 0.0 && s + t < area) {
        const double scale = 1.0 / area, a = s * scale, b = t * scale;
        const Vec3 v = w + a * e + b * f;
        return {3, {i, j, k}, {1.0 - a - b, a, b}, v, squared_norm(v)};
    }
    return nearer(edge(points, i, j), edge(points, i, k));
}

// Of a triangle of which no corner is known to belong to the nearest face.
inline Face nearest_of_triangle(const DifferencePoint *points) {
    return nearer(triangle(points, 0, 1, 2), edge(points, 1, 2));
}

// Of a tetrahedron: the nearest point of the three faces at a corner; false where the origin is within.
inline bool tetrahedron(const DifferencePoint *points, int i, const int (&others)[3], Face &best) {
    const Vec3 &w = points[i].w;
    const int j = others[0], k = others[1], l = others[2];
    const Vec3 e = points[j].w - w, f = points[k].w - w, g = points[l].w - w;
    const Vec3 fg = cross(f, g), ge = cross(g, e), ef = cross(e, f);
    const double volume = dot(e, fg), sign = volume < 0.0 ? -1.0 : 1.0;
    const bool flat = volume * volume <= kFlat * kFlat * squared_norm(e) * squared_norm(f) * squared_norm(g);
    // On the outer side of a face, as parts of the volume.
    const bool out_fg = sign * dot(w, fg) > 0.0, out_ge = sign * dot(w, ge) > 0.0, out_ef = sign * dot(w, ef) > 0.0;
    if (!flat && !out_fg && !out_ge && !out_ef) return false;
    best.squared = HUGE_VAL;
    if (flat || out_fg) best = triangle(points, i, k, l);
    if (flat || out_ge) best = nearer(best, triangle(points, i, l, j));
    if (flat || out_ef) best = nearer(best, triangle(points, i, j, k));
    return true;
}

}  // namespace simplex

// Up to four points, and the one of their hull that is nearest to the origin.
class Simplex {
  public:
    // Adds a point and keeps the smallest face that holds the point nearest to the origin; the face contains the new
    // point, since that lies nearer along v than the others. Without effect, and false, if that does not come nearer
    // than before.
    bool add(const DifferencePoint &point) {
        const int slot = free_slot();
        points_[slot] = point;
        simplex::Face next;
        if (nearest_.size == 1) {
            next = simplex::edge(points_, slot, nearest_.at[0]);
        } else if (nearest_.size == 2) {
            next = simplex::triangle(points_, slot, nearest_.at[1], nearest_.at[0]);
        } else if (nearest_.size == 3) {
            if (!simplex::tetrahedron(points_, slot, nearest_.at, next)) {
                origin_within_ = true;
                return true;
            }
        } else {
            next = simplex::corner(points_, slot);
        }
        if (!(next.squared < nearest_.squared)) return false;
        nearest_ = next;
        return true;
    }

    bool origin_within() const { return origin_within_; }  // then all four points are of use
    int size() const { return origin_within_ ? 4 : nearest_.size; }
    const DifferencePoint &point(int i) const { return points_[origin_within_ ? i : nearest_.at[i]]; }
    const Vec3 &v() const { return nearest_.v; }
    double squared() const { return nearest_.squared; }  // |v|^2

    // The point of A that v = a - b is made of.
    Vec3 on_a() const {
        Vec3 a;
        // NOLINTNEXTLINE(clang-analyzer-security.ArrayBound): a face has three points at most
        for (int i = 0; i < nearest_.size; ++i) a += nearest_.weights[i] * points_[nearest_.at[i]].a;
        return a;
    }

  private:
    int free_slot() const {
        int taken = 0;
        for (int i = 0; i < nearest_.size; ++i) taken |= 1 << nearest_.at[i];
        return !(taken & 1) ? 0 : !(taken & 2) ? 1 : !(taken & 4) ? 2 : 3;
    }

    DifferencePoint points_[4];
    simplex::Face nearest_{0, {0, 0, 0}, {0.0, 0.0, 0.0}, {}, HUGE_VAL};
    bool origin_within_ = false;
};

}  // namespace optiplan
