// How much of the torque that gravity leaves a motion takes.
#pragma once

#include "program/inverse_dynamics.hpp"
#include "world/sweep.hpp"

namespace optiplan {

// max_j |tau_j - g_j| / (allowed_j -+ g_j) of the curve at each of the times (rising, within it): the square of the
// slow-down that it asks for. Infinite where gravity alone takes more than is allowed.
std::vector<double> torque_demand(InverseDynamics &dynamics, const Curve &curve, const std::vector<double> &allowed,
                                  const double *times, std::size_t count);

}  // namespace optiplan
