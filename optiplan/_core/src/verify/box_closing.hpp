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

// Where each joint can be in each of `steps` equal steps of the time of a motion from rest to rest, both (n, steps).
struct Corridor {
    const double *low, *high;  // rad or m
    int steps;
};

// What is known of a box of configurations: nothing shorter than T passes it; not known; or one of its configurations
// cannot be closed, since no rod meets a box there, or a part of it is so small that halving it would not help.
enum class Box : std::uint8_t { unknown = 0, closed = 1, passable = 2 };

class BoxClosing {
  public:
    // `turns`: rotations whose columns are axes of boxes, stored transposed. `arms` (2 M, J): greatest distances, m, of
    // the rods' ends from the axes of joints that carry them; 0 for the others.
    BoxClosing(const Tree &tree, std::vector<Rod> rods, std::vector<RodBody> bodies, std::vector<ObstacleBox> boxes,
               std::vector<Mat3> turns, std::vector<double> arms);

    // The motions that boxes are closed for are all within the corridor.
    void keep_within(const Corridor &corridor);

    // Whether each configuration of the box [low, high] (n,) is in collision, or passed by no motion within the
    // corridor; by halving the box into at most `most` parts.
    Box close(const double *low, const double *high, std::int64_t most);

    int joints() const { return n_; }

  private:
    // What is nearest to a proof: a rod and a box that meet in the middle, and the joint that hinders the proof most;
    // -1: none.
    struct Hindrance {
        int rod = -1, box = -1, joint = -1;
        double effort = 0.0;
    };
    struct End {  // of a rod, over one box of configurations, along the axes of one turn
        double wide[3];
        std::vector<double> slope;  // (J, 3)
    };

    bool within_time(double *low, double *high) const;
    bool collides(const double *reach, bool roughly, Hindrance &found);
    bool passes(const double *q);
    void place(const double *centre);
    double bend(int end, const double *reach) const;
    void spread(int rod, const Mat3 &turn, const double *reach);

    Tree tree_;
    std::vector<Rod> rods_;
    std::vector<RodBody> bodies_;
    std::vector<ObstacleBox> boxes_;
    std::vector<Mat3> turns_;
    std::vector<double> arms_;
    int n_, J_;
    int steps_ = 0;
    // The highest position of each joint up to and from each step, and the lowest ones: (n, steps).
    std::vector<double> highest_before_, highest_after_, lowest_before_, lowest_after_;
    std::vector<int> depth_, chain_;  // joints that carry each joint, as flags (J + 1, J)
    std::vector<Pose> poses_;
    std::vector<Vec3> axes_;
    std::vector<double> reach_, sway_, point_;
    End ends_[2];
};

}  // namespace optiplan
