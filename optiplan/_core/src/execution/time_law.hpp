// Time laws s(t) along a proved path: the fastest admissible change from one speed to another.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "execution/path_tables.hpp"

namespace optiplan {

// Place on the path, speed, acceleration of the law: s, s', s''.
struct LawState {
    double s, ds, dds;

    LawState after(double t, double ddds) const;
};

// From `begin` on s is a cubic polynomial of time, up to the begin of the next.
struct LawPiece {
    double begin;
    LawState at;
    double ddds;
};

// After its last piece, which has neither acceleration nor jerk, the speed stays; s ends at the path's end.
struct TimeLaw {
    std::vector<LawPiece> pieces;

    const LawPiece &piece_at(double t) const;
    LawState at(double t) const;
    TimeLaw then(const TimeLaw &next) const;  // this law until the next one begins
    double settled() const { return pieces.back().begin; }  // from when on the speed stays
    double target() const { return pieces.back().at.ds; }
};

struct LawRules {
    double step;       // s: of the search; one piece of a law
    double look;       // s: intervals of the way to a steady speed, which every step must leave open
    double most_rate;  // of the law, |s''|, 1/s: where the path stands still nothing else bounds it
    double most_jerk;  // |s'''|, 1/s^2
    double reserve;    // share of the torque limits that the search leaves to the proof
};

// Searches laws, one piece of `step` after the other: of the strongest jerk from which a steady speed can still be
// reached. Every piece keeps the limits of acceleration and jerk by the ranges of its cells, at all its times. The
// limits of torque are kept where they are sampled; `holds` proves them.
class LawSearch {
  public:
    // The robot rests at the path's end, and at `end` if that is before.
    LawSearch(const PathTables &tables, LawRules rules, double end = HUGE_VAL)
        : tables_(tables), rules_(rules), end_(std::min(end, tables.length())) {}

    // From a state to a steady speed, in [0, 1]. False where the first step is not possible yet.
    bool change(const LawState &from, double begin, double target, TimeLaw &law) const;

    // The same from where a law is at a time, or as soon after that as limits leave room for it: up to then as before.
    // It holds torques, too.
    bool change_along(const TimeLaw &old, double now, double target, TimeLaw &law) const;

    // From rest at s to rest at the end, whatever the path does there: three pieces of one size of jerk, as short as
    // limits allow.
    bool rest_to_rest(double s, double begin, TimeLaw &law) const;

    // Whether torques hold at all times from t on, by their values and the bounds on their curvature; steady speeds
    // are known to, if the path is `planned`.
    bool holds(const TimeLaw &law, double from, bool planned = true) const;

  private:
    bool allowed(const LawState &at, double ddds, double lasting, const Cells &cells, bool torque) const;
    bool allowed_along(const LawState &at, double ddds, double lasting) const;
    bool holds_between(const LawState &begin, const LawState &end, double ddds, double width,
                       const std::vector<double> (&ends)[2]) const;
    double strongest(const LawState &at, double direction) const;
    bool begins(const LawState &at, double target, double &direction, double &off) const;
    bool levels_off(const LawState &at, double direction, double target, double &ddds) const;

    const PathTables &tables_;
    LawRules rules_;
    double end_;
    mutable std::vector<double> terms_;  // of torque
    mutable std::size_t gentle_ = 0;     // the share of the strongest jerk that led to a steady speed last
};

}  // namespace optiplan
