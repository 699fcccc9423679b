#include "execution/path_tables.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

static constexpr int FINE_IN_COARSE = 4;

int Cells::at(double s) const { return std::clamp(static_cast<int>(s / width), 0, count - 1); }

PathTables::PathTables(Curve path, JointRates limits, std::vector<Load> loads, double width)
    : path_(std::move(path)), limits_(std::move(limits)) {
    for (Load &load : loads) {
        load_ends_.push_back(load.end);
        dynamics_.push_back(std::make_unique<InverseDynamics>(load.tree));
    }
    for (double limit : limits_.torque) torque_ |= std::isfinite(limit);
    const int count = std::max(1, static_cast<int>(std::ceil(length() / width)));
    fine_ = cells_of(length() / count);
    coarse_ = cells_of(length() / std::max(1, (count + FINE_IN_COARSE - 1) / FINE_IN_COARSE));
    if (!torque_) return;
    const std::size_t n = joints();
    terms_.resize((fine_.count + 1) * 3 * n);
    std::vector<double> at(4 * n), zero(n, 0.0);
    for (int i = 0; i <= fine_.count; ++i) {
        const double s = std::min(i * fine_.width, length());
        double *a = terms_.data() + i * 3 * n, *b = a + n, *g = b + n;
        derivatives(s, at.data());
        torques(s, false, at.data(), zero.data(), zero.data(), g);
        torques(s, false, at.data(), zero.data(), at.data() + n, a);
        torques(s, false, at.data(), at.data() + n, at.data() + 2 * n, b);
        for (std::size_t j = 0; j < n; ++j) a[j] -= g[j], b[j] -= g[j];
    }
}

// Each range is that of the Taylor polynomial about the middle of the part of a piece within the cell.
Cells PathTables::cells_of(double width) const {
    const std::size_t n = joints(), degree = static_cast<std::size_t>(path_.degree);
    Cells cells;
    cells.width = width, cells.count = std::max(1, static_cast<int>(std::lround(length() / width)));
    for (int order = 0; order < 3; ++order) {
        cells.low[order].assign(cells.count * n, std::numeric_limits<double>::infinity());
        cells.high[order].assign(cells.count * n, -std::numeric_limits<double>::infinity());
    }
    std::vector<double> c(degree + 1);
    for (std::size_t piece = 0; piece + 1 < path_.breakpoints.size(); ++piece) {
        const double begin = path_.breakpoints[piece], end = path_.breakpoints[piece + 1];
        for (int cell = cells.at(begin); cell < cells.count && cell * width < end; ++cell) {
            // the ends of a cell reach a little into its neighbours: rounding of s must not leave it
            const double spare = 1e-9 * width;
            const double low = std::max(begin, cell * width - spare), high = std::min(end, (cell + 1) * width + spare);
            if (high < low) continue;
            const double middle = 0.5 * (low + high) - begin, half = 0.5 * (high - low);
            for (std::size_t j = 0; j < n; ++j) {
                for (std::size_t k = 0; k <= degree; ++k) c[k] = path_.coefficients[(piece * (degree + 1) + k) * n + j];
                for (std::size_t i = 0; i < degree; ++i)  // Taylor shift by repeated Horner steps
                    for (std::size_t k = degree; k-- > i;) c[k] += middle * c[k + 1];
                for (std::size_t order = 1; order <= 3; ++order) {
                    double value = 0.0, reach = 0.0, power = 1.0;
                    for (std::size_t k = order; k <= degree; ++k, power *= half) {
                        double term = c[k];
                        for (std::size_t f = 0; f < order; ++f) term *= static_cast<double>(k - f);
                        if (k == order)
                            value = term;
                        else
                            reach += std::fabs(term) * power;
                    }
                    double &least = cells.low[order - 1][cell * n + j], &most = cells.high[order - 1][cell * n + j];
                    least = std::min(least, value - reach), most = std::max(most, value + reach);
                }
            }
        }
    }
    // The path itself was proved: what a cell's range exceeds of a limit, no point of it does.
    for (std::size_t i = 0; i < cells.count * n; ++i)
        for (int order = 1; order < 3; ++order) {
            const double limit = (order == 1 ? limits_.acceleration : limits_.jerk)[i % n];
            cells.low[order][i] = std::max(cells.low[order][i], -limit);
            cells.high[order][i] = std::min(cells.high[order][i], limit);
        }
    return cells;
}

void PathTables::set_curvature(std::vector<double> bounds, std::vector<double> rates, std::vector<double> jerks) {
    curvature_ = std::move(bounds), level_rates_ = std::move(rates), level_jerks_ = std::move(jerks);
}

