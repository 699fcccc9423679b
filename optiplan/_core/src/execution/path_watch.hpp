// Obstacles that move while a robot runs along its path: what they block of what is left.
#pragma once

#include <cstdint>
#include <utility>
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

// A place of the path at which a body may come too near, with the pair, and by how much their distance exceeds what is
// needed there, m; pair -1: none does.
struct Blocked {
    double s;
    int pair;
    double slack;
};

// In each cell of the path the robot's bodies stand where they are in its middle, and no pair's distance changes by
// more than `travel` within the cell. A pair is clear in a cell if its distance exceeds that, and how far the obstacle
// may get from where it is in the middle of the time that the law takes for the cell.
class PathWatch {
  public:
    // The joints may be off the path by up to `error` (n,), rad or m; none: they are on it.
    PathWatch(World &world, const Curve &path, double width, double begin, const std::vector<double> &error = {});

    const Pair &pair(int index) const { return world_.pairs()[index]; }
    std::int64_t bodies() const { return static_cast<std::int64_t>(world_.bodies().size()); }

    // Adds an obstacle that the path was not proved against, and returns its index.
    int add(Body body) { return world_.add(std::move(body)); }

    // What blocks the path from the law's place at `now` on to where it ends; the path begins at s = `begin` of the
    // law. Where the robot stands still, obstacles go on as they are seen to for `linger` s; what they stray does not
    // grow then: a robot that stands still has done what it can.
    Blocked blocked(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin,
                    double linger = 0.0);

    // Where on this way the least is left of the distance, of what is below `most`, m.
    Blocked nearest(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin, double most) {
        return search(law, now, obstacles, margin, most, false);
    }

  private:
    struct Cell {
        double begin, end;           // of the law's s
        std::vector<Pose> bodies;    // of `moving_`
        std::vector<Vec3> centres;
        std::vector<double> travel;  // beside what stands
    };
    struct Watched {
        int pair, mover;  // of the world; place in `moving_`
    };

    // The first place, or that of the least, at which no more than `most` is left.
    Blocked search(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin, double most,
                   bool first);
    void take_up();  // what other watches added to the world
    void watch(int pair);
    void put(const Seen &seen, double t);
    int struck(double here, double from, const Seen &seen, double margin, double linger);

    World &world_;
    std::vector<int> moving_;                    // bodies that joints carry
    std::vector<std::vector<Watched>> of_body_;  // of each body that none carries: its pairs with them
    std::vector<Cell> cells_;
    Placement at_;
    int watched_ = 0;  // pairs of the world that are known here
};

}  // namespace optiplan
