// One step of the optimisation: the linearised program around a curve, inside a trust region, solved.
#pragma once

#include <memory>

#include "program/arrow_qp.hpp"
#include "program/spline.hpp"

namespace optiplan {

// Linearised inequalities g + dg >= 0 at samples of the curve; a sample's rows share a slack that costs `price`, s, for
// each `unit` of g.
struct Inequalities {
    double price = 0.0, unit = 1.0;
    bool compact = true;        // whether `entries` are derivatives by the configuration, or by the control points
    std::vector<int> sample;    // (K,) rising
    Vec value, by_duration;     // (K,) g, dg/dT
    Vec entries;                // (K, n) dg/dq, or (K, REACH n) dg/dC of the free control points `first`, …
    std::vector<Stencil> over;  // (samples,) basis at each sample over the free control points

    std::size_t width(std::size_t joints) const { return compact ? joints : REACH * joints; }

    // Sum over the samples of the worst violation of each.
    double violation() const;

    double cost() const { return price * violation() / unit; }
};

// Costs beside time and jerk, linearised at the curve: derivatives by the free control points (M, n) and by T, second
// ones as far as they couple a joint with itself (M, REACH, n), and by T alone. Empty: none.
struct SmoothCosts {
    Vec gradient, hessian;
    double gradient_t = 0.0, hessian_t = 0.0;
};

struct Step {
    bool solved = false;
    int iterations = 0;
    Vec control;            // (K, n)
    double duration = 0.0;  // s
    double promise = 0.0;   // predicted decrease of the merit, s
};

// Builds and solves the programs of one curve; formulas and units are those of planners/trajopt/qp.py.
class StepSolver {
  public:
    explicit StepSolver(std::shared_ptr<const Spline> spline) : spline_(std::move(spline)) {}

    const Spline &spline() const { return *spline_; }

    // One step from (control (K, n), duration) with control points moved by at most `radius` v_j `span` each.
    // `gap`: how far from the best, as a share of T, the step may end, on the central path. Of the many steps that are
    // nearly the best a central one keeps away from rows that do not matter yet, and leads on better than the best.
    Step solve(const double *control, double duration, const std::vector<const Inequalities *> &soft, double radius,
               double span, double gap, const SmoothCosts &costs = {});

  private:
    void bound(const double *control, double duration, double radius);
    void shape(const double *control, double duration);
    void add_costs(const SmoothCosts &costs, double duration);
    void soften(const std::vector<const Inequalities *> &soft, double duration, double radius);
    double predicted(const ArrowSolution &found) const;

    std::shared_ptr<const Spline> spline_;
    ArrowProgram program_;
    ArrowQp qp_;
    Vec scale_;  // v_j span: unit of the program's variables
    // The program has as many joints as fill whole vectors; those that no robot has cost nothing and stay.
};

}  // namespace optiplan