const double *PathTables::curvature(int coarse_cell, double rate, double jerk) const {
    std::size_t level = 0;
    while (level + 1 < level_rates_.size() && (level_rates_[level] < rate || level_jerks_[level] < jerk)) ++level;
    return curvature_.data() + (level * coarse_.count + coarse_cell) * joints();
}

void PathTables::torque_terms(double s, double *a, double *b, double *g) const {
    const std::size_t n = joints();
    const int cell = fine_.at(s);
    const double share = std::clamp(s / fine_.width - cell, 0.0, 1.0);
    const double *left = terms_.data() + cell * 3 * n, *right = left + 3 * n;
    double *const out[3] = {a, b, g};
    for (int term = 0; term < 3; ++term)
        for (std::size_t j = 0; j < n; ++j)
            out[term][j] = (1.0 - share) * left[term * n + j] + share * right[term * n + j];
}

double PathTables::edge_after(double s) const {
    const auto first = [s](const std::vector<double> &ends) {
        const auto after = std::upper_bound(ends.begin(), ends.end(), s);
        return after == ends.end() ? std::numeric_limits<double>::infinity() : *after;
    };
    return std::min(first(path_.breakpoints), first(load_ends_));
}

void PathTables::derivatives(double s, double *out, bool before) const {
    const std::size_t n = joints(), degree = static_cast<std::size_t>(path_.degree);
    s = std::clamp(s, 0.0, length());
    const auto first = path_.breakpoints.begin() + 1, last = path_.breakpoints.end() - 1;
    const auto after = before ? std::lower_bound(first, last, s) : std::upper_bound(first, last, s);
    const std::size_t piece = static_cast<std::size_t>(after - path_.breakpoints.begin()) - 1;
    const double local = s - path_.breakpoints[piece];
    const double *c = path_.coefficients.data() + piece * (degree + 1) * n;
    std::fill_n(out, 4 * n, 0.0);
    for (std::size_t k = degree + 1; k-- > 0;)
        for (std::size_t j = 0; j < n; ++j) {
            out[3 * n + j] = out[3 * n + j] * local + 3.0 * out[2 * n + j];
            out[2 * n + j] = out[2 * n + j] * local + 2.0 * out[n + j];
            out[n + j] = out[n + j] * local + out[j];
            out[j] = out[j] * local + c[k * n + j];
        }
}

int PathTables::load_at(double s, bool before) const {
    int load = 0;
    while (load + 1 < static_cast<int>(load_ends_.size()) && (before ? load_ends_[load] < s : load_ends_[load] <= s))
        ++load;
    return load;
}

void PathTables::torques(double s, bool before, const double *q, const double *v, const double *a, double *tau) const {
    dynamics_[load_at(s, before)]->torques(q, v, a, tau);
}

// Within a cell |g| is at most the larger value of its ends plus width^2 / 8 max |g''|. Of the terms that add up to the
// bound on |tau''| of the motion, those of |g''| are some.
double PathTables::overloaded() const {
    if (!torque_) return -1.0;
    const std::size_t n = joints();
    std::vector<double> at(4 * n), zero(n, 0.0), g(n), most(n);
    for (int i = 0; i < fine_.count; ++i) {
        const double begin = i * fine_.width, end = std::min((i + 1) * fine_.width, length());
        std::fill(most.begin(), most.end(), 0.0);
        const int first = load_at(begin, false), last = load_at(end, true);
        for (int load = first; load <= last; ++load)
            for (int k = i; k <= i + 1; ++k) {
                const double s = std::min(k * fine_.width, length());
                const double *at_end = terms_.data() + (k * 3 + 2) * n;
                if (load_at(s, false) != load) {  // those of the load after it are in the table
                    derivatives(s, at.data());
                    dynamics_[load]->torques(at.data(), zero.data(), zero.data(), g.data());
                    at_end = g.data();
                }
                for (std::size_t j = 0; j < n; ++j) most[j] = std::max(most[j], std::fabs(at_end[j]));
            }
        for (int cell = coarse_.at(begin); cell <= coarse_.at(end); ++cell)
            for (std::size_t j = 0; j < n; ++j) {
                const double curved = curvature_.empty() ? 0.0 : curvature(cell, 0.0, 0.0)[j];
                if (most[j] + 0.125 * fine_.width * fine_.width * curved > limits_.torque[j]) return begin;
            }
    }
    return -1.0;
}

}  // namespace optiplan
