// Torques of a motion and their derivatives, in world coordinates.
#pragma once

#include <vector>

#include "program/sums.hpp"
#include "world/tree.hpp"

namespace optiplan {

// A spatial vector: angular and linear part of a twist at the world's origin, or moment about it and force.
struct Spatial {
    Vec3 angular, linear;

    Spatial &operator+=(const Spatial &b) {
        angular += b.angular, linear += b.linear;
        return *this;
    }
};

// Spatial inertia about the world's origin: mass, mass times centre, rotational inertia.
struct SpatialInertia {
    double mass = 0.0;
    Vec3 moment;
    Mat3 rotational{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
};

// B of a body, with 2 B = (v x*) I - I (v x) + (I v) x-bar*: it takes a twist to the wrench (turning w, 2 w x
// momentum), with w the twist's angular part. The linear part gives nothing.
struct Coriolis {
    Mat3 turning;
    Vec3 momentum;  // linear
};

// tau(q, v, a) of all planned joints by recursive Newton-Euler, and its derivatives by the formulas of Singh, Russell
// and Wensing (Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra, RA-L 2022).
class InverseDynamics {
  public:
    explicit InverseDynamics(const Tree &tree);

    std::size_t joints() const { return static_cast<std::size_t>(tree_.planned); }

    // tau (n,) at q, v, a (n,): N m or N.
    void torques(const double *q, const double *v, const double *a, double *tau);

    // tau (n,) that holds the robot still where it was in the last call of `torques`.
    void at_rest(double *tau);

    // Derivatives (n, n) by q, v and a at the state of the last call of `torques`.
    void derivatives(double *by_q, double *by_v, double *by_a);

  private:
    void pass_down(std::vector<Spatial> &wrenches, double *tau) const;  // from each link to those that carry it
    Coriolis coriolis(int joint) const;

    Tree tree_;
    std::vector<Pose> pose_;
    std::vector<Spatial> axis_, twist_, acceleration_, force_, axis_rate_, carried_, held_;
    std::vector<Spatial> lift_;  // what the motion of a joint changes in the acceleration of all that it carries
    std::vector<SpatialInertia> inertia_, composite_;
    std::vector<Coriolis> coriolis_;  // of all that a joint carries
};

}  // namespace optiplan
