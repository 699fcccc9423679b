// What a proved path asks of the joints in each short part of it, for time laws along it.
#pragma once

#include <memory>
#include <vector>

#include "program/inverse_dynamics.hpp"
#include "world/sweep.hpp"

namespace optiplan {

// Of all joints (n,), without signs; infinite where there is none.
struct JointRates {
    std::vector<double> acceleration, jerk, torque;
};

// A stretch of the path up to `end` on which the robot carries the same: its dynamics there.
struct Load {
    double end;
    Tree tree;
};

// Ranges of p', p'' and p''' of the path p(s) in equal cells of s: low and high (count, n) of each.
struct Cells {
    double width = 0.0;
    int count = 0;
    std::vector<double> low[3], high[3];

    int at(double s) const;
};

// Sizes of a law that bound |tau''|: ds^2, |dds|, dds^2 and ds |ddds|.
struct LawSizes {
    double of[4];

    LawSizes(double speed, double rate, double jerk) : of{speed * speed, rate, rate * rate, speed * jerk} {}
};

// What a path asks of the joints. With speed ds = s', dds = s'' and ddds = s''' of a law s(t) (Verscheure et al. 2009):
//     q'   = p' ds,      q'' = p'' ds^2 + p' dds,      q''' = p''' ds^3 + 3 p'' ds dds + p' ddds,
//     tau  = a dds + b ds^2 + g,      a = M p',   b = M p'' + c(p, p'),   g gravity.
// A path that keeps the limits at ds = 1 keeps them at every steady ds in [0, 1], where gravity alone keeps them.
class PathTables {
  public:
    PathTables(Curve path, JointRates limits, std::vector<Load> loads, double width);

    // Of the same path from its end to its start, p(length - s): what is known in this direction, with other signs.
    PathTables mirrored() const;

    std::size_t joints() const { return static_cast<std::size_t>(path_.joints); }
    double length() const { return path_.breakpoints.back(); }
    const Cells &fine() const { return fine_; }
    const Cells &coarse() const { return coarse_; }
    const JointRates &limits() const { return limits_; }
    bool limits_torque() const { return torque_; }

    // Factors (coarse cells, 4, n) of the sizes of a law that add up to a bound on |tau''| in time, N m/s^2.
    void set_curvature(std::vector<double> factors) { curvature_ = std::move(factors); }
    double curvature(int coarse_cell, std::size_t joint, const LawSizes &law) const {
        if (curvature_.empty()) return 0.0;
        const double *at = curvature_.data() + coarse_cell * 4 * joints() + joint;
        return law.of[0] * at[0] + law.of[1] * at[joints()] + law.of[2] * at[2 * joints()] +
               law.of[3] * at[3 * joints()];
    }

    // Bounds on |p^(k)|, k from 0 to 4, in coarse cells: (5, coarse cells, n).
    std::vector<double> sizes() const;

    // a, b and g, (n,) each, at s, between their values at the ends of its coarse cell; of the load there.
    void torque_terms(double s, double *a, double *b, double *g) const;

    // Position and its first three derivatives in s, (4, n), of the piece before s if `before`, else of that after it;
    // s is clamped to the path.
    void derivatives(double s, double *out, bool before = false) const;

    // The first s beyond a place where torques may jump or turn sharply: a breakpoint, or another load; or infinity.
    double edge_after(double s) const;

    // tau (n,) of the load at s (before it, at a boundary, if `before`).
    void torques(double s, bool before, const double *q, const double *v, const double *a, double *tau) const;
    int load_at(double s, bool before) const;

    // The first s where gravity takes more than the limits, or -1.
    double overloaded() const;

  private:
    Cells cells_of(double width) const;
    template <class Use> void each_part(const Cells &cells, Use use) const;
    bool stands(double begin, double end, int cuts) const;

    Curve path_;
    JointRates limits_;
    std::vector<double> load_ends_;
    std::vector<std::shared_ptr<InverseDynamics>> dynamics_;
    Cells fine_, coarse_;
    std::vector<double> terms_;  // (coarse cells + 1, 3, n): a, b, g
    std::vector<double> curvature_;
    bool torque_ = false;
};

}  // namespace optiplan
