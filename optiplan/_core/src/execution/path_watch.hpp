// Obstacles that move while a robot runs along its path: what they block of what is left.
#pragma once

#include <cstdint>
#include <vector>

#include "execution/time_law.hpp"
#include "world/world.hpp"

namespace optiplan {

// An obstacle where it was seen, and how it may go on: body of the world, pose there, and velocity of its frame, m/s.
// It may be anywhere within `spread` m per s of waiting from there.
struct Seen {
    int body;
    Pose X_WB;
    Vec3 velocity;
    double spread, time;  // time: of the law's clock, s
};

// The first place of the path at which a body may come too near, with the pair; pair -1: none does.
struct Blocked {
    double s;
    int pair;
};

// In each cell of the path the robot's bodies stand where they are in its middle, and no pair's distance changes by
// more than `travel` within the cell. A pair is clear in a cell if its distance exceeds that, and how far the obstacle
// may get from where it is in the middle of the time that the law takes for the cell.
class PathWatch {
  public:
    // The joints may be off the path by up to `error` (n,), rad or m; none: they are on it.
    PathWatch(const World &world, const Curve &path, double width, double begin, const std::vector<double> &error = {});

    std::int64_t bodies() const { return static_cast<std::int64_t>(of_body_.size()); }

    // What blocks the path from the law's place at `now` on to where it ends; the path begins at s = `begin` of the
    // law.
    Blocked blocked(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin);

  private:
    struct Cell {
        double begin, end;           // of the law's s
        std::vector<Pose> bodies;    // of `moving_`
        std::vector<Vec3> centres;
        std::vector<double> travel;  // of `pairs_`
    };

    const World &world_;
    std::vector<int> moving_;               // bodies that joints carry
    std::vector<int> pairs_;                // pairs of one of them with one that none carries
    std::vector<std::vector<int>> of_body_;  // of each body: places in `pairs_`
    std::vector<Cell> cells_;
    Placement at_;
};

}  // namespace optiplan
