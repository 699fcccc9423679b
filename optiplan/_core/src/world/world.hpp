// A robot among obstacles: bodies on the joints of a tree, and the pairs of them that must stay apart.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "convex/convex.hpp"
#include "world/parts.hpp"
#include "world/tree.hpp"

namespace optiplan {

// A body, enclosed by a box along the axes of its own frame and by the ball about that box's centre.
struct Body {
    int joint;                    // that carries it
    Pose X_JB;
    std::vector<Shape> shapes;    // one; of a mesh two: its hull, then its triangles
    std::vector<ConvexPart> parts;  // that together hold it
    Vec3 centre, half;            // of the box
    double radius;                // of the ball
    bool half_space = false;      // without bounds: {x | normal . x <= offset}
    Vec3 normal;
    double offset = 0.0;

    const Shape &outline() const { return shapes.front(); }
    const Shape &solid() const { return shapes.back(); }
    bool mesh() const { return shapes.size() > 1; }
};

struct Pair {
    int a, b;
    bool by_outline;  // a mesh takes part, and no half-space: hulls are asked first
};

// Bodies that one joint carries, many of them, in a hull of their own: what that is apart from, they all are.
struct Cluster {
    Body hull;                 // of all of them
    std::vector<int> members;
};

// A body of a cluster as the ball about its box tells it: what is near is found without placing all others.
struct Member {
    int pair;       // with the other body of the group
    Vec3 centre;    // on the joint that carries the cluster
    double radius;  // of its ball
};

// The pairs of a cluster's bodies with one other body.
struct Together {
    int hull, other;              // bodies, the hull behind all others
    int common;                   // the last joint that carries both
    std::vector<Member> members;  // by rising pairs
    double taken = 0.0;           // m; the most that tube and floor take of the distance of its pairs
    double floor = 0.0;           // m; the most of its pairs' floors
    double rise = 0.0;            // m/rad or 1; the most of its pairs' rises
};

// Joints may be off where they are put, by up to `error` (n,), rad or m; `most` (pairs,), m, bounds what that takes of
// the distance of each pair anywhere; 0 where it takes nothing.
struct TubeError {
    std::vector<double> error, most;
};

// A floor about the configuration q (joints,) of an end: `base`, m, there, growing by `rise`, m/rad or 1, on the way of
// the joints that count for its pair; q is nan for the others.
struct EndFloor {
    int pair;
    double base, rise;
    std::vector<double> q;
};

// The distance that each pair keeps (pairs,), m, and less about ends of the motion: the least of what is asked and
// base + rise sum_j |q_j - q_e,j| of the joints that count; none where `asked` is empty.
struct Floors {
    std::vector<double> asked;
    std::vector<EndFloor> ends;
};

// A pair at configuration `row`; normal . (b - a) = distance.
struct Contact {
    int row, pair;
    Witness witness;
};

// Along configurations that are asked one after another: where bodies were nearest, or apart, when they were last
// asked.
struct Trail {
    std::vector<Features> pairs, groups;        // of each pair, and of the hull of each group
    std::vector<std::pair<double, int>> asked;  // lower bound and pair, of those of a group that are asked

    Trail(std::size_t pairs, std::size_t groups) : pairs(pairs), groups(groups) {}

