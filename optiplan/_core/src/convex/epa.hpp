// Penetration depth of two convex cores by the expanding polytope algorithm.
//
// G. van den Bergen, "Proximity queries and penetration depth computation on 3D game objects", 2001. A polytope within
// A - B grows where its surface is nearest to the origin, until A - B does not reach beyond that face. The depth is
// known from both sides: the least distance of a face from below, the support function along its normal from above.
#pragma once

#include <array>
#include <initializer_list>
#include <vector>

#include "gjk.hpp"
#include "witness.hpp"

namespace optiplan {

constexpr double kDepthGap = 1e-12;       // m; between the two bounds, where the search ends
constexpr double kCurvedDepthGap =
    1e-5;  // the same as a part of the extent, for curved cores: `penetration` refines it

template <class A, class B> class ExpandingPolytope {
  public:
    explicit ExpandingPolytope(const Difference<A, B> &difference) : difference_(difference) {
        vertices_.reserve(64), faces_.reserve(128), rim_.reserve(64);
    }

    // `simplex`: where GJK ended, about the origin or touching it. The distance returned is minus the support function
    // of A - B along the normal, so never above the truth.
    Witness solve(const Simplex &simplex) {
        if (!begin(simplex)) return flat(simplex);
        const double gap = Difference<A, B>::curved ? kCurvedDepthGap * extent_ : std::max(kDepthGap, rounding_);
        std::size_t nearest = nearest_face();
        while (!faces_[nearest].closed) {
            Face &face = faces_[nearest];
            const DifferencePoint next = difference_.support(face.normal);
            const double reach = dot(next.w, face.normal);
            if (reach - face.plane <= gap || !expand(next)) face.closed = true, face.bound = reach;
            nearest = nearest_face();
        }
        const Face &face = faces_[nearest];
        exact_ = face.bound - face.plane <= std::max(kDepthGap, rounding_);
        return read(face);
    }

    // Whether the bounds met; false for curved cores, and where too many faces are equally near.
    bool exact() const { return exact_; }
    // Of A - B, m.
    double extent() const { return extent_; }

  private:
    static constexpr std::size_t kVertices = Difference<A, B>::curved ? 100 : 400;

    struct Face {
        int corners[3];  // counter-clockwise, seen from outside
        bool closed;     // A - B does not reach beyond it
        Vec3 normal;
        double plane;    // distance of its plane from the origin, along the normal
        double bound;    // the same, or of the plane that supports A - B where closed
    };

    struct Edge {
        int from, to;
    };

    Vec3 edge(int i, int j) const { return vertices_[j].w - vertices_[i].w; }

    // A tetrahedron of support points; false where A - B has no volume, `flat_normal_` being perpendicular to it.
    bool begin(const Simplex &simplex) {
        for (const Vec3 &axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}})
            extent_ =
                std::max({extent_, dot(difference_.support(axis).w, axis), -dot(difference_.support(-axis).w, axis)});
        rounding_ = 1e-14 * extent_;
        const double least = 1e-9 * extent_;  // lengths below it give no direction
        const auto farthest = [&](std::initializer_list<Vec3> directions, auto height) {
            double most = -1.0;
            DifferencePoint best;
            for (const Vec3 &d : directions) {
                const DifferencePoint point = difference_.support(d);
                const double found = height(point.w - vertices_[0].w);
                if (found > most) most = found, best = point;
            }
            vertices_.push_back(best);
            return most > least;
        };
        for (int i = 0; i < simplex.size(); ++i) vertices_.push_back(simplex.point(i));

        if (vertices_.size() > 1 && norm(edge(0, 1)) <= least) vertices_.resize(1);
        if (vertices_.size() == 1) {
            flat_normal_ = {1, 0, 0};
            if (!farthest({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, norm)) return false;
        }
        const Vec3 along = (1.0 / norm(edge(0, 1))) * edge(0, 1);
        const auto off_line = [&](const Vec3 &from_first) { return norm(cross(along, from_first)); };
        if (vertices_.size() > 2 && off_line(edge(0, 2)) <= least) vertices_.resize(2);
        if (vertices_.size() == 2) {
            const Vec3 u = flat_normal_ = perpendicular(along), v = cross(along, u);
            if (!farthest({u, v, -u, -v}, off_line)) return false;
        }
        // Of slender triangles rounding leaves a part along the edge, by which the edge's ends would lie off the plane.
        const Vec3 c = cross(along, edge(0, 2)), upright = c - dot(c, along) * along;
        const Vec3 n = (1.0 / norm(upright)) * upright;
        if (vertices_.size() > 3 && std::fabs(dot(n, edge(0, 3))) <= least) vertices_.resize(3);
        if (vertices_.size() == 3) {
            flat_normal_ = n;
            if (!farthest({n, -n}, [&](const Vec3 &from_first) { return std::fabs(dot(n, from_first)); })) return false;
        }
        if (dot(n, edge(0, 3)) > 0.0) std::swap(vertices_[1], vertices_[2]);  // face 0 1 2 looks away from vertex 3
        for (const auto &corners : {std::array{0, 1, 2}, std::array{0, 3, 1}, std::array{1, 3, 2}, std::array{2, 3, 0}})
            add_face(corners[0], corners[1], corners[2]);
        return true;
    }

