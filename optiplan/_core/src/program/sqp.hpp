// What a descent asks of a curve among bodies, within torques: its merit, the next step, and the curve at its end.
// The loop is planners/trajopt/program/sqp.py.
#pragma once

#include <functional>
#include <memory>

#include "program/rows.hpp"

namespace optiplan {

// The constants of planners/trajopt, which says what they are.
struct SqpSettings {
    double contact_penalty, torque_penalty, centimetre, gap;
};

// A curve with its linearised inequalities and its merit.
struct CurvePoint {
    Vec control;  // (K, n)
    std::size_t joints = 0;
    double duration = 0.0, merit = 0.0;
    Inequalities contacts, torques;
    Mask exceeded;

    double missing() const { return contacts.violation(); }  // m, over all samples
    double nearest() const;  // least clearance beyond its margin, m; infinite without any
    bool feasible() const;
};

class Sqp {
  public:
    Sqp(std::shared_ptr<const Spline> spline, NearBodies near, TorqueRows torques, SqpSettings settings)
        : spline_(spline), near_(std::move(near)), torques_(std::move(torques)), settings_(settings),
          solver_(std::move(spline)) {}

    const Spline &spline() const { return *spline_; }

    void set_samples(Samples samples);

    // The curve of control points (K, n) at its least duration, which is the scale of penalties and trust region from
    // now on.
    CurvePoint begin(const double *control);

    // The curve at the least duration that its derivative control points allow, but at least `duration`.
    // `span`: scale of penalties and trust region, s; 0 for that duration.
    CurvePoint evaluate(Vec control, double duration, double &span);

    Step solve(const CurvePoint &point, double radius);
    CurvePoint follow(const CurvePoint &from, const Step &step);

    // Torques that are too large at the end of a refused step get rows from now on.
    void watch(CurvePoint &point, const CurvePoint &trial);

  private:
    void find_contacts(CurvePoint &point);

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
