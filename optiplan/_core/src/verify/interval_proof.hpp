// Proof that bodies keep a distance at all times of a motion, each pair by separating planes on intervals of time.
#pragma once

#include <vector>

#include "verify/padded_points.hpp"
#include "world/sweep.hpp"

namespace optiplan {

// What is proved of a pair for all configurations in B boxes of the one or two joints that move it: see
// `KeptClearance` in optiplan/verify/continuous/kept_clearance.py. -1: no second joint.
struct KeptBoxes {
    int pair, joints[2];
    bool endless[2];
    std::vector<double> low, high, clearance;  // low and high (B, 2)

    // The clearance proved while the joints stay in [low, high] (n,); -infinity where there is none.
    double least(const double *low, const double *high) const;
};

struct IntervalRules {
    double clearance[2] = {0.0, 0.0};  // m, to be exceeded, of each kind of pairs
    double worth = 5e-3;      // m, beyond `clearance`: more is not proved
    double share = 0.5;       // of the distance in the middle beyond `clearance`: more is not proved
    double narrowest = 1e-7;  // s: on shorter intervals the proof is given up
    int most = 2000, most_of_piece = 8;  // intervals, and more a piece, after which it is given up
};

// What stopped a proof: everything before `time` is proved. pair -1: nothing did.
struct Verdict {
    int pair = -1;
    double time = 0.0, distance = 0.0;  // m, in the middle of the interval; a lower bound
    bool touches = false;               // nearer than the clearance there, rather than not proved
    double least[2] = {HUGE_VAL, HUGE_VAL};  // m, proved of all pairs of each kind up to `time`
    int intervals = 0, queries = 0;
};

// On an interval with middle m and half width h, where a plane with normal w separates a pair by the gap g at m, the
// pair is clear if the larger of two lower bounds of its distance exceeds the clearance:
//     g - travel           however the bodies move, with the joints anywhere in a box about the middle;
//     linear - loss        to first order in time along w, less what acceleration can take from it.
// Formulas: `Motion` in optiplan/verify/continuous/motion_bounds.py. The gap is that of the support functions of both
// bodies, computed here from their points, faces or radii: the search for w may be as inexact as it likes. Neighbouring
// pieces are looked at together first; what is open is divided. Meshes: planes between their hulls, else the distance
// of their triangles less `MESH_ROUNDING`.
class IntervalProof {
  public:
    static constexpr double ROUNDING = 1e-9, MESH_ROUNDING = 2e-6;  // m

    // `kinds` (pairs,): 0 or 1, for `Verdict::least`.
    IntervalProof(const World &world, std::vector<int> kinds, std::vector<KeptBoxes> kept);

    const World &world() const { return world_; }
    int kind(int pair) const { return kinds_[pair]; }

    // Puts a body that no joint carries.
    void move(int body, const Pose &X_WB);

    Verdict prove(const Curve &curve, const IntervalRules &rules);

    // Where obstacles stand; joints as in the last query.
    Placement &placement() { return at_; }

  private:
    struct Sides {
        int last[2];  // of bodies a and b: the joint below the one that carries both; 0: it stands still
        bool plane;   // a half-space takes part
        bool convex;
    };
    // Where the joints may be: pieces [first, last) together, or a part of one piece.
    struct Span {
        int first, last;
        double middle, half;  // of a part, s in the piece; half 0: of whole pieces
    };

    void build(const Curve &curve);
    void box_of(const Span &span);
    void stand();
    void lay(int body);
    double travel(int pair);
    double support(int body, const Vec3 &n) const;
    double gap(int pair, const Vec3 &n) const;
    double linear(int pair, const Vec3 &n, double half);
    double kept(int pair) const;
    bool settle(int pair, const Span &span);
    bool separated(int pair, double enough, double &bound);
    bool fail(int pair, const Span &span, double distance, bool touches);
    bool settled(int pair, double margin);
    bool prove_span(const Span &span, std::size_t begin, std::size_t end);

    World world_;
    std::vector<int> kinds_;
    std::vector<KeptBoxes> kept_;
    std::vector<int> kept_of_;  // of each pair: place in `kept_`, -1
    std::vector<Sides> sides_;
    std::vector<PaddedPoints> points_;  // of hulls
    Placement at_;
    const Curve *curve_ = nullptr;
    IntervalRules rules_;
    Verdict verdict_;
    std::vector<double> low_, high_;               // (pieces, n)
    std::vector<double> q_, reach_, v_, speed_, acceleration_;
    std::vector<double> lever_, travelled_;        // (bodies, joints)
    std::vector<char> laid_;                       // of each body
    std::vector<Vec3> normals_;                    // of each pair, from a to b; zero: none known
    std::vector<Features> features_;
    std::vector<int> open_;
};

}  // namespace optiplan
