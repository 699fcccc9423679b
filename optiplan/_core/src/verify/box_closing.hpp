// Proof that no motion shorter than T passes a box of configurations: all are in collision, or too far from both ends.
#pragma once

#include <cstdint>
#include <vector>

#include "world/tree.hpp"

namespace optiplan {

// All points within `radius` of a segment fixed to a joint, inside a body of the robot.
struct Rod {
    int joint;
    Vec3 ends[2];        // m, in the joint's frame
    double radius;       // m
};

// Rods inside one body, within a ball, and the boxes that the body must not touch.
struct RodBody {
    int joint;
    Vec3 centre;                   // m, in the joint's frame
    double radius;                 // m
    std::vector<int> rods, boxes;
};

// All points within `round` of a box, inside an obstacle that stands still.
struct ObstacleBox {
    int turn;            // its axes are those of this turn
    double centre[3];    // m, along these axes
    double half[3];      // m
    double round;        // m
};

// Rest to rest, of joints with limits of speed and acceleration.
struct Way {
    std::vector<double> start, goal, speed, acceleration, tolerance;  // within the last, rad or m, an end is reached
};

// What is known of a box of configurations: nothing shorter than T passes it; not known; or a part of it is so small
// that halving it once more would not help.
enum class Box : std::uint8_t { unknown = 0, closed = 1, passable = 2 };

class BoxClosing {
  public:
    // `turns`: rotations whose columns are axes of boxes, stored transposed. `arms` (2 M, J): greatest distances, m, of
    // the rods' ends from the axes of joints that carry them; 0 for the others.
    BoxClosing(const Tree &tree, std::vector<Rod> rods, std::vector<RodBody> bodies, std::vector<ObstacleBox> boxes,
               std::vector<Mat3> turns, std::vector<double> arms, Way way);

    // Whether each configuration of the box [low, high] (n,) is in collision, or passed by no motion shorter than T; by
    // halving the box into at most `most` parts.
    Box close(double T, const double *low, const double *high, std::int64_t most);

    int joints() const { return n_; }

  private:
    // What is nearest to a proof: a rod and a box, and the joint that hinders it most; -1: none.
    struct Hindrance {
        int rod = -1, box = -1, joint = -1;
    };
    struct End {  // of a rod, over one box of configurations, along the axes of one turn
        double wide[3];
        std::vector<double> slope;  // (J, 3)
    };

    bool within_time(double T, double *low, double *high) const;
    bool collides(const double *reach, bool roughly, Hindrance &found);
    void place(const double *centre);
    double bend(int end, const double *reach) const;
    void spread(int rod, const Mat3 &turn, const double *reach);

    Tree tree_;
    std::vector<Rod> rods_;
    std::vector<RodBody> bodies_;
    std::vector<ObstacleBox> boxes_;
    std::vector<Mat3> turns_;
    std::vector<double> arms_;
    Way way_;
    int n_, J_;
    std::vector<int> depth_, chain_;  // joints that carry each joint, as flags (J + 1, J)
    std::vector<Pose> poses_;
    std::vector<Vec3> axes_;
    std::vector<double> reach_, sway_;
    End ends_[2];
};

}  // namespace optiplan