    void forget() {
        std::fill(pairs.begin(), pairs.end(), Features{});
        std::fill(groups.begin(), groups.end(), Features{});
        asked.clear();
    }
};

// From the nearest point of a box about the origin, with these half edges, to p.
inline Vec3 outside_box(const Vec3 &p, const Vec3 &half) {
    return {std::max(std::fabs(p.x) - half.x, 0.0), std::max(std::fabs(p.y) - half.y, 0.0),
            std::max(std::fabs(p.z) - half.z, 0.0)};
}

// What may be left out of the pairs that are near.
struct Sketch {
    double window = HUGE_VAL;   // m; pairs of a group that are farther apart than its nearest one by more than that
    double gap = kDistanceGap;  // m; digits of the distances of curved bodies
};

// Where everything is at one configuration.
struct Placement {
    std::vector<Pose> joints, bodies;
    std::vector<Vec3> centres;
    std::vector<double> q;     // (planned,), where floors ask for it
    std::vector<char> placed;  // of each body: whether it is where the joints put it; bodies of clusters may wait
    mutable std::vector<double> reaches;  // of bodies as `World::reach`, where `reached` says so: asked for by tubes
    mutable std::vector<char> reached;
    int touching = 0;  // the pair that touched last is asked first: answers come sooner, and are the same
};

// With a tube, every distance and bound of one is less by what joints off their place can take of it; with floors it is
// what is left above them. Gradients are those of distances: floors change by at most `rise`.
class World {
  public:
    // `never`: pairs that are apart wherever the joints stand: `collides`, `near` and what visits `alone` and `groups`
    // leave them out.
    World(Tree tree, std::vector<Body> bodies, const std::vector<std::pair<int, int>> &pairs,
          const std::vector<Cluster> &clusters = {}, const std::vector<int> &never = {}, TubeError tube = {},
          Floors floors = {});

    // Adds a body that no joint carries, with a pair with each body of the robot that a joint carries; returns its
    // index. Only those who name its pairs ask for them: no search, sweep or `near` does.
    int add(Body body);

    const Tree &tree() const { return tree_; }
    const std::vector<Pair> &pairs() const { return pairs_; }
    const std::vector<Body> &bodies() const { return bodies_; }  // then hulls of clusters, then what was added
    const std::vector<Together> &groups() const { return groups_; }
    const std::vector<int> &alone() const { return alone_; }           // pairs without a group that are asked
    int group_of(int pair) const { return group_of_[pair]; }           // -1: none

    // The last joint that carries both bodies of a pair: it does not change their distance.
    int common(int pair) const { return common_[pair]; }

    // Puts a body that a joint carries, and that is in no cluster, at another pose on it.
    void move_body(int body, const Pose &X_JB) { bodies_[body].X_JB = X_JB; }

    Placement placement() const;
    Trail trail() const { return {pairs_.size(), groups_.size()}; }
    void place(const double *q, Placement &at) const;

    // As `place`, but bodies of clusters only when `open` puts them there.
    void place_outside(const double *q, Placement &at) const;

    // Lower bound, m, of a pair's distance: from the ball of one body to the box of the other, both ways, or one way
    // where that exceeds `enough`.
    double lower_bound(const Placement &at, int pair, double enough = HUGE_VAL) const;

    // Whether the balls are farther apart than `gap`: the first and cheapest test.
    bool balls_apart(const Placement &at, int pair, double gap) const {
        const auto [a, b, by_outline] = pairs_[pair];
        if (plain_) return balls_apart_of(at, a, b, gap);
        return balls_apart_of(at, a, b, gap + most_[pair]) ||
               (balls_apart_of(at, a, b, gap) && balls_apart_of(at, a, b, gap + taken(at, pair)));
    }

    // Whether all pairs of a group are apart by more than `gap`, m, because the hull of its cluster is.
    bool group_apart(const Placement &at, int group, double gap, Features *features = nullptr) const;

    // Asks `group_apart` once a group, at one placement: whether a pair is apart by its group's `gap`, m. Where that
    // does not tell, its bodies are in place afterwards.
    template <class Gap>
    bool settled(Placement &at, int pair, std::vector<char> &known, const Gap &gap,
                 Features *features = nullptr) const {
        const int group = group_of_[pair];
        if (group >= 0) {
            Features *known_before = features ? features + group : nullptr;
            if (!known[group]) known[group] = group_apart(at, group, gap(group), known_before) ? APART : NEAR;
            if (known[group] == APART) return true;
        }
        open(at, pair);
        return false;
    }

    // Visits the pairs of a group whose member's ball is not farther than `gap`, m, from the other body's box, with
    // their bodies in place.
    template <class Visit> void visit_near(Placement &at, const Together &group, double gap, const Visit &visit) const {
        const Body &other = bodies_[group.other];
        const Pose X = relative(at.bodies[group.other], at.joints[bodies_[group.hull].joint]);
        for (const Member &member : group.members) {
            const double reach = member.radius + gap + group.taken;
            if (squared_norm(outside_box(X * member.centre - other.centre, other.half)) > reach * reach) continue;
            open(at, member.pair);
            visit(member.pair);
        }
    }

