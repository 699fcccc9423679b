// A robot among obstacles: bodies on the joints of a tree, and the pairs of them that must stay apart.
#pragma once

#include <utility>
#include <vector>

#include "convex/convex.hpp"
#include "world/tree.hpp"

namespace optiplan {

// A body, enclosed by a box along the axes of its own frame and by the ball about that box's centre.
struct Body {
    int joint;                    // that carries it
    Pose X_JB;
    std::vector<Shape> shapes;    // one; of a mesh two: its hull, then its triangles
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

// The pairs of a cluster's bodies with one other body.
struct Together {
    int hull, other;           // bodies, the hull behind all others
    int common;                // the last joint that carries both
    std::vector<int> pairs;    // rising
};

// A pair at configuration `row`; normal . (b - a) = distance.
struct Contact {
    int row, pair;
    Witness witness;
};

// Along configurations that are asked one after another: where bodies were nearest, or apart, when they were last asked.
struct Trail {
    std::vector<Features> pairs, groups;        // of each pair, and of the hull of each group
    std::vector<std::pair<double, int>> asked;  // lower bound and pair, of those of a group that are asked
};

// What may be left out of the pairs that are near.
struct Sketch {
    double window = HUGE_VAL;   // m; pairs of a group that are farther apart than its nearest one by more than that
    double gap = kDistanceGap;  // m; digits of the distances of curved bodies
};

// Where everything is at one configuration.
struct Placement {
    std::vector<Pose> joints, bodies;
    std::vector<Vec3> centres;
    std::vector<char> opened;  // of each cluster: whether its bodies are where the joints put them
    int touching = 0;  // the pair that touched last is asked first: answers come sooner, and are the same
};

class World {
  public:
    World(Tree tree, std::vector<Body> bodies, const std::vector<std::pair<int, int>> &pairs,
          std::vector<Cluster> clusters = {});

    const Tree &tree() const { return tree_; }
    const std::vector<Pair> &pairs() const { return pairs_; }
    const std::vector<Body> &bodies() const { return bodies_; }  // hulls of clusters last
    const std::vector<Together> &groups() const { return groups_; }

    // The last joint that carries both bodies of a pair: it does not change their distance.
    int common(int pair) const { return common_[pair]; }

    Placement placement() const;
    void place(const double *q, Placement &at) const;

    // As `place`, but bodies of clusters only where `settled` finds that their hulls do not tell.
    void place_outside(const double *q, Placement &at) const;

    // Lower bound, m, of a pair's distance: from the ball of one body to the box of the other, both ways.
    double lower_bound(const Placement &at, int pair) const;

    // Whether the balls are farther apart than `gap`: the first and cheapest test.
    bool balls_apart(const Placement &at, int pair, double gap) const {
        return balls_apart_of(at, pairs_[pair].a, pairs_[pair].b, gap);
    }

    // Whether all pairs of a group are apart by more than `gap`, m, because the hull of its cluster is.
    bool group_apart(const Placement &at, int group, double gap, Features *features = nullptr) const;

    // Asks `group_apart` once a group, at one placement: whether a pair is apart by its group's `gap`, m. Where that does
    // not tell, its bodies are in place afterwards.
    template <class Gap>
    bool settled(Placement &at, int pair, std::vector<char> &known, const Gap &gap) const {
        const int group = group_of_[pair];
        if (group >= 0) {
            if (!known[group]) known[group] = group_apart(at, group, gap(group)) ? APART : NEAR;
            if (known[group] == APART) return true;
        }
        open(at, pair);
        return false;
    }

    // Puts the bodies of the clusters that a pair belongs to in place, where `place_outside` has not.
    void open(Placement &at, int pair) const {
        if (!clustered_[pair]) return;
        for (int cluster : {cluster_of_[pairs_[pair].a], cluster_of_[pairs_[pair].b]})
            if (cluster >= 0 && !at.opened[cluster]) place_members(cluster, at);
    }

    // Whether a pair is nearer than a margin, m. Above WIDE the hull of a mesh is asked in its place.
    bool within(const Placement &at, int pair, double margin) const;

    bool collides(Placement &at) const;

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

    // d(distance)/dq (n,) = n . (J_b - J_a), with J the linear Jacobian of the nearest point.
    void gradient(const Placement &at, const Contact &contact, double *out) const;

    // Distance of the farthest corner of a body's box from the axis of each joint that carries it, m, and 0 for other
    // joints: (joints,); of all bodies: (bodies, joints).
    void reach(const Placement &at, int body, double *out) const;
    void reaches(const Placement &at, std::vector<double> &out) const;

    // Bound, m, on the change of a pair's distance while |q_j - Q_j| <= D_j (n,): see `PairBounds.travel_of`.
    double travel(const std::vector<double> &reaches, const double *D, int pair) const;
    double group_travel(const std::vector<double> &reaches, const double *D, int group) const;

    // A lower bound of a pair's distance: that itself, unless it exceeds the cutoff, or the hulls of a mesh are farther
    // apart than SETTLED.
    double gap(const Placement &at, int pair, double cutoff) const;

    static constexpr double WIDE = 0.03, SETTLED = 0.01;

  private:
    static constexpr char NEAR = 1, APART = 2;

    double travel_of(const std::vector<double> &reaches, const double *D, int body, int common) const;
    bool balls_apart_of(const Placement &at, int a, int b, double gap) const {
        const double reach = bodies_[a].radius + bodies_[b].radius + gap;
        return squared_norm(at.centres[b] - at.centres[a]) > reach * reach;
    }
    void gather();
    void place_body(int body, Placement &at) const;
    void place_members(int cluster, Placement &at) const;
    int common_joint(int a, int b) const;
    double ball_to_box(const Placement &at, int ball, int box) const;
    void push(const Placement &at, int joint, const Vec3 &point, const Vec3 &direction, double *out) const;

    Tree tree_;
    std::vector<Body> bodies_;
    std::vector<Pair> pairs_;
    std::vector<int> moving_;             // bodies that a joint carries, hulls too
    std::vector<int> outside_;            // those of them that are in no cluster
    std::vector<std::vector<int>> members_;  // of each cluster
    std::vector<int> cluster_of_;         // of each body; -1: none
    std::vector<char> clustered_;         // of each pair: whether a body of it is in a cluster
    std::vector<Pose> still_;             // poses of the bodies that none carries
    std::vector<int> common_;             // of each pair: the last joint that carries both bodies
    std::vector<Together> groups_;
    std::vector<int> group_of_;           // of each pair; -1: none
    std::vector<int> alone_;              // pairs without a group
};

}  // namespace optiplan
