// Distances of bodies around a robot that moves step by step, and whether it can stop clear of everything.
//
// What these mean, and why, is in optiplan/control/limits/stop_limits.py.
#pragma once

#include <cstdint>
#include <vector>

#include "control/stop_path.hpp"
#include "world/world.hpp"

namespace optiplan {

// Of P pairs and n joints. Distances in m.
struct WatchRules {
    std::vector<double> influence;  // (P,), distances up to which pairs come into view
    double kept;                    // multiple of it up to which they stay
};

// What a planned joint does to what it carries: turns by so many rad, slides by so many m, for each rad or m of its
// own.
struct JointEffects {
    std::vector<double> turns, slides;  // (n,)
};

// What is near at one configuration q (n,).
struct View {
    std::vector<double> q, bound;       // bound (P,): lower bounds of all distances; those in view are exact
    std::vector<std::int64_t> near;     // (K,) pairs in view
    std::vector<double> distance, gradient;  // (K,) and (K, n)
    std::vector<Features> features;          // (K,), where the next view begins to look for nearest points
};

// Not for two threads at once.
class ClearanceWatch {
  public:
    // `arms` (P, n): change of a distance at most per rad or m of a joint; `reaches` (P, 2): of a point of each body
    // from the joint that carries it, at most.
    ClearanceWatch(const World &world, std::vector<double> arms, std::vector<double> reaches, JointEffects effects,
                   WatchRules rules);

    const World &world() const { return world_; }
    std::size_t pairs() const { return world_.pairs().size(); }
    std::size_t joints() const { return static_cast<std::size_t>(world_.tree().planned); }

    // The view at q (n,); `before` is any earlier one, which spares most queries, or null.
    View look(const double *q, const View *before);

    // Whether distances stay at least `least` (P,) from where `start` was taken until the robot stands.
    bool stop_is_clear(const StopPath &path, const View &start, const double *least);

  private:
    struct Part {
        int first, last;
        std::vector<int> which;
        std::vector<double> distance, last_distance;
        Placement at, last_at;
        std::vector<double> q, last_q;
    };

    bool part_is_clear(const StopPath &path, const Part &part, const double *least);
    double deviation(const StopPath &path, const Part &part, int pair) const;
    double chord(const Placement &first, const Placement &second, int pair) const;
    bool measure(const Placement &at, const std::vector<int> &which, const double *least,
                 std::vector<double> &out) const;
    Placement placed(const double *q) const;

    const World &world_;
    std::vector<double> arms_, reaches_;
    JointEffects effects_;
    WatchRules rules_;
    std::vector<int> seen_;  // of each pair: its place in the view before, from 1
    std::vector<double> q_;
};

}  // namespace optiplan
