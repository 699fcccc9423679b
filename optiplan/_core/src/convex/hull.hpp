// Vertices of a convex polyhedron with an index that finds the farthest one in a direction.
#pragma once

#include <cstdint>
#include <vector>

#include "../pose.hpp"

namespace optiplan {

// The convex hull of points; points within it are allowed and never found.
//
// Directions are sorted into cells of a cube's surface. For each cell the vertices that can be the farthest one for some
// direction in it are listed (a handful, for the hulls of robots of 100 to 250 vertices), so that a support point is the
// best of a short list: exact, and independent of what was asked before, which hill climbing along edges is not.
class Hull {
public:
    explicit Hull(std::vector<Vec3> points);

    // The vertex farthest along d, which must not be zero.
    Vec3 support(const Vec3 &d) const {
        const std::uint32_t cell = cell_of(d);
        const std::uint16_t *at = candidates_.data() + first_[cell], *end = candidates_.data() + first_[cell + 1];
        const Vec3 *best = &points_[*at];
        double most = dot(*best, d);
        while (++at != end) {
            const Vec3 &point = points_[*at];
            const double along = dot(point, d);
            const bool better = along > most;
            most = better ? along : most;
            best = better ? &point : best;
        }
        return *best;
    }

    const std::vector<Vec3> &points() const { return points_; }
    const Vec3 &centre() const { return centre_; }  // of the box along the axes of the frame
    const Vec3 &half() const { return half_; }      // half edges of that box
    double radius() const { return radius_; }       // of the ball about `centre` that holds all points
    double mean_candidates() const { return double(candidates_.size()) / double(first_.size() - 1); }

private:
    std::uint32_t cell_of(const Vec3 &d) const {
        const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z);
        double major, u, v;
        std::uint32_t face;
        if (x >= y && x >= z) major = d.x, u = d.y, v = d.z, face = 0;
        else if (y >= z) major = d.y, u = d.z, v = d.x, face = 1;
        else major = d.z, u = d.x, v = d.y, face = 2;
        const double to_cells = 0.5 * cells_ / std::fabs(major), middle = 0.5 * cells_;
        const std::uint32_t last = cells_ - 1;
        const std::uint32_t i = std::uint32_t(middle + u * to_cells), j = std::uint32_t(middle + v * to_cells);
        return ((2 * face + (major < 0.0)) * cells_ + (i < last ? i : last)) * cells_ + (j < last ? j : last);
    }

    using Candidates = std::vector<std::uint16_t>;
    struct Square;
    Candidates kept_in(const Square &square, const Candidates &candidates) const;
    void divide(const Square &square, const Candidates &candidates, std::vector<Candidates> &cells) const;

    std::vector<Vec3> points_;
    std::vector<std::uint32_t> first_;        // of each cell in `candidates_`
    Candidates candidates_;
    std::uint32_t cells_;                     // along an edge of the cube
    Vec3 centre_, half_;
    double radius_;
};

}  // namespace optiplan
