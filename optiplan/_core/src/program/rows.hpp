// The inequalities of a curve at its samples: clearance of pairs of bodies, and torques.
#pragma once

#include <functional>
#include <memory>

#include "program/inverse_dynamics.hpp"
#include "program/samples.hpp"
#include "program/step.hpp"
#include "world/world.hpp"

namespace optiplan {

// Desired clearance, m: `middle`, but at most what the ends allow; see `Margins` of planners/trajopt/transcription.py.
struct Margins {
    double middle = 0.0;
    Vec start, end;  // (pairs,) clearance at the two ends

    double at(double u, int pair) const;
};

// What is near at samples: sample, value (clearance beyond the margin, m) and gradient (n,) of each row, rising
// samples.
struct NearRows {
    std::vector<int> sample;
    Vec value, gradient;
};

// At u (N,), Q (N, n).
using NearBodies = std::function<NearRows(const Vec &u, const Vec &Q)>;

// The rows of pairs nearer than `cutoff`, m, of a cluster's only the nearest ones to each body; those that penetrate at
// consecutive samples get the mean of their normals, for in deep penetration the nearest way out changes sides, and
// pushing a curve both ways at once leaves it in place. Memory is kept from call to call, answers are not. Not for two
// threads at once.
class RowSearch {
  public:
    RowSearch(const World &world, Margins margins, double cutoff)
        : world_(world), margins_(std::move(margins)), cutoff_(cutoff), fresh_(world.placement()), at_(fresh_),
          trail_(world.trail()) {}

    NearRows of(const Vec &u, const Vec &Q);

  private:
    const World &world_;
    Margins margins_;
    double cutoff_;
    Placement fresh_, at_;
    Trail trail_;
    std::vector<Contact> found_;
    std::vector<Pose> joints_;  // at all samples, one after another
};

// Where a torque is above its limit, or was when a step was refused: (samples, limited joints).
using Mask = std::vector<char>;

// Rows 1 - |tau| / limit >= 0 of joints and samples above a share of the limit, or watched.
//
// Where gravity can exceed a limit, tau at rest has rows, too: a motion that its drives cannot hold still is not made
// feasible by slowing it down. `still` is the limit of these, less a reserve, but what both ends need at least.
class TorqueRows {
  public:
    TorqueRows(const Tree &tree, Vec limit, Vec still);

    void of(const Spline &spline, const Samples &samples, const double *control, double duration, const Mask &watched,
            Inequalities &rows, Mask &exceeded);

    std::size_t limited() const { return which_.size(); }

  private:
    Vec holding(const Spline &spline, const double *control);
    bool near_the_limit(const Vec &limit, double least, const char *watched);
    void add(const Spline &spline, const Samples &samples, std::size_t sample, double duration, int orders,
             const Vec &limit, Inequalities &rows);

    InverseDynamics dynamics_;
    Vec limit_;               // (n,) N m or N; infinite where there is none
    Vec still_;               // (n,) the same of torques at rest; infinite where gravity exceeds none
    std::vector<int> which_;  // joints that have a limit
    bool heavy_;              // whether `still_` limits any
    Mask none_;               // of which_: nothing is watched at rest
    std::vector<std::size_t> near_;  // of which_: joints that get rows
    Vec motion_, tau_, share_, derivatives_;
};

}  // namespace optiplan
