// Sequential quadratic programming on a curve: l1 exact penalty, trust region, watchdog. The reference with the reasons is
// planners/trajopt/sqp.py; this does the same.
#pragma once

#include <functional>
#include <limits>
#include <memory>

#include "program/rows.hpp"

namespace optiplan {

// The constants of planners/trajopt/sqp.py, which says what they are.
struct SqpSettings {
    double contact_penalty, torque_penalty, centimetre;
    double first_radius, least_radius, shrink;
    double stuck, halved, worse, gap;
    int stalled, slow;
};

// A curve with its linearised inequalities and its merit.
struct CurvePoint {
    Vec control;  // (K, n)
    double duration = 0.0, merit = 0.0;
    Inequalities contacts, torques;
    Mask exceeded;
};

// One iteration of a descent: of the curve that it begins at, and the trust region; `accepted` as in iteration_log.py.
struct Iteration {
    double duration, merit, violation, radius, accepted;
};

// Why a descent ended, in the order of iteration_log.py.
enum class Ending { converged, trust_region, penetration, too_slow, step_limit, stopped, contact_between_samples };

struct Descent {
    CurvePoint point;
    int steps = 0;
    std::vector<Iteration> log;
    Ending ended = Ending::stopped;
};

class Sqp {
public:
    Sqp(std::shared_ptr<const Spline> spline, NearBodies near, TorqueRows torques, SqpSettings settings)
        : spline_(spline), near_(std::move(near)), torques_(std::move(torques)), settings_(settings), solver_(spline) {}

    const Spline &spline() const { return *spline_; }

    void set_samples(Samples samples);

    // Descend from control points until a step gains too little; `stop` is polled at every step. `go_on` is asked once, at
    // the first curve on which all rows hold where they did not on the initial one; its no ends the descent there.
    Descent optimise(const double *control, int iterations, const std::function<bool()> &stop, double best, double longest,
                     const std::function<bool(const CurvePoint &)> &go_on = {});

    // The curve at the least duration that its derivative control points allow, but at least `duration`.
    // `span`: scale of penalties and trust region, s; 0 for that duration.
    CurvePoint evaluate(Vec control, double duration, double &span);

private:
    Step solve(const CurvePoint &point, double radius);
    CurvePoint follow(const Step &step, const CurvePoint &from);
    void find_contacts(CurvePoint &point);
    bool watch(const Mask &exceeded);
    bool stalled(const Vec &missing) const;
    bool feasible(const CurvePoint &point) const;

    std::shared_ptr<const Spline> spline_;
    NearBodies near_;
    TorqueRows torques_;
    SqpSettings settings_;
    StepSolver solver_;
    Samples samples_;
    std::vector<Stencil> over_;  // position at each sample, over the free control points
    Mask watched_;
    double span_ = 0.0;
};

}  // namespace optiplan
