// Numeric inverse kinematics: a frame of a tree is brought to a pose by damped least squares, within joint limits.
#pragma once

#include <array>
#include <vector>

#include "world/tree.hpp"

namespace optiplan {

// Constants of `optiplan/kinematics/ik/levenberg_marquardt.py`, where they are explained.
struct DescentRules {
    double converged;               // m and rad
    double damping, least_damping;  // of the squared error; at least
    double longest;                 // rad or m, of any joint in a step
    int patience;                   // steps
};

// The error is e = (p_G - p_F, log(R_WG R_WF^T)) in world axes, and its derivative is taken to be the Jacobian of the
// frame. Not for two threads at once.
class PoseDescent {
  public:
    // `joint` carries the frame at X_JF; of three rows only the position counts.
    PoseDescent(const Tree &tree, int joint, const Pose &X_JF, int rows, DescentRules rules);

    int joints() const { return tree_.planned; }

    // Moves q (n,), within the bounds (n,), towards the pose in at most `iterations` steps, until the error falls by
    // less than `gain` in `patience` of them; q is the best configuration met.
    void descend(const Pose &X_WG, const double *low, const double *high, int iterations, double gain, double *q);

  private:
    double linearise(const Pose &X_WG, const double *q);
    bool step(const double *low, const double *high, double damping, double *q);
    void solve(double damping);
    bool hold(const double *low, const double *high, const double *q);

    const Tree &tree_;
    int joint_, rows_;
    Pose X_JF_;
    DescentRules rules_;
    std::vector<int> chain_;  // joints that carry the frame
    std::vector<Pose> poses_;
    std::array<double, 6> e_{};
    std::vector<double> J_, step_, best_;  // columns of the Jacobian (n, 6)
    std::vector<char> held_;
};

}  // namespace optiplan
