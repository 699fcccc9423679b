// Shorten a path of straight segments; every new segment is proved free.
#pragma once

#include <chrono>
#include <functional>
#include <vector>

#include "search/edges.hpp"

namespace optiplan {

using Configuration = std::vector<double>;
using Path = std::vector<Configuration>;
using Stop = std::function<bool()>;

// Cost of a motion, s: max_j |dq_j| / v_j + 0.1 ||dq / v||.
double path_time(const Configuration &a, const Configuration &b, const Configuration &velocity);

// Straighten all joints or one between two places along the path. A draw (3,), uniform in [0, 1), says where, and
// which.
void attempt_shortcut(EdgeChecker &check, Path &path, const Configuration &velocity, const double *draw);

// Remove each inner waypoint whose neighbours can be joined straight at no higher cost.
void drop_corners(EdgeChecker &check, Path &path, const Configuration &velocity, const Stop &stop);

}  // namespace optiplan