    // Puts the bodies of a pair in place, where `place_outside` has not.
    void open(Placement &at, int pair) const {
        if (!clustered_[pair]) return;
        for (int body : {pairs_[pair].a, pairs_[pair].b})
            if (!at.placed[body]) place_body(body, at);
    }

    // No body is where the joints put it; and those of a pair, or of a group's balls, are, whatever was placed before.
    void forget(Placement &at) const { std::fill(at.placed.begin(), at.placed.end(), 0); }
    void put(Placement &at, int pair) const { put_bodies(at, pairs_[pair].a, pairs_[pair].b); }
    void put(Placement &at, const Together &group) const { put_bodies(at, group.hull, group.other); }

    // Whether a pair is told to be apart by more than `gap`, m: by balls and boxes, and by the outlines of the bodies.
    bool boxes_apart(const Placement &at, int pair, double gap) const {
        return balls_apart(at, pair, gap) || lower_bound(at, pair, gap) > gap;
    }
    bool outlines_apart(const Placement &at, int pair, double gap, Features *features = nullptr) const;

    // Whether a pair is nearer than a margin, m. Above WIDE the hull of a mesh is asked in its place; below, hulls of
    // its parts before its triangles.
    bool within(const Placement &at, int pair, double margin, Features *features = nullptr) const;

    // `trail`: of configurations not far from this one; with `pairs`, only they are asked.
    bool collides(Placement &at, Trail *trail = nullptr) const;
    bool collides(Placement &at, const std::vector<int> &pairs, Trail &trail) const;

    // Every pair nearer than `cutoff`, m. Where a body is a mesh, distance and points are the hulls' if these are
    // farther apart than SETTLED, and if the bodies touch: triangles do not tell how deep, or which way is out.
    void near(Placement &at, int row, double cutoff, std::vector<Contact> &found, Trail &trail,
              const Sketch &sketch = {}) const;

    // Distance and points of a pair as `near` tells them; above the cutoff, only that it is.
    Witness nearest_points(const Placement &at, int pair, double cutoff, Features *features = nullptr,
                           double gap = kDistanceGap) const;

    // The nearest pair of all; -1 where there are no pairs.
    Contact nearest(const Placement &at) const;

    // Distance of a pair; of meshes that of their triangles.
    Witness distance(const Placement &at, int pair, double cutoff) const;

    // d(distance)/dq (n,) = n . (J_b - J_a), with J the linear Jacobian of the nearest point, where the joints are at
    // `joints`.
    void gradient(const Pose *joints, const Contact &contact, double *out) const;

    // Distance of the farthest corner of a body's box from the axis of each joint that carries it, m, and 0 for other
    // joints: (joints,); of all bodies: (bodies, joints).
    void reach(const Placement &at, int body, double *out) const;
    void reaches(const Placement &at, std::vector<double> &out) const;

    // How fast the floor of a pair changes on the way at most, m/rad or 1.
    double rise(int pair) const { return rises_.empty() ? 0.0 : rises_[pair]; }

    // Bound, m, on the change of a pair's distance, above its floor, while |q_j - Q_j| <= D_j (n,): see
    // `PairBounds.travel_of`.
    double travel(const std::vector<double> &reaches, const double *D, int pair) const;
    double body_travel(const std::vector<double> &reaches, const double *D, int body) const {  // beside what stands
        return travel_of(reaches, D, body, 0);
    }
    double group_travel(const std::vector<double> &reaches, const double *D, int group) const;

    // A lower bound of a pair's distance: that itself, unless it exceeds the cutoff, or the hulls of a mesh are farther
    // apart than SETTLED.
    double gap(const Placement &at, int pair, double cutoff, Features *features = nullptr) const;

    static constexpr double WIDE = 0.03, SETTLED = 0.01;

  private:
    static constexpr char NEAR = 1, APART = 2;

