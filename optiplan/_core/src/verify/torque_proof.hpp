// Proof that the torques of a motion keep their limits at all times, from their values and a bound on their curvature.
#pragma once

#include <vector>

#include "program/inverse_dynamics.hpp"
#include "world/sweep.hpp"

namespace optiplan {

// On an interval of width w, |tau| is at most the larger value of its ends plus w^2 / 8 max |tau''|. That maximum is
// bounded by Newton's and Euler's equations with norms in place of vectors, differentiated twice: formulas and reasons
// are in optiplan/verify/continuous/torque_bounds.py.
class TorqueProof {
  public:
    // `armature` (planned,): kg m^2 or kg, of the motors.
    TorqueProof(const Tree &tree, std::vector<double> armature);

    // The joint whose torque is not proved within `limits` (n,), and where; joint -1: there is none.
    struct Overload {
        int joint = -1;
        double time = 0.0, value = 0.0;
    };
    Overload overload(const Curve &curve, const std::vector<double> &limits);

    // Bounds over an interval on the sum of all that adds up to tau_j and on |tau_j''|, (n,) each, from bounds
    // `motion` (5, n) on |q_j^(k)|.
    void bounds(const double *motion, double *size, double *curvature);

    std::size_t joints() const { return static_cast<std::size_t>(tree_.planned); }

  private:
    bool part(const Curve &curve, int piece, double begin, double width, const double *left, const double *right,
              const std::vector<double> &limits, int depth, Overload &found);
    void torques(const Curve &curve, int piece, double local, double *tau);

    Tree tree_;
    InverseDynamics dynamics_;
    std::vector<double> armature_, offset_, lever_, inertia_;
    double gravity_;
    int intervals_left_ = 0;
    std::vector<double> q_, turn_, fixed_, axis_, origin_, force_, moment_;  // (orders, joints)
};

}  // namespace optiplan
