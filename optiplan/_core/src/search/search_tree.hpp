// A tree of configurations that finds the nearest of them, by a k-d tree that grows with it.
#pragma once

#include <vector>

namespace optiplan {

// Configurations x (m,), each reached from its parent.
class SearchTree {
  public:
    explicit SearchTree(int dimension) : dimension_(dimension), cells_(1), offset_(dimension) {}

    int size() const { return static_cast<int>(parents_.size()); }
    int parent(int node) const { return parents_[node]; }
    const double *at(int node) const { return points_.data() + static_cast<std::size_t>(node) * dimension_; }

    int add(const double *x, int parent);

    // The node with the least ||x - x_node||; the tree is not empty.
    int nearest(const double *x);

  private:
    // Members, or a cut: what lies below `cut` along `axis` is in cell `low`, the rest in `low + 1`.
    struct Cell {
        int axis = -1, low = -1;
        double cut = 0.0;
        std::vector<int> members;
    };

    void split(int cell);
    void visit(int cell, const double *x, double squared);

    int dimension_;
    std::vector<double> points_;
    std::vector<int> parents_;
    std::vector<Cell> cells_;
    std::vector<double> offset_;  // of the cell that is visited from x, along each axis
    double least_ = 0.0;
    int found_ = -1;
};

}  // namespace optiplan
