#include "execution/path_tables.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

static constexpr int FINE_IN_COARSE = 4;
static constexpr int MOST_CUTS = 8;  // halvings of a cell in which the robot must be able to stand still

// Polynomials c (degree + 1, n) of x become those of x - by: repeated Horner steps.
static void shift(double *c, std::size_t degree, std::size_t n, double by) {
    for (std::size_t i = 0; i < degree; ++i)
        for (std::size_t k = degree; k-- > i;)
            for (std::size_t j = 0; j < n; ++j) c[k * n + j] += by * c[(k + 1) * n + j];
}

// k! / (k - order)!
static double falling(std::size_t k, std::size_t order) {
    double product = 1.0;
    for (std::size_t f = 0; f < order; ++f) product *= static_cast<double>(k - f);
    return product;
}

int Cells::at(double s) const { return std::clamp(static_cast<int>(s / width), 0, count - 1); }

PathTables::PathTables(Curve path, JointRates limits, std::vector<Load> loads, double width)
    : path_(std::move(path)), limits_(std::move(limits)) {
    for (Load &load : loads) {
        load_ends_.push_back(load.end);
        dynamics_.push_back(std::make_shared<InverseDynamics>(load.tree));
    }
    for (double limit : limits_.torque) torque_ |= std::isfinite(limit);
    const int count = std::max(1, static_cast<int>(std::ceil(length() / width)));
    fine_ = cells_of(length() / count);
    coarse_ = cells_of(length() / std::max(1, (count + FINE_IN_COARSE - 1) / FINE_IN_COARSE));
    if (!torque_) return;
    const std::size_t n = joints();
    terms_.resize((coarse_.count + 1) * 3 * n);
    std::vector<double> at(4 * n), zero(n, 0.0);
    for (int i = 0; i <= coarse_.count; ++i) {
        const double s = std::min(i * coarse_.width, length());
        double *a = terms_.data() + i * 3 * n, *b = a + n, *g = b + n;
        derivatives(s, at.data());
        torques(s, false, at.data(), at.data() + n, at.data() + 2 * n, b);
        dynamics_[load_at(s, false)]->at_rest(g);
        torques(s, false, at.data(), zero.data(), at.data() + n, a);
        for (std::size_t j = 0; j < n; ++j) a[j] -= g[j], b[j] -= g[j];
    }
}

PathTables PathTables::mirrored() const {
    PathTables other = *this;
    const std::size_t n = joints(), degree = static_cast<std::size_t>(path_.degree),
                      pieces = path_.breakpoints.size() - 1;
    for (std::size_t piece = 0; piece <= pieces; ++piece)
        other.path_.breakpoints[piece] = length() - path_.breakpoints[pieces - piece];
    for (std::size_t piece = 0; piece < pieces; ++piece) {
        const double width = path_.breakpoints[piece + 1] - path_.breakpoints[piece];
        const double *from = path_.coefficients.data() + piece * (degree + 1) * n;
        double *to = other.path_.coefficients.data() + (pieces - 1 - piece) * (degree + 1) * n;
        std::copy_n(from, (degree + 1) * n, to);
        shift(to, degree, n, width);
        for (std::size_t k = 1; k <= degree; k += 2)
            for (std::size_t j = 0; j < n; ++j) to[k * n + j] = -to[k * n + j];
    }
    const std::size_t loads = load_ends_.size();
    for (std::size_t k = 0; k < loads; ++k) {
        other.dynamics_[k] = dynamics_[loads - 1 - k];
        other.load_ends_[k] = k + 1 < loads ? length() - load_ends_[loads - 2 - k] : length();
    }
    const auto turned = [n](const std::vector<double> &rows, std::vector<double> &out, double sign) {
        const std::size_t count = rows.size() / n;  // rows of n, in the opposite order
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t j = 0; j < n; ++j) out[i * n + j] = sign * rows[(count - 1 - i) * n + j];
    };
    const Cells *from[2] = {&fine_, &coarse_};
    Cells *to[2] = {&other.fine_, &other.coarse_};
    for (int grid = 0; grid < 2; ++grid)
        for (int order = 0; order < 3; ++order) {  // odd derivatives change their signs
            const bool turns = order != 1;
            turned(turns ? from[grid]->high[order] : from[grid]->low[order], to[grid]->low[order], turns ? -1.0 : 1.0);
            turned(turns ? from[grid]->low[order] : from[grid]->high[order], to[grid]->high[order], turns ? -1.0 : 1.0);
        }
    for (std::size_t i = 0; i < curvature_.size(); ++i) {
        const std::size_t cell = i / (4 * n);
        other.curvature_[i] = curvature_[(coarse_.count - 1 - cell) * 4 * n + i % (4 * n)];
    }
    if (!torque_) return other;
    for (int i = 0; i <= coarse_.count; ++i) {
        const double *row = terms_.data() + (coarse_.count - i) * 3 * n;
        double *out = other.terms_.data() + i * 3 * n;
        for (std::size_t j = 0; j < 3 * n; ++j) out[j] = j < n ? -row[j] : row[j];
    }
    return other;
}

