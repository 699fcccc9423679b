#include "control/active_set.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();

// L of S = L L', in the lower half; false where S is not positive definite.
static bool cholesky(std::vector<double> &S, std::size_t n) {
    for (std::size_t c = 0; c < n; ++c) {
        double *row = S.data() + c * n;
        for (std::size_t k = 0; k < c; ++k) {
            const double *other = S.data() + k * n;
            double sum = row[k];
            for (std::size_t i = 0; i < k; ++i) sum -= row[i] * other[i];
            row[k] = sum / other[k];
        }
        double pivot = row[c];
        for (std::size_t i = 0; i < c; ++i) pivot -= row[i] * row[i];
        if (!(pivot > 0.0)) return false;
        row[c] = std::sqrt(pivot);
    }
    return true;
}

static void solve_with(const std::vector<double> &L, std::size_t n, double *x) {
    for (std::size_t r = 0; r < n; ++r) {
        for (std::size_t i = 0; i < r; ++i) x[r] -= L[r * n + i] * x[i];
        x[r] /= L[r * n + r];
    }
    for (std::size_t r = n; r-- > 0;) {
        for (std::size_t i = r + 1; i < n; ++i) x[r] -= L[i * n + r] * x[i];
        x[r] /= L[r * n + r];
    }
}

static double dot(const double *a, const double *b, std::size_t n) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += a[k] * b[k];
    return sum;
}

bool ActiveSet::solve(const SmallProgram &program, const ActiveSetRules &rules) {
    const std::size_t n = program.n;
    factor_.assign(program.H, program.H + n * n);
    if (!cholesky(factor_, n)) return false;
    free_.resize(n);
    for (std::size_t j = 0; j < n; ++j) free_[j] = -program.g[j];
    solve_with(factor_, n, free_.data());
    if (!from_guess(program, rules) && !from_nothing(program, rules)) return false;
    for (std::size_t j = 0; j < n; ++j) x[j] = std::min(std::max(x[j], program.lower[j]), program.upper[j]);
    return true;
}

bool ActiveSet::from_guess(const SmallProgram &program, const ActiveSetRules &rules) {
    rows.erase(std::remove_if(rows.begin(), rows.end(),
                              [&](std::int64_t row) { return std::llabs(row) > std::int64_t(program.m); }),
               rows.end());
    for (int change = 0; change < rules.changes; ++change) {
        if (!on_constraints(program, rules.feasible)) return false;
        const std::size_t inequalities = bounds.size() + rows.size();
        if (inequalities > 0) {
            const auto worst = std::min_element(y_.begin(), y_.begin() + inequalities);
            double largest = 0.0;
            for (std::size_t k = 0; k < inequalities; ++k) largest = std::max(largest, std::fabs(y_[k]));
            if (*worst < -rules.sign * (1.0 + largest)) {
                const std::size_t k = worst - y_.begin();
                if (k < bounds.size())
                    bounds.erase(bounds.begin() + k);
                else
                    rows.erase(rows.begin() + (k - bounds.size()));
                continue;
            }
        }
        bool bound;
        std::int64_t found;
        if (!enters(program, rules.touches, bound, found)) return true;
        auto &active = bound ? bounds : rows;
        if (std::find(active.begin(), active.end(), found) != active.end()) return false;
        active.push_back(found);
    }
    return false;
}

// x on the chosen constraints and equations, and their multipliers; false where these depend on each other.
bool ActiveSet::on_constraints(const SmallProgram &program, double feasible) {
    const std::size_t n = program.n, inequalities = bounds.size() + rows.size(), k = inequalities + program.p;
    x = free_;
    y_.assign(k, 0.0);
    if (k == 0) return true;
    if (k > n) return false;
    N_.assign(k * n, 0.0), b_.resize(k);
    for (std::size_t i = 0; i < bounds.size(); ++i) {
        const std::size_t j = std::llabs(bounds[i]) - 1;
        N_[i * n + j] = bounds[i] > 0 ? 1.0 : -1.0;
        b_[i] = bounds[i] > 0 ? program.upper[j] : -program.lower[j];
    }
    for (std::size_t i = bounds.size(); i < inequalities; ++i) {
        const std::int64_t signed_row = rows[i - bounds.size()];
        const std::size_t j = std::llabs(signed_row) - 1;
        const double sign = signed_row > 0 ? 1.0 : -1.0;
        for (std::size_t c = 0; c < n; ++c) N_[i * n + c] = sign * program.C[j * n + c];
        b_[i] = signed_row > 0 ? program.high[j] : -program.low[j];
    }
    std::copy_n(program.A, program.p * n, N_.begin() + inequalities * n);
    std::copy_n(program.b, program.p, b_.begin() + inequalities);
    Y_ = N_;  // rows (H^-1 N')'
    for (std::size_t i = 0; i < k; ++i) solve_with(factor_, n, Y_.data() + i * n);
    S_.resize(k * k);
    for (std::size_t i = 0; i < k; ++i) {
        for (std::size_t c = 0; c < k; ++c) S_[i * k + c] = dot(N_.data() + i * n, Y_.data() + c * n, n);
        y_[i] = dot(N_.data() + i * n, free_.data(), n) - b_[i];
    }
    if (!cholesky(S_, k)) return false;
    solve_with(S_, k, y_.data());
    for (std::size_t i = 0; i < k; ++i)
        for (std::size_t c = 0; c < n; ++c) x[c] -= y_[i] * Y_[i * n + c];
    for (std::size_t i = 0; i < k; ++i)
        if (!(std::fabs(dot(N_.data() + i * n, x.data(), n) - b_[i]) <= feasible)) return false;
    return true;
}