    // What the tube takes of the distance of a pair, or of a group's hull, whatever the direction, m; and along the
    // normal of a pair's nearest points, the bodies held in their boxes. 0 without a tube. Of meshes, which are not
    // convex, the verifier knows no normal: what takes of theirs whatever the direction is bounded as it does, by
    // balls.
    double taken(const Placement &at, int pair) const { return tube(at, pair) + floor(at, pair); }
    double floor(const Placement &at, int pair) const {
        if (floors_.asked.empty()) return 0.0;
        return near_ends_[pair].empty() ? asked_[pair] : floor_near(at, pair);
    }
    double floor_near(const Placement &at, int pair) const;
    double way(const double *D) const;
    bool in_tube(int pair) const { return !tube_.error.empty() && tube_.most[pair] > 0.0; }
    double tube(const Placement &at, int pair) const {
        if (!in_tube(pair)) return 0.0;
        const auto [a, b, by_outline] = pairs_[pair];
        if (!by_outline) return tube_of(at, a, b, common_[pair]);
        return ball_tube(at, a, common_[pair]) + ball_tube(at, b, common_[pair]);
    }
    double ball_tube(const Placement &at, int body, int common) const;
    double tube_of(const Placement &at, int a, int b, int common) const;
    double tube_along(const Placement &at, int pair, const Vec3 &normal) const;
    double tube_along_of(const Placement &at, int body, int common, const Vec3 &normal) const;
    const double *reached(const Placement &at, int body) const;
    Witness above(const Placement &at, int pair, Witness witness, double cutoff, bool convex = true) const;
    double travel_of(const std::vector<double> &reaches, const double *D, int body, int common) const;
    bool balls_apart_of(const Placement &at, int a, int b, double gap) const {
        const double reach = bodies_[a].radius + bodies_[b].radius + gap;
        return squared_norm(at.centres[b] - at.centres[a]) > reach * reach;
    }
    void gather(int first, const std::vector<char> &never);  // the first hull of a cluster; of each pair
    void measure_floors();
    void keep_place(const double *q, Placement &at) const {
        if (!floors_.ends.empty()) std::copy(q, q + tree_.planned, at.q.begin());
    }
    void place_body(int body, Placement &at) const;
    void put_bodies(Placement &at, int a, int b) const {
        for (int body : {a, b})
            if (bodies_[body].joint != 0 && !at.placed[body]) place_body(body, at);
    }
    bool touches(const Placement &at, int pair, Trail *trail) const {
        return !(lower_bound(at, pair, 0.0) > 0.0) && within(at, pair, 0.0, trail ? &trail->pairs[pair] : nullptr);
    }
    int common_joint(int a, int b) const;
    double outline_bound(const Placement &at, int pair) const;
    double ball_to_box(const Placement &at, int ball, int box) const;
    void push(const Pose *joints, int joint, const Vec3 &point, const Vec3 &direction, double *out) const;

    Tree tree_;
    std::vector<Body> bodies_;
    std::vector<Pair> pairs_;
    std::vector<int> moving_;             // bodies that a joint carries, hulls too
    std::vector<int> outside_;            // those of them that are in no cluster
    std::vector<char> waiting_;           // `Placement::placed` before bodies of clusters are
    std::vector<int> cluster_of_;         // of each body; -1: none
    std::vector<char> clustered_;         // of each pair: whether a body of it is in a cluster
    std::vector<Pose> still_;             // poses of the bodies that none carries
    std::vector<int> common_;             // of each pair: the last joint that carries both bodies
    std::vector<Together> groups_;
    std::vector<int> group_of_;           // of each pair; -1: none
    std::vector<int> alone_;              // pairs without a group that are asked
    TubeError tube_;
    Floors floors_;
    bool plain_;                          // no tube and no floors
    std::vector<double> asked_, most_;    // of each pair: its floor away from ends; the most that is taken
    std::vector<double> rises_;           // of each pair; empty without ends
    std::vector<std::vector<int>> near_ends_;  // of each pair: among `Floors::ends`
    double spread_ = 1.0;                 // by which points in the tube travel farther, a little
    int hulls_ = 0;                       // the first hull of a cluster
    int first_ = -1;                      // the first pair that is asked; -1: none is
};

}  // namespace optiplan
