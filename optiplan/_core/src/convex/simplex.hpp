// The simplex of GJK: up to four points of A - B and the point of their hull that is nearest to the origin.
#pragma once

#include "cores.hpp"

namespace optiplan {

struct Simplex {
    int size = 0;
    DifferencePoint points[4];  // the newest last
    double weights[4];          // of the nearest point v = sum of weights[i] points[i].w
    Vec3 v;
    bool holds_origin = false;  // four points about the origin

    bool contains(const Vec3 &w) const {
        for (int i = 0; i < size; ++i)
            if (w.x == points[i].w.x && w.y == points[i].w.y && w.z == points[i].w.z) return true;
        return false;
    }

    Vec3 on_a() const {
        Vec3 a;
        for (int i = 0; i < size; ++i) a += weights[i] * points[i].a;
        return a;
    }

    // Adds a point and reduces the simplex to the smallest face that holds the point nearest to the origin. The face
    // contains the new point, since that lies nearer along v than the others.
    void add(const DifferencePoint &point);
};

namespace simplex {

constexpr double kFlat = 1e-14;  // volume as a part of the edges' product: below it rounding decides on which side is what

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

inline const Face &nearer(const Face &a, const Face &b) { return b.squared < a.squared ? b : a; }

// Weights come from cross products of edges, which lose fewer digits in slender triangles than products of lengths do.
inline Face triangle(const DifferencePoint *points, int i, int j, int k) {
    const Vec3 &w = points[i].w;
    const Vec3 e = points[j].w - w, f = points[k].w - w, n = cross(e, f);
    const double area = squared_norm(n);
    const double s = dot(cross(f, w), n), t = dot(cross(w, e), n);
    if (s > 0.0 && t > 0.0 && s + t < area) {
        const double a = s / area, b = t / area;
        const Vec3 v = w + a * e + b * f;
        return {3, {i, j, k}, {1.0 - a - b, a, b}, v, squared_norm(v)};
    }
    return nearer(edge(points, i, j), edge(points, i, k));
}

// Of a triangle of which no corner is known to belong to the nearest face.
inline Face nearest_of_triangle(const DifferencePoint *points) {
    return nearer(triangle(points, 0, 1, 2), edge(points, 1, 2));
}

}  // namespace simplex

inline void Simplex::add(const DifferencePoint &point) {
    using namespace simplex;
    points[size++] = point;
    Face best;
    if (size == 1) {
        best = corner(points, 0);
    } else if (size == 2) {
        best = edge(points, 1, 0);
    } else if (size == 3) {
        best = triangle(points, 2, 1, 0);
    } else {
        const Vec3 &w = points[3].w;
        const Vec3 e = points[0].w - w, f = points[1].w - w, g = points[2].w - w;
        const Vec3 fg = cross(f, g), ge = cross(g, e), ef = cross(e, f);
        const double volume = dot(e, fg), sign = volume < 0.0 ? -1.0 : 1.0;
        // Parts of the volume that the origin makes with the three faces about w; negative: it is outside that face.
        const double to_fg = -sign * dot(w, fg), to_ge = -sign * dot(w, ge), to_ef = -sign * dot(w, ef);
        const bool flat = volume * volume <= kFlat * kFlat * squared_norm(e) * squared_norm(f) * squared_norm(g);
        if (!flat && to_fg >= 0.0 && to_ge >= 0.0 && to_ef >= 0.0) {
            const double whole = std::fabs(volume);
            weights[0] = to_fg / whole, weights[1] = to_ge / whole, weights[2] = to_ef / whole;
            weights[3] = 1.0 - weights[0] - weights[1] - weights[2];
            v = {};
            holds_origin = true;
            return;
        }
        best.squared = HUGE_VAL;
        if (flat || to_fg < 0.0) best = nearer(best, triangle(points, 3, 1, 2));
        if (flat || to_ge < 0.0) best = nearer(best, triangle(points, 3, 2, 0));
        if (flat || to_ef < 0.0) best = nearer(best, triangle(points, 3, 0, 1));
    }
    DifferencePoint kept[3];
    for (int i = 0; i < best.size; ++i) kept[i] = points[best.at[i]];
    size = best.size;
    for (int i = 0; i < size; ++i) points[i] = kept[i], weights[i] = best.weights[i];
    v = best.v;
}

}  // namespace optiplan