// The constraint that x leaves farthest behind; false if there is none.
bool ActiveSet::enters(const SmallProgram &program, double touches, bool &bound, std::int64_t &found) const {
    double worst = touches;
    found = 0;
    for (std::size_t j = 0; j < program.n; ++j) {
        if (x[j] - program.upper[j] > worst) worst = x[j] - program.upper[j], bound = true, found = std::int64_t(j) + 1;
        if (program.lower[j] - x[j] > worst)
            worst = program.lower[j] - x[j], bound = true, found = -(std::int64_t(j) + 1);
    }
    for (std::size_t i = 0; i < program.m; ++i) {
        const double y = dot(program.C + i * program.n, x.data(), program.n);
        if (y - program.high[i] > worst) worst = y - program.high[i], bound = false, found = std::int64_t(i) + 1;
        if (program.low[i] - y > worst) worst = program.low[i] - y, bound = false, found = -(std::int64_t(i) + 1);
    }
    return found != 0;
}

// A constraint as n'x >= b.
void ActiveSet::normal_of(const SmallProgram &program, bool bound, std::int64_t signed_index, bool equation, double *n,
                          double &b) const {
    const std::size_t j = std::llabs(signed_index) - 1;
    const double sign = signed_index > 0 ? -1.0 : 1.0;
    if (bound) {
        std::fill(n, n + program.n, 0.0);
        n[j] = sign;
        b = sign * (signed_index > 0 ? program.upper[j] : program.lower[j]);
        return;
    }
    const double *row = (equation ? program.A : program.C) + j * program.n;
    for (std::size_t c = 0; c < program.n; ++c) n[c] = sign * row[c];
    b = sign * (equation ? program.b[j] : signed_index > 0 ? program.high[j] : program.low[j]);
}

bool ActiveSet::from_nothing(const SmallProgram &program, const ActiveSetRules &rules) {
    x = free_;
    active_.clear(), N_.clear(), Y_.clear(), y_.clear();
    int steps = 20 + 4 * static_cast<int>(program.n);
    std::vector<double> normal(program.n);
    for (std::size_t i = 0; i < program.p; ++i) {
        double b;
        normal_of(program, false, -(std::int64_t(i) + 1), true, normal.data(), b);
        const bool over = dot(normal.data(), x.data(), program.n) > b;
        if (!enter(program, false, (over ? 1 : -1) * (std::int64_t(i) + 1), true, steps)) return false;
    }
    bool bound;
    std::int64_t found;
    while (enters(program, rules.touches, bound, found))
        if (!enter(program, bound, found, false, steps)) return false;
    bounds.clear(), rows.clear();
    for (const Active &active : active_)
        if (!active.equation) (active.bound ? bounds : rows).push_back(active.signed_index);
    for (double value : x)
        if (!std::isfinite(value)) return false;
    return true;
}

void ActiveSet::drop(std::size_t k) {
    const std::size_t n = free_.size();
    active_.erase(active_.begin() + k);
    N_.erase(N_.begin() + k * n, N_.begin() + (k + 1) * n);
    Y_.erase(Y_.begin() + k * n, Y_.begin() + (k + 1) * n);
    y_.erase(y_.begin() + k);
}

// Move x onto a violated constraint, while active ones whose multipliers become zero leave; false where it cannot be.
bool ActiveSet::enter(const SmallProgram &program, bool bound, std::int64_t signed_index, bool equation, int &steps) {
    const std::size_t n = program.n;
    std::vector<double> normal(n), across(n), z(n), r;
    double b, multiplier = 0.0;
    normal_of(program, bound, signed_index, equation, normal.data(), b);
    across = normal;
    solve_with(factor_, n, across.data());  // H^-1 normal
    const double size = dot(normal.data(), across.data(), n);
    while (steps-- > 0) {
        const std::size_t k = active_.size();
        r.resize(k), S_.resize(k * k);
        for (std::size_t i = 0; i < k; ++i) {
            r[i] = dot(Y_.data() + i * n, normal.data(), n);
            for (std::size_t c = 0; c <= i; ++c) S_[i * k + c] = dot(N_.data() + i * n, Y_.data() + c * n, n);
        }
        if (!cholesky(S_, k)) return false;
        solve_with(S_, k, r.data());
        z = across;
        for (std::size_t i = 0; i < k; ++i)
            for (std::size_t c = 0; c < n; ++c) z[c] -= r[i] * Y_[i * n + c];
        const double slope = dot(z.data(), normal.data(), n);
        const double missing = b - dot(normal.data(), x.data(), n);
        const bool free = slope > 1e-12 * size;
        double step = free ? std::max(missing, 0.0) / slope : INF;
        std::size_t leaves = k;
        for (std::size_t i = 0; i < k; ++i)
            if (!active_[i].equation && r[i] > 0.0 && y_[i] / r[i] < step) step = y_[i] / r[i], leaves = i;
        if (step == INF) return false;  // no x keeps it and those that are active
        for (std::size_t i = 0; i < k; ++i) y_[i] -= step * r[i];
        multiplier += step;
        if (free)
            for (std::size_t c = 0; c < n; ++c) x[c] += step * z[c];
        if (leaves < k) {
            drop(leaves);
            continue;
        }
        active_.push_back({bound, equation, signed_index});
        N_.insert(N_.end(), normal.begin(), normal.end());
        Y_.insert(Y_.end(), across.begin(), across.end());
        y_.push_back(multiplier);
        return true;
    }
    return false;
}

}  // namespace optiplan