    void add_face(int i, int j, int k) {
        const Vec3 n = cross(edge(i, j), edge(i, k));
        const double length = norm(n);
        Face face{{i, j, k}, true, {}, HUGE_VAL, HUGE_VAL};  // without area it is never the nearest, and sees nothing
        if (length > 0.0) {
            face.normal = (1.0 / length) * n;
            face.plane = face.bound = dot(face.normal, vertices_[i].w);
            face.closed = false;
        }
        faces_.push_back(face);
    }

    std::size_t nearest_face() const {
        std::size_t best = 0;
        for (std::size_t i = 1; i < faces_.size(); ++i)
            if (faces_[i].bound < faces_[best].bound) best = i;
        return best;
    }

    // Whether the rim passes no vertex twice, as it would where rounding decides what sees a point in slender faces.
    bool is_ring() const {
        for (std::size_t i = 0; i < rim_.size(); ++i)
            for (std::size_t j = 0; j < i; ++j)
                if (rim_[i].from == rim_[j].from) return false;
        return rim_.size() >= 3;
    }

    // Replaces the faces that see a new point by faces to it from their rim; false where there is no room or no ring.
    bool expand(const DifferencePoint &point) {
        if (vertices_.size() == kVertices) return false;
        const auto sees = [&](const Face &face) { return dot(face.normal, point.w) - face.plane > rounding_; };
        rim_.clear();
        bool seen = false;
        for (const Face &face : faces_) {
            if (!sees(face)) continue;
            seen = true;
            for (int side = 0; side < 3; ++side) {
                const int from = face.corners[side], to = face.corners[(side + 1) % 3];
                const auto opposite = std::find_if(rim_.begin(), rim_.end(), [&](const Edge &edge) {
                    return edge.from == to && edge.to == from;
                });
                if (opposite == rim_.end())
                    rim_.push_back({from, to});
                else
                    *opposite = rim_.back(), rim_.pop_back();
            }
        }
        if (!seen || !is_ring()) return false;
        faces_.erase(std::remove_if(faces_.begin(), faces_.end(), sees), faces_.end());
        const int newest = int(vertices_.size());
        vertices_.push_back(point);
        for (const Edge &edge : rim_) add_face(edge.from, edge.to, newest);
        return true;
    }

    // The foot of the normal lies in the nearest face, or in another one of the same plane.
    Witness read(const Face &nearest) const {
        simplex::Face best;
        best.squared = HUGE_VAL;
        const Vec3 foot = nearest.bound * nearest.normal;
        for (const Face &face : faces_) {
            const double off = dot(face.normal, foot) - face.plane;
            if (!(off * off < best.squared)) continue;
            std::array<DifferencePoint, 3> corners;
            for (int k = 0; k < 3; ++k) corners[k].w = vertices_[face.corners[k]].w - foot;
            simplex::Face found = simplex::nearest_of_triangle(corners.data());
            for (int k = 0; k < found.size; ++k) found.at[k] = face.corners[found.at[k]];
            best = simplex::nearer(best, found);
        }
        Vec3 a, w;
        for (int k = 0; k < best.size; ++k) {
            a += best.weights[k] * vertices_[best.at[k]].a;
            w += best.weights[k] * vertices_[best.at[k]].w;
        }
        return {-nearest.bound, a, a - w, nearest.normal};
    }

    // A - B lies in a plane, which touches the origin: the depth across it is nothing.
    Witness flat(const Simplex &simplex) const {
        const double up = dot(difference_.support(flat_normal_).w, flat_normal_);
        const double down = -dot(difference_.support(-flat_normal_).w, flat_normal_);
        const Vec3 a = simplex.on_a();
        return {-std::min(up, down), a, a - simplex.v(), up <= down ? flat_normal_ : -flat_normal_};
    }

    const Difference<A, B> &difference_;
    std::vector<DifferencePoint> vertices_;
    std::vector<Face> faces_;
    std::vector<Edge> rim_;
    double extent_ = 0.0, rounding_ = 0.0;
    bool exact_ = true;
    Vec3 flat_normal_;
};

// The shortest translation that parts two cores that touch, to rounding for polyhedra.
//
// Where the polytope leaves a gap, B is moved out along its normal and a little farther: from there the nearest points
// give a normal that is nearer to the best one by the factor depth / radius of curvature. Each is a translation that
// parts the cores, so the distance is never above the truth.
template <class A, class B> Witness penetration(const Difference<A, B> &difference, const Simplex &simplex) {
    ExpandingPolytope<A, B> polytope(difference);
    Witness best = polytope.solve(simplex);
    if (polytope.exact()) return best;
    const double beyond = 1e-3 * polytope.extent();
    Vec3 normal = best.normal;
    double depth = -best.distance;
    for (int round = 0; round < 5; ++round) {
        Difference<A, B> apart = difference;
        const Vec3 moved = (depth + beyond) * normal;
        apart.X_AB.p += moved;
        const GjkResult found = gjk(apart, HUGE_VAL);
        if (found.status != GjkResult::Status::apart) break;
        const Witness there = witness_of(found);
        const double turned = norm(there.normal - normal);
        normal = there.normal, depth = dot(difference.support(normal).w, normal);
        if (round == 0 || -depth >= best.distance - kNormalGap)
            best = {-depth, there.a, there.a - depth * normal, normal};
        if (turned <= 1e-6) break;
    }
    return best;
}

}  // namespace optiplan
