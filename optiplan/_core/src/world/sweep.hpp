// Proof that a curve of piecewise polynomials is free at all times.
#pragma once

#include <vector>

#include "world/world.hpp"

namespace optiplan {

// Pieces between breakpoints (m + 1,): coefficients (m, degree + 1, n), lowest first, over the time since each begins.
struct Curve {
    std::vector<double> breakpoints, coefficients;
    int degree, joints;

    // Configuration in the middle of an interval within piece `piece`, and how far each joint goes from it at most
    // within `half`: sum_k |c_k| half^k, of the Taylor polynomial about the middle.
    void around(int piece, double middle, double half, double *q, double *reach) const;
};

struct SweepRules {
    double first;       // rad or m, summed over joints: length of the intervals that it begins with
    double margin;      // m, subtracted from every distance
    double resolution;  // s, half width below which an interval that is not proved free counts as a contact
    int most_cuts;      // parts of an interval that is cut
};

// A contact, or what could not be told from one: when, and which pair.
struct Touched {
    double t;
    int pair;
};

// An interval is free of a pair when the distance in its middle exceeds the bound on how far the pair travels to both
// ends; where it does not, it is cut into as many parts as the ratio of the two requires, and only such pairs are asked
// again. Before that, the pairs that are apart all along some intervals in a row are found, and not asked about in any
// of them. Not for two threads at once.
class Sweep {
  public:
    Sweep(const World &world, Curve curve, SweepRules rules);

    int intervals() const { return static_cast<int>(intervals_.size()); }

    // Whether anything touches in the middle of the intervals [begin, end); times where it begins to are appended.
    void look(int begin, int end, std::vector<double> &touching);

    // Prove the intervals [begin, end) free, or append contacts, one for intervals in a row that have one.
    void prove(int begin, int end, std::vector<Touched> &found);

  private:
    struct Interval {
        int piece;
        double middle, half;
    };

    Interval joined(int begin, int end) const;  // of intervals in a row

    // Puts the robot where it is in the middle of an interval.
    void stand_at(const Interval &interval);

    // The reaches of two bodies where the robot stands, computed when they are first asked for.
    void reach(int a, int b);
    double travel(int pair);
    double group_travel(int group);

    // The pairs that are asked in an interval.
    const std::vector<int> &suspects(int interval);

    // Pairs that are not seen to be apart all along a part of a piece: of all, or of those of `pairs`; rising.
    std::vector<int> near_along(const Interval &part);
    std::vector<int> near_along(const Interval &part, const std::vector<int> &pairs);
    bool apart(int pair);
    bool free(const Interval &interval, const std::vector<int> &pairs, Touched &touched);

    const World &world_;
    Curve curve_;
    SweepRules rules_;
    std::vector<Interval> intervals_;
    Placement at_;
    std::vector<double> q_, reach_, reaches_;
    std::vector<char> reached_;  // of each body
    std::vector<std::vector<int>> suspects_;  // of each interval
    std::vector<char> narrowed_;              // whether they are known
    Trail trail_;
    bool touched_ = false, before_ = false, failed_before_ = false;
};

}  // namespace optiplan
