// The certificate's own geometry: pairs of bodies proved apart on intervals of time by separating planes.
//
// Kinematics, support functions and bounds of motion are those of optiplan/verify/continuous, written once more for
// speed; nothing of the planners' world is used. A search for distances only proposes normals: whatever it returns, a
// gap is computed here, from the points of both bodies.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "convex/convex.hpp"
#include "verify/padded_points.hpp"

namespace optiplan {

// What is known of a body in its own frame: see `BodyShape` in optiplan/verify/continuous/bodies.py.
struct ProvedShape {
    Shape outline;                // proposes normals
    std::array<double, 5> round;  // h(n) = a . |n| + r ||(n_x, n_y)|| + s ||n||, without points
    PaddedPoints points;          // of a polyhedron or the hull of a mesh
    bool half_space = false;
    Vec3 normal;  // of a half-space, outwards
    double offset = 0.0;
};

struct ProvedBody {
    std::shared_ptr<const ProvedShape> shape;
    int joint;
    Pose X_JB;
    Vec3 centre, half;  // of a ball, and of a box along the body's axes, that hold it
    double radius;
};

// Joints 1 to J; 0 is the world. Positions are A q + b.
struct ProvedTree {
    std::vector<int> parents;
    std::vector<Pose> placements;
    std::vector<Vec3> axes;
    std::vector<char> turns;
    std::size_t planned;
    std::vector<double> coupling, offset;  // (J, n), (J,)
};

// `parts`: pairs that together say more of this one; `exact`: whether the outlines are the bodies.
struct ProvedPair {
    int a, b, kind;
    bool exact;
    std::vector<int> parts;
};

struct ProvedMotion {
    std::vector<double> breakpoints, coefficients, jump;  // (m + 1,), (m, degree + 1, n), (m, n)
    int degree;
};

// Intervals of pieces, with a half width h about a time since the piece begins, and the pairs to prove there.
struct ProvedIntervals {
    std::vector<int> piece;
    std::vector<double> middle, half;
    std::vector<int> common;             // pairs, on every interval
    std::vector<std::vector<int>> more;  // of each interval
};

struct PlaneRules {
    double asked, share, far;  // m: the clearance; share of the nearest distance beyond it; no more beyond it
    double cap[2];             // m, more is not proved of either kind
    double narrowest;          // s, shorter intervals are not looked at
    int most_intervals, most_queries;  // intervals, and normals proposed, after which the proof is given up
};

// The nearest of a kind in the middles of intervals: its gap, m, pair (-1: none), and when, s.
struct NearestGap {
    double gap = HUGE_VAL, time = 0.0;
    int pair = -1;
};

struct PlaneVerdict {
    bool given_up = false;  // bodies touch, or the work is too much
    double least[2] = {HUGE_VAL, HUGE_VAL};
    NearestGap nearest[2], hull[2];  // of bodies; of outlines that hold them
    std::vector<int> left_interval, left_pair;  // not proved; each once
    int intervals = 0, queries = 0;
};

// Not for two threads at once.
class PlaneProof {
  public:
    static constexpr double ROUNDING = 1e-9;  // m

    PlaneProof(ProvedTree tree, std::vector<ProvedBody> bodies, std::vector<ProvedPair> pairs);

    std::size_t planned() const { return tree_.planned; }
    std::size_t pairs() const { return pairs_.size(); }
    std::size_t bodies() const { return bodies_.size(); }

    // Puts a body elsewhere on its joint.
    void put(std::size_t body, const Pose &X_JB) { bodies_[body].X_JB = X_JB; }

    // The smallest gaps in the middles.
    PlaneVerdict scan(const ProvedMotion &motion, const ProvedIntervals &intervals, double asked);

    // Proves what it can; `measured` are the smallest distances known of both kinds, m.
    PlaneVerdict prove(const ProvedMotion &motion, const ProvedIntervals &intervals, const PlaneRules &rules,
                       const double measured[2]);

  private:
    struct Span {
        int piece;
        double middle, half;
    };
    struct Open {
        int pair, top;
    };
    enum class Answer { proved, halve, expand, left };

    void stand(const Span &span);
    const Pose &pose(int body);
    void lay(int body);
    double support(int body, const Vec3 &n);
    double gap(int pair, const Vec3 &n);
    bool balls_apart(int pair, double gap);
    double volumes(int pair);
    double travel(int pair);
    double linear(int pair, const Vec3 &n, double half);
    double propose(int pair);
    void meet(NearestGap &known, int pair, double gap, const Span &span);
    void probe(int pair, const Span &span);
    double target(int kind) const;
    Answer settle(int pair, const Span &span);
    bool proved(int pair, double margin);
    void prove_span(const Span &span, int interval, std::size_t begin, std::size_t end);

    ProvedTree tree_;
    std::vector<ProvedBody> bodies_;
    std::vector<ProvedPair> pairs_;
    std::vector<std::array<int, 2>> last_;  // of each pair: joint of either side below the one that carries both; 0
    std::vector<Vec3> normals_;             // the last ones of each pair; zero: none
    std::vector<Features> features_;
    const ProvedMotion *motion_ = nullptr;
    PlaneRules rules_{};
    PlaneVerdict verdict_;
    double measured_[2] = {HUGE_VAL, HUGE_VAL};
    std::vector<Pose> joints_, placed_;
    std::vector<Vec3> centres_;
    std::vector<char> posed_, laid_;
    std::vector<Vec3> axis_;
    std::vector<double> reach_, rate_, speed_, acceleration_, jump_;  // (J + 1,)
    std::vector<double> lever_, travelled_;                          // (bodies, J + 1)
    std::vector<double> planned_;                                    // scratch, (6, n)
    std::vector<Open> open_;
    std::vector<int> left_on_;  // of each pair: the interval on which it was left last; -1
};

}  // namespace optiplan
