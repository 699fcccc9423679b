// Two random trees that grow towards each other. Source: Kuffner and LaValle, "RRT-Connect", ICRA 2000.
#pragma once

#include <cstdint>
#include <vector>

#include "search/edges.hpp"
#include "search/random.hpp"
#include "search/search_tree.hpp"

namespace optiplan {

// Where a search may go: m of the robot's n joints, the searched ones, within a box; the others stand still.
// Configurations are drawn where a motion that is at rest at both ends can pass within a duration that grows with the
// iterations, from the least one: paths of short motions are found before those of longer ones.
// Source: Gammell, Srinivasa and Barfoot, "Informed RRT*", IROS 2014; the set here is that of the time of joints.
struct SearchSpace {
    std::vector<double> still;          // (n,)
    std::vector<int> joints;            // (m,)
    std::vector<double> lower, upper;   // (m,), rad or m
    std::vector<double> units;          // (m,), scale of distances: |x| with x = q / units
    std::vector<double> velocity, acceleration;  // (m,), limits, units of the joint per s and s^2
    double least;                       // s; infinite: everywhere in the box
    int carriers;                       // joints, the first ones, that carry the others about; 0: none
};

class RrtConnect {
  public:
    // The second tree has all goals (k, m) for roots.
    RrtConnect(EdgeChecker &check, SearchSpace space, const double *start, const std::vector<double> &goals,
               double reach, std::uint64_t seed);

    // Grow for so many iterations, or so long, or until the trees have met: whether they have. Where it is cut changes
    // nothing but the time at which it goes on.
    bool grow(int iterations, double seconds);

    // One that was cut does not count before it ends.
    int iterations() const { return iterations_ - (connecting_ >= 0); }
    bool met() const { return met_[0] >= 0; }
    bool full() const;  // of states: growing on would take too much memory

    // Configurations (k, n) from the start to a goal.
    std::vector<double> path() const;

    // At most `most` configurations (k, n) of a tree, evenly chosen.
    std::vector<double> sample(int tree, int most) const;
    int size(int tree) const { return trees_[tree].size(); }

  private:
    enum class Step { blocked, advanced, reached };

    // One step of at most `reach` from a node towards `target_`; `last_` is the node it made.
    Step extend(int tree, int from);
    int next_tree();

    // Draw `target_`. Where some joints carry the others about, as a base that drives does its arm, every second one
    // has the others as they are at the start or a goal: a way for the base is found before one for all joints.
    void draw();

    // Whether a motion from the start to a goal can pass through x (m,) within so many seconds.
    bool passed_within(const double *x, double duration) const;
    void lift(const double *x, double *q) const;
    void append(std::vector<double> &out, int tree, int node) const;

    EdgeChecker &check_;
    SearchSpace space_;
    double reach_;
    Random random_;
    std::vector<SearchTree> trees_;
    std::vector<double> target_, low_, high_, x_, from_, to_;
    int goals_, last_ = -1, iterations_ = 0;
    int connecting_ = -1, grown_ = -1;  // the tree whose new node the other one grows towards; -1: none
    int met_[2] = {-1, -1};
};

}  // namespace optiplan