// Each part of a piece within a cell, with the Taylor coefficients (degree + 1, n) about its middle.
template <class Use> void PathTables::each_part(const Cells &cells, Use use) const {
    const std::size_t n = joints(), degree = static_cast<std::size_t>(path_.degree);
    std::vector<double> c((degree + 1) * n);
    for (std::size_t piece = 0; piece + 1 < path_.breakpoints.size(); ++piece) {
        const double begin = path_.breakpoints[piece], end = path_.breakpoints[piece + 1];
        for (int cell = cells.at(begin); cell < cells.count && cell * cells.width < end; ++cell) {
            // the ends of a cell reach a little into its neighbours: rounding of s must not leave it
            const double spare = 1e-9 * cells.width;
            const double low = std::max(begin, cell * cells.width - spare);
            const double high = std::min(end, (cell + 1) * cells.width + spare);
            if (high < low) continue;
            std::copy_n(path_.coefficients.data() + piece * (degree + 1) * n, c.size(), c.data());
            shift(c.data(), degree, n, 0.5 * (low + high) - begin);
            use(cell, 0.5 * (high - low), c);
        }
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
    each_part(cells, [&](int cell, double half, const std::vector<double> &c) {
        for (std::size_t order = 1; order <= std::min<std::size_t>(3, degree); ++order)
            for (std::size_t j = 0; j < n; ++j) {
                double reach = 0.0, power = half;
                for (std::size_t k = order + 1; k <= degree; ++k, power *= half)
                    reach += falling(k, order) * std::fabs(c[k * n + j]) * power;
                const double value = falling(order, order) * c[order * n + j];
                double &least = cells.low[order - 1][cell * n + j], &most = cells.high[order - 1][cell * n + j];
                least = std::min(least, value - reach), most = std::max(most, value + reach);
            }
        for (std::size_t order = degree + 1; order <= 3; ++order)
            std::fill_n(&cells.low[order - 1][cell * n], n, 0.0), std::fill_n(&cells.high[order - 1][cell * n], n, 0.0);
    });
    // The path itself was proved: what a cell's range exceeds of a limit, no point of it does.
    for (std::size_t i = 0; i < cells.count * n; ++i)
        for (int order = 1; order < 3; ++order) {
            const double limit = (order == 1 ? limits_.acceleration : limits_.jerk)[i % n];
            cells.low[order][i] = std::max(cells.low[order][i], -limit);
            cells.high[order][i] = std::min(cells.high[order][i], limit);
        }
    return cells;
}

std::vector<double> PathTables::sizes() const {
    const std::size_t n = joints(), degree = static_cast<std::size_t>(path_.degree);
    std::vector<double> size(5 * coarse_.count * n, 0.0);
    each_part(coarse_, [&](int cell, double half, const std::vector<double> &c) {
        half *= 1.0 + 1e-6;
        for (std::size_t order = 0; order <= std::min<std::size_t>(4, degree); ++order)
            for (std::size_t j = 0; j < n; ++j) {
                double sum = 0.0, power = 1.0;
                for (std::size_t k = order; k <= degree; ++k, power *= half)
                    sum += falling(k, order) * std::fabs(c[k * n + j]) * power;
                double &most = size[(order * coarse_.count + cell) * n + j];
                most = std::max(most, sum);
            }
    });
    return size;
}

void PathTables::torque_terms(double s, double *a, double *b, double *g) const {
    const std::size_t n = joints();
    const int cell = coarse_.at(s);
    const double share = std::clamp(s / coarse_.width - cell, 0.0, 1.0);
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

double PathTables::overloaded() const {
    if (!torque_) return -1.0;
    const std::size_t n = joints();
    for (int cell = 0; cell < coarse_.count; ++cell) {
        const double begin = cell * coarse_.width, end = std::min((cell + 1) * coarse_.width, length());
        const auto change = std::lower_bound(load_ends_.begin(), load_ends_.end(), begin);
        // what is taken or released at the end is a load of its own there
        const bool same = change == load_ends_.end() || *change > end || change + 1 == load_ends_.end();
        bool clear = !curvature_.empty() && same;
        const double *g = terms_.data() + cell * 3 * n + 2 * n, *next = g + 3 * n;
        for (std::size_t j = 0; j < n && clear; ++j) {
            const double sagitta = 0.125 * coarse_.width * coarse_.width * curvature(cell, j, {1.0, 0.0, 0.0});
            clear = std::max(std::fabs(g[j]), std::fabs(next[j])) + sagitta <= limits_.torque[j];
        }
        if (!clear && !stands(begin, end, MOST_CUTS)) return begin;
    }
    return -1.0;
}

// Whether gravity keeps the limits between two places. |g| is at most the larger value of its ends plus
// width^2 / 8 max |g''|. Of the terms that add up to the bound on |tau''| of the motion, those of |g''| are some.
bool PathTables::stands(double begin, double end, int cuts) const {
    const std::size_t n = joints();
    std::vector<double> at(4 * n), zero(n, 0.0), g(n), most(n, 0.0);
    for (int load = load_at(begin, false); load <= load_at(end, true); ++load)
        for (double s : {begin, end}) {
            derivatives(s, at.data());
            dynamics_[load]->torques(at.data(), zero.data(), zero.data(), g.data());
            for (std::size_t j = 0; j < n; ++j) most[j] = std::max(most[j], std::fabs(g[j]));
        }
    bool within = true, proved = true;
    for (int cell = coarse_.at(begin); cell <= coarse_.at(end); ++cell)
        for (std::size_t j = 0; j < n; ++j) {
            const double curved = curvature(cell, j, {1.0, 0.0, 0.0});
            within &= most[j] <= limits_.torque[j];
            proved &= most[j] + 0.125 * (end - begin) * (end - begin) * curved <= limits_.torque[j];
        }
    const double middle = 0.5 * (begin + end);
    return proved || (cuts > 0 && (within || load_at(begin, false) != load_at(end, true)) &&
                      stands(begin, middle, cuts - 1) && stands(middle, end, cuts - 1));
}

}  // namespace optiplan
