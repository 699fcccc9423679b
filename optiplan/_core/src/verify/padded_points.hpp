// Points of a body, laid out for its support function.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "pose.hpp"

namespace optiplan {

class PaddedPoints {
  public:
    bool empty() const { return x_.empty(); }

    void add(const Vec3 &p) { x_.push_back(p.x), y_.push_back(p.y), z_.push_back(p.z); }

    // To be called once all points are there: fills the last block with copies of the first.
    void pad() {
        while (x_.size() % BLOCK) add({x_[0], y_[0], z_[0]});
    }

    // max n . p over the points.
    double highest(const Vec3 &n) const {
        double most[BLOCK];
        std::fill_n(most, BLOCK, -HUGE_VAL);
        for (std::size_t k = 0; k < x_.size(); k += BLOCK)
            for (std::size_t i = 0; i < BLOCK; ++i) {
                const double height = n.x * x_[k + i] + n.y * y_[k + i] + n.z * z_[k + i];
                most[i] = height > most[i] ? height : most[i];
            }
        return *std::max_element(most, most + BLOCK);
    }

  private:
    static constexpr std::size_t BLOCK = 8;  // points compared at a time

    std::vector<double> x_, y_, z_;
};

}  // namespace optiplan
