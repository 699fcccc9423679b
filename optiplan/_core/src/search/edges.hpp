// Whether straight segments between configurations are free: proved, or looked at here and there.
#pragma once

#include <memory>
#include <vector>

#include "world/many_checks.hpp"

namespace optiplan {

// Constants of the proof; m, or rad or m for `heavy_step`.
struct EdgeRules {
    double first;       // initial subdivision: no pair travels farther within half a part
    double margin;      // added to the travel of a part
    double least;       // of travel; a part not proved free by then counts as blocked
    int most;           // configurations looked at; a motion that takes more counts as blocked
    double heavy_step;  // largest joint, between checks of gravity
    double spacing =
        0.0;  // m; 0: segments are proved. Else they are looked at in configurations between which no body
              // travels farther, four at a time, which takes a fifth of the time: for worlds of `ManyChecks`
};

// Half a part of a motion, of length |d_j| in each joint, moves the bodies of pair p against each other by at most
// t_p = sum_j arms[p][j] |d_j|, or by what bounds the travel from the middle of the part (`World::travel`), where that
// is less. The part is free of the pair when its distance in the middle of the part exceeds t_p; else the part is cut
// in two, and only such pairs are asked again. Not for two threads at once.
class EdgeChecker {
  public:
    // `arms` (P, n); `torque` (n,) that gravity may take of each joint, empty for any.
    EdgeChecker(const World &world, std::vector<double> arms, std::vector<double> torque, EdgeRules rules);

    const World &world() const { return world_; }
    int joints() const { return world_.tree().planned; }

    // Whether q (n,) collides or exceeds the torque limits.
    bool blocked(const double *q);

    // Whether the segment from a to b (n,) is proved free; `a` known not to be blocked.
    bool free(const double *a, const double *b);

    // Whether all segments between waypoints (k, n) are.
    bool polyline_free(const double *waypoints, int count);

  private:
    struct Part {
        double middle;
        std::size_t begin, end;  // of the pairs that are still to be proved; of none: all pairs
    };

    bool too_heavy();
    bool heavy_along(const double *a, const double *d);
    bool apart(const double *a, const double *d);
    bool apart_here_and_there(const double *a, const double *d);
    double measure_travel(const double *d);
    void reach(int a, int b);

    const World &world_;
    std::vector<double> arms_, torque_;  // arms by joint: (n, P)
    EdgeRules rules_;
    Placement at_;
    Trail trail_;
    std::vector<double> q_, d_, travel_, together_, held_, half_d_, reaches_;
    std::vector<char> reached_;  // of each body, whether `reaches_` holds it
    std::unique_ptr<ManyChecks> looks_;  // where segments are not proved
    std::vector<double> most_, four_;  // of each joint the longest of `arms_`; four configurations (4, n)
};

}  // namespace optiplan
