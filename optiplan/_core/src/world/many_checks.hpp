// Which of many configurations are in collision.
#pragma once

#include <cstdint>
#include <vector>

#include "world/lanes.hpp"
#include "world/world.hpp"

namespace optiplan {

// `World::collides` of many configurations: balls and boxes are compared for four of them at a time, and only pairs
// that these do not separate are queried one by one, block by block. For worlds without tube and floors.
class ManyChecks {
  public:
    explicit ManyChecks(const World &world);

    // Whether pairs touch at configurations (count, n), row after row: 1 or 0 each.
    void touching(const double *Q, std::size_t count, std::uint8_t *out);

    // Whether pairs touch at one of four configurations (4, n). Pairs that touched often come first.
    bool any_touches(const double *Q) { return look(Q, true) != 0; }

    // Poses of the joints at configuration `lane` of the four that were asked last.
    void joints(int lane, Pose *out) const;

  private:
    struct Balls {
        int a, b;        // bodies
        double squared;  // of both radii together, a hair more
        double ball_a, ball_b;  // the squared radius of each, a hair more; infinite where the other has no box
        int asked;       // pair, or the group as ~group
    };
    struct Plane {
        int body, pair;
        Vec3 normal;
        double offset;  // of its surface from the origin, and the radius of the body, a hair more
    };

    // Find which of four configurations (4, n) touch, a bit each, or only the first one found.
    unsigned look(const double *q, bool any_of_them);
    void place(const double *q);
    LaneBits near_balls(std::size_t first);
    LaneBits near_plane(const Plane &plane) const;
    bool asked_apart(int lane, int asked);
    LaneBits apart_from_box(int ball, double squared, int box);
    const PoseLanes &turned(int body);

    const World &world_;
    std::vector<int> moving_;  // bodies whose balls are compared
    std::vector<Balls> balls_;
    std::vector<Plane> planes_;
    std::vector<PoseLanes> joints_;
    std::vector<Vec3Lanes> centres_;  // of bodies
    std::vector<PoseLanes> bodies_;   // where `turned` says so; of their places the turns alone
    std::vector<char> turned_;
    std::vector<Placement> at_;       // of each configuration, where `placed_` says so
    bool placed_[LANES] = {};
    Trail trail_;
};

}  // namespace optiplan
