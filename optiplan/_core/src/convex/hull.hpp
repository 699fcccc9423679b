// Vertices of a convex polyhedron with an index that finds the farthest one in a direction.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "../pose.hpp"

namespace optiplan {

// The convex hull of points; points within it are allowed and never found.
//
// Directions are sorted into cells of a cube's surface. For each cell the vertices that can be the farthest one for
// some direction in it are listed (a handful, for the hulls of robots of 100 to 250 vertices), so that a support point
// is the best of a short list: exact, and independent of what was asked before, which hill climbing along edges is not.
// A cell is listed by the first question there, of the candidates of a block of cells: most are never asked, since
// boxes and balls keep most hulls of a robot apart, and in a fresh process all of them would take longer than a plan.
// Any number of threads may ask.
class Hull {
  public:
    explicit Hull(std::vector<Vec3> points);

    // The vertex farthest along d, which must not be zero.
    Vec3 support(const Vec3 &d) const {
        const std::uint32_t asked = cell_of(d);
        const Cell *cells = cells_.load(std::memory_order_acquire);
        if (!cells || !cells[asked].others.load(std::memory_order_acquire)) cells = list(asked);
        const Cell &cell = cells[asked];
        const std::uint32_t *others = cell.others.load(std::memory_order_relaxed);
        std::uint32_t best = cell.first[0];
        double most = dot(points_[best], d);
        const auto ask = [&](std::uint32_t other) {
            const double height = dot(points_[other], d);
            const bool farther = height > most;
            best = farther ? other : best, most = farther ? height : most;
        };
        ask(cell.first[1]);
        for (std::uint32_t k = 1; k <= *others; ++k) ask(others[k]);
        return points_[best];
    }

    const std::vector<Vec3> &points() const { return points_; }
    const Vec3 &centre() const { return centre_; }  // of the box along the axes of the frame
    const Vec3 &half() const { return half_; }      // half edges of that box
    double radius() const { return radius_; }       // of the ball about `centre` that holds all points

  private:
    // Candidates of a cell: two, and `others`: how many, followed by these; null until it is listed.
    struct Cell {
        std::uint32_t first[2] = {};
        std::atomic<const std::uint32_t *> others{nullptr};
    };

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

    using Candidates = std::vector<std::uint32_t>;
    struct Square;
    const Cell *list(std::uint32_t asked) const;
    Candidates kept_in(const Square &square, const Candidates &candidates) const;

    std::vector<Vec3> points_;
    mutable std::atomic<const Cell *> cells_{nullptr};  // of `all_`, once there is a question
    mutable std::unique_ptr<Cell[]> all_;
    mutable std::map<std::uint32_t, Candidates> blocks_;  // by their first cells
    mutable std::deque<Candidates> more_;                 // of cells, which stay where they are
    mutable std::mutex listing_;
    std::uint32_t edge_cells_;  // along an edge of the cube
    Vec3 centre_, half_;
    double radius_;
};

}  // namespace optiplan
