#include "search/search_tree.hpp"

#include <algorithm>
#include <limits>

namespace optiplan {

static constexpr std::size_t FULL = 24;  // members of a cell

int SearchTree::add(const double *x, int parent) {
    const int node = size();
    points_.insert(points_.end(), x, x + dimension_);
    parents_.push_back(parent);
    int cell = 0;
    while (cells_[cell].axis >= 0) cell = cells_[cell].low + (x[cells_[cell].axis] >= cells_[cell].cut);
    cells_[cell].members.push_back(node);
    if (cells_[cell].members.size() > FULL) split(cell);
    return node;
}

// Cut a cell in the middle of its widest extent.
void SearchTree::split(int cell) {
    const std::vector<int> members = std::move(cells_[cell].members);
    int axis = 0;
    double widest = 0.0, cut = 0.0;
    for (int k = 0; k < dimension_; ++k) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (int node : members) low = std::min(low, at(node)[k]), high = std::max(high, at(node)[k]);
        if (high - low > widest) widest = high - low, axis = k, cut = 0.5 * (low + high);
    }
    if (widest == 0.0) {  // the same point many times
        cells_[cell].members = members;
        return;
    }
    const int low = static_cast<int>(cells_.size());
    cells_.resize(cells_.size() + 2);
    cells_[cell] = {axis, low, cut, {}};
    for (int node : members) cells_[low + (at(node)[axis] >= cut)].members.push_back(node);
}

int SearchTree::nearest(const double *x) {
    least_ = std::numeric_limits<double>::infinity();
    found_ = -1;
    std::fill(offset_.begin(), offset_.end(), 0.0);
    visit(0, x, 0.0);
    return found_;
}

// `squared` is the distance of the cell. Source: Arya and Mount, "Algorithms for fast vector quantization", DCC 1993.
void SearchTree::visit(int cell, const double *x, double squared) {
    const Cell &here = cells_[cell];
    if (here.axis < 0) {
        for (int node : here.members) {
            const double *point = at(node);
            double distance = 0.0;
            for (int k = 0; k < dimension_; ++k) distance += (point[k] - x[k]) * (point[k] - x[k]);
            if (distance < least_) least_ = distance, found_ = node;
        }
        return;
    }
    const double beyond = x[here.axis] - here.cut, before = offset_[here.axis];
    const int side = beyond >= 0.0;
    visit(here.low + side, x, squared);
    const double farther = squared - before * before + beyond * beyond;
    if (farther >= least_) return;
    offset_[here.axis] = beyond;
    visit(here.low + 1 - side, x, farther);
    offset_[here.axis] = before;
}

}  // namespace optiplan
