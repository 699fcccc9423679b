// The set-points of the last moments, to tell where on its way a measured robot is.
#pragma once

#include <vector>

namespace optiplan {

// Where on the way of the set-points a configuration is: at `place` of the planned motion number `epoch`, after a way
// of `progress` along planned motions, both in s; `off` (n,) is the distance of each joint from there.
struct NearestPlace {
    double place, progress;
    int epoch;
};

// Set-points of n joints in a ring; between two of them the way is a straight line.
class SetPointHistory {
  public:
    // The last set-point is replaced by one that is at most `spacing`, s, after the one before it; those older than
    // `kept`, s, are forgotten.
    SetPointHistory(int joints, double kept, double spacing);

    int joints() const { return joints_; }

    // A set-point (n,) at a time, s, at a place of a planned motion; times rise.
    void note(double time, const double *q, double place, int epoch);

    // Progress of the set-point of a time; at the ends that of the first and the last one kept.
    double progress_at(double time) const;

    // The nearest place to q (n,) in max_j weights_j |q_j - p_j|; of several passages that are as near but for 0.02 the
    // last one. `off` (n,) is filled.
    NearestPlace nearest(const double *q, const double *weights, double *off) const;

  private:
    struct Row {
        double time, place, progress;
        int epoch;
    };

    int slot(int age) const { return (last_ - age + count_) % count_; }  // 0: the last one
    const double *at(int slot) const { return q_.data() + static_cast<std::size_t>(slot) * joints_; }
    double away(const double *q, const double *weights, int age, double share) const;  // on the line to the next one

    int joints_, count_, filled_ = 0, last_ = 0;
    double kept_, spacing_, progress_ = 0.0;
    std::vector<double> q_;
    std::vector<Row> rows_;
};

}  // namespace optiplan
