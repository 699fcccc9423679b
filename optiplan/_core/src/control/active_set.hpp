// An exact answer of a small quadratic program from a guess of which constraints are active.
//
// The guess and its few changes: optiplan/control/qp/active_set.py. Where they do not lead to the solution, the dual
// method of Goldfarb and Idnani (Mathematical Programming 27, 1983) does, from the least without constraints: in each
// step the most violated constraint enters, and those whose multipliers would become negative on the way leave.
#pragma once

#include <cstdint>
#include <vector>

namespace optiplan {

// Minimise ½ x'H x + g'x with low <= C x <= high (m, n), lower <= x <= upper, A x = b (p, n).
struct SmallProgram {
    std::size_t n, m, p;
    const double *H, *g, *C, *low, *high, *lower, *upper, *A, *b;
};

struct ActiveSetRules {
    int changes;      // guesses that are tried
    double sign;      // multipliers above minus this, relative to the largest, count as not negative
    double touches;   // constraints nearer than this to their bound are as good as active
    double feasible;  // by how much equations of the guess may fail: more, and they depend on each other
};

class ActiveSet {
  public:
    // Active bounds as ±(joint + 1), active rows as ±(row + 1): plus for the upper end.
    std::vector<std::int64_t> bounds, rows;
    std::vector<double> x;

    // Whether the solution was found, which is then in x.
    bool solve(const SmallProgram &program, const ActiveSetRules &rules);

  private:
    bool from_guess(const SmallProgram &program, const ActiveSetRules &rules);
    bool from_nothing(const SmallProgram &program, const ActiveSetRules &rules);
    bool enter(const SmallProgram &program, bool bound, std::int64_t signed_index, bool equation, int &steps);
    void normal_of(const SmallProgram &program, bool bound, std::int64_t signed_index, bool equation, double *n,
                   double &b) const;
    void drop(std::size_t k);

    bool on_constraints(const SmallProgram &program, double feasible);
    bool enters(const SmallProgram &program, double touches, bool &bound, std::int64_t &found) const;

    std::vector<double> factor_, free_, N_, b_, Y_, S_, y_;
    struct Active {
        bool bound, equation;
        std::int64_t signed_index;
    };
    std::vector<Active> active_;  // of the dual method; rows of N_ and Y_, entries of y_
};

}  // namespace optiplan
