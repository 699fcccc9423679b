// Vertices of a convex polyhedron with an index that finds the farthest one in a direction.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "../pose.hpp"

namespace optiplan {

// The convex hull of points; points within it are allowed and never found.
//
// Directions are sorted into cells of a cube's surface. For each cell the vertices that can be the farthest one for
// some direction in it are listed (a handful, for the hulls of robots of 100 to 250 vertices), so that a support point
// is the best of a short list: exact, and independent of what was asked before, which hill climbing along edges is not.
// The lists are made by the first question, for boxes and balls keep most hulls of a robot from being asked at all.
class Hull {
  public:
    explicit Hull(std::vector<Vec3> points);

    // The vertex farthest along d, which must not be zero.
    Vec3 support(const Vec3 &d) const {
        if (!listed_.load(std::memory_order_acquire)) list();
        const Cell &cell = cells_[cell_of(d)];
        const Vec3 *best = farther(&points_[cell.first[0]], &points_[cell.first[1]], d);
        for (std::uint32_t at = cell.more; at != cell.end; at += 2)
            best = farther(best, farther(&points_[more_[at]], &points_[more_[at + 1]], d), d);
        return *best;
    }

    const std::vector<Vec3> &points() const { return points_; }
    const Vec3 &centre() const { return centre_; }  // of the box along the axes of the frame
    const Vec3 &half() const { return half_; }      // half edges of that box
    double radius() const { return radius_; }       // of the ball about `centre` that holds all points

  private:
    // Candidates of a cell: two, and pairs of `more_`.
    struct Cell {
        std::uint16_t first[2];
        std::uint32_t more, end;
    };

    static const Vec3 *farther(const Vec3 *a, const Vec3 *b, const Vec3 &d) { return dot(*b, d) > dot(*a, d) ? b : a; }

    std::uint32_t cell_of(const Vec3 &d) const {
        const double along[] = {d.x, d.y, d.z, d.x, d.y};
        const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z);
        std::uint32_t axis = y > x;
        axis = z > (x > y ? x : y) ? 2 : axis;
        const double major = along[axis], middle = 0.5 * edge_cells_, to_cells = middle / std::fabs(major);
        const std::uint32_t last = edge_cells_ - 1;
        const std::uint32_t i = std::uint32_t(middle + along[axis + 1] * to_cells);
        const std::uint32_t j = std::uint32_t(middle + along[axis + 2] * to_cells);
        return ((2 * axis + (major < 0.0)) * edge_cells_ + (i < last ? i : last)) * edge_cells_ + (j < last ? j : last);
    }

    using Candidates = std::vector<std::uint16_t>;
    struct Square;
    void list() const;
    Candidates kept_in(const Square &square, const Candidates &candidates) const;
    void divide(const Square &square, const Candidates &candidates, std::vector<Candidates> &cells) const;

    std::vector<Vec3> points_;
    mutable std::vector<Cell> cells_;
    mutable Candidates more_;
    mutable std::atomic<bool> listed_{false};  // whether `cells_` and `more_` are made
    mutable std::mutex listing_;
    std::uint32_t edge_cells_;  // along an edge of the cube
    Vec3 centre_, half_;
    double radius_;
};

}  // namespace optiplan
