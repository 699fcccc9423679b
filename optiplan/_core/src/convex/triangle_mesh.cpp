#include "triangle_mesh.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "gjk.hpp"

namespace optiplan {

namespace {

Vec3 least(const Vec3 &a, const Vec3 &b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
Vec3 most(const Vec3 &a, const Vec3 &b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
Vec3 absolute(const Vec3 &a) { return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}; }

// Half edges of the box along the axes of A that holds a box with half edges `half` along those of B.
Vec3 half_in(const Mat3 &R_AB, const Vec3 &half) {
    return {dot(absolute(R_AB.rows[0]), half), dot(absolute(R_AB.rows[1]), half), dot(absolute(R_AB.rows[2]), half)};
}

// Distance of two boxes along the same axes, whose centres are `apart`.
double gap(const Vec3 &apart, const Vec3 &halves) { return norm(most(absolute(apart) - halves, {})); }

// The nearest pair of triangles found so far, and below which distance another one is of interest.
struct Search {
    double limit, enough;
    Witness best;

    Search(double cutoff, double enough) : limit(cutoff), enough(enough) {
        best.distance = std::numeric_limits<double>::infinity();
    }

    bool over() const { return best.distance <= enough; }

    // The direction from B to A that kept the latest two farthest apart.
    template <class A, class B> Vec3 ask(const A &a, const B &b, const Pose &X_AB) {
        const GjkResult found = gjk(difference_of(a, b, X_AB), limit);
        if (found.status == GjkResult::Status::beyond_cutoff) {
            // Nothing is nearer than what was found; without that, the least bound of all is what is known.
            if (best.distance > limit && found.lower < best.distance) best.distance = found.lower;
            return found.direction;
        }
        if (found.status == GjkResult::Status::touching) {
            const Vec3 common = found.simplex.on_a();
            best = {0.0, common, common, {1, 0, 0}};
        } else if (const Witness apart = witness_of(found); apart.distance < best.distance) {
            best = apart;
        }
        limit = std::min(limit, best.distance);
        return found.direction;
    }
};

// A plane that has kept a triangle apart from a convex core often does so for its neighbours.
struct Plane {
    Vec3 direction;       // a unit vector from the core to the mesh, or zero: no plane yet
    double reach = 0.0;   // of the core along it

    template <class Core> void take(const Vec3 &found, const Core &core, const Pose &X_AB) {
        const double length = norm(found);
        if (!(length > 0.0)) return;
        direction = (1.0 / length) * found;
        reach = dot(direction, X_AB * core.support(transposed(X_AB.R, direction)));
    }

    double to_box(const Vec3 &centre, const Vec3 &half) const {
        return dot(direction, centre) - dot(absolute(direction), half) - reach;
    }

    double to_corners(const Vec3 (&c)[3]) const {
        return std::min({dot(direction, c[0]), dot(direction, c[1]), dot(direction, c[2])}) - reach;
    }
};

}  // namespace

TriangleMesh::TriangleMesh(const std::vector<Vec3> &vertices, const std::vector<Corners> &triangles) {
    if (triangles.empty()) throw std::invalid_argument("a mesh without triangles");
    for (const Corners &corners : triangles) {
        Triangle triangle;
        for (int k = 0; k < 3; ++k) {
            if (corners[k] >= vertices.size()) throw std::invalid_argument("a triangle of vertices that are not there");
            triangle.corners[k] = vertices[corners[k]];
            const Vec3 &p = triangle.corners[k];
            if (!std::isfinite(p.x + p.y + p.z)) throw std::invalid_argument("a mesh of points that are not finite");
        }
        triangles_.push_back(triangle);
    }
    nodes_.reserve(2 * triangles_.size());
    build(triangles_.begin(), triangles_.end());
}

// Halves of equal number across the longest axis of the middles, until each box holds one triangle.
void TriangleMesh::build(std::vector<Triangle>::iterator first, std::vector<Triangle>::iterator end) {
    constexpr double far = std::numeric_limits<double>::infinity();
    Vec3 low{far, far, far}, high{-far, -far, -far}, low_middle = low, high_middle = high;
    for (auto at = first; at != end; ++at) {
        for (const Vec3 &p : at->corners) low = least(low, p), high = most(high, p);
        const Vec3 middle = at->corners[0] + at->corners[1] + at->corners[2];
        low_middle = least(low_middle, middle), high_middle = most(high_middle, middle);
    }
    const std::size_t index = nodes_.size();
    const bool leaf = end - first == 1;
    nodes_.push_back({0.5 * (low + high), 0.5 * (high - low), std::uint32_t(first - triangles_.begin()), leaf});
    if (leaf) return;
    const Vec3 extent = high_middle - low_middle;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const auto half = first + (end - first) / 2;
    std::nth_element(first, half, end, [axis](const Triangle &a, const Triangle &b) {
        return a.corners[0][axis] + a.corners[1][axis] + a.corners[2][axis] <
               b.corners[0][axis] + b.corners[1][axis] + b.corners[2][axis];
    });
    build(first, half);
    nodes_[index].child = std::uint32_t(nodes_.size());
    build(half, end);
}

Witness TriangleMesh::distance(const Shape &convex, const Pose &X_AB, double cutoff, double enough) const {
    return with_core(convex, [&](const auto &core) {
        // The box of the core along the axes of the mesh, that along its own axes, and a ball about its middle.
        const Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
        const auto reach = [&](const Vec3 &d) { return dot(d, X_AB * core.support(transposed(X_AB.R, d))); };
        const Vec3 high{reach(x), reach(y), reach(z)}, low{-reach(-x), -reach(-y), -reach(-z)};
        const Vec3 centre = 0.5 * (low + high), half = 0.5 * (high - low), ball = X_AB * core.middle();
        const Vec3 own_half = core.half_edges();
        const Mat3 R_BA = transpose(X_AB.R);
        const double radius = core.radius_about_middle();
        const auto bound = [&](const Node &node) {
            const Vec3 apart = node.centre - ball;
            const double along_own = gap(R_BA * apart, own_half + half_in(R_BA, node.half));
            return std::max({gap(node.centre - centre, node.half + half), gap(apart, node.half) - radius, along_own});
        };

        struct Waiting {
            std::uint32_t node;
            double bound;
        };
        Search search(cutoff, enough);
        Plane plane;
        double left_out = std::numeric_limits<double>::infinity();
        std::array<Waiting, 128> stack;
        std::size_t used = 0;
        stack[used++] = {0, bound(nodes_[0])};
        while (used > 0 && !search.over()) {
            const Waiting next = stack[--used];
            const Node &node = nodes_[next.node];
            const Vec3(&c)[3] = triangles_[node.leaf ? node.child : 0].corners;
            const double beyond = node.leaf ? plane.to_corners(c) : plane.to_box(node.centre, node.half);
            if (const double least = std::max(next.bound, beyond); least > search.limit) {
                left_out = std::min(left_out, least);
                continue;
            }
            if (node.leaf) {
                plane.take(search.ask(TriangleCore{{c[0], c[1], c[2]}}, core, X_AB), core, X_AB);
                continue;
            }
            Waiting near{next.node + 1, bound(nodes_[next.node + 1])}, far{node.child, bound(nodes_[node.child])};
            if (far.bound < near.bound) std::swap(near, far);
            stack[used++] = far;
            stack[used++] = near;
        }
        if (search.best.distance > cutoff) search.best.distance = std::min(search.best.distance, left_out);
        return search.best;
    });
}

Witness TriangleMesh::distance(const TriangleMesh &other, const Pose &X_AB, double cutoff, double enough) const {
    struct Waiting {
        std::uint32_t a, b;
        double bound;
    };
    const auto waiting = [&](std::uint32_t a, std::uint32_t b) {
        const Node &one = nodes_[a], &two = other.nodes_[b];
        const Vec3 apart = X_AB * two.centre - one.centre;
        return Waiting{a, b,
                       std::max(gap(apart, one.half + half_in(X_AB.R, two.half)),
                                gap(transposed(X_AB.R, apart), two.half + half_in(transpose(X_AB.R), one.half)))};
    };
    Search search(cutoff, enough);
    double left_out = std::numeric_limits<double>::infinity();
    std::vector<Waiting> stack{waiting(0, 0)};
    while (!stack.empty() && !search.over()) {
        const Waiting next = stack.back();
        stack.pop_back();
        if (next.bound > search.limit) {
            left_out = std::min(left_out, next.bound);
            continue;
        }
        const Node &a = nodes_[next.a], &b = other.nodes_[next.b];
        if (a.leaf && b.leaf) {
            const Vec3(&c)[3] = triangles_[a.child].corners, (&d)[3] = other.triangles_[b.child].corners;
            search.ask(TriangleCore{{c[0], c[1], c[2]}}, TriangleCore{{d[0], d[1], d[2]}}, X_AB);
            continue;
        }
        const bool divide_a = b.leaf || (!a.leaf && squared_norm(a.half) >= squared_norm(b.half));
        Waiting near = divide_a ? waiting(next.a + 1, next.b) : waiting(next.a, next.b + 1);
        Waiting far = divide_a ? waiting(a.child, next.b) : waiting(next.a, b.child);
        if (far.bound < near.bound) std::swap(near, far);
        stack.push_back(far);
        stack.push_back(near);
    }
    if (search.best.distance > cutoff) search.best.distance = std::min(search.best.distance, left_out);
    return search.best;
}

Witness TriangleMesh::above(const Vec3 &n, double offset) const {
    const Vec3 size = absolute(n);
    double lowest = std::numeric_limits<double>::infinity();
    Vec3 at;
    std::array<std::uint32_t, 128> stack;
    std::size_t used = 0;
    stack[used++] = 0;
    while (used > 0) {
        const std::uint32_t index = stack[--used];
        const Node &node = nodes_[index];
        if (dot(n, node.centre) - dot(size, node.half) >= lowest) continue;
        if (!node.leaf) {
            stack[used++] = node.child;
            stack[used++] = index + 1;
            continue;
        }
        for (const Vec3 &p : triangles_[node.child].corners)
            if (dot(n, p) < lowest) lowest = dot(n, p), at = p;
    }
    const double height = lowest - offset;
    return {height, at, at - height * n, -n};
}

}  // namespace optiplan
