#include "control/task_program.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace optiplan {

static double row_times(const double *row, const double *x, std::size_t n) {
    double sum = 0.0;
    for (std::size_t j = 0; j < n; ++j) sum += row[j] * x[j];
    return sum;
}

double norm_of(const double *values, const std::int64_t *which, std::size_t size) {
    double squares = 0.0;
    for (std::size_t i = 0; i < size; ++i) squares += values[which[i]] * values[which[i]];
    return std::sqrt(squares);
}

// J J' (rows, rows) of J (rows, columns), or J' J where that is smaller.
static std::vector<double> gram(const double *J, std::size_t rows, std::size_t columns) {
    const bool wide = rows <= columns;
    const std::size_t m = std::min(rows, columns), inner = std::max(rows, columns);
    const std::size_t step = wide ? 1 : columns, next = wide ? columns : 1;
    std::vector<double> S(m * m);
    for (std::size_t i = 0; i < m; ++i)
        for (std::size_t k = 0; k <= i; ++k) {
            double sum = 0.0;
            for (std::size_t c = 0; c < inner; ++c) sum += J[i * next + c * step] * J[k * next + c * step];
            S[i * m + k] = S[k * m + i] = sum;
        }
    return S;
}

// Whether all singular values are surely `least` or more, and then their product, without finding each: with L L' =
// J J' the product is that of the diagonal of L, and 1 / |L⁻¹|_F is no more than the least of them.
static bool clearly_regular(const double *J, std::size_t rows, std::size_t columns, double least, double &product) {
    std::vector<double> L = gram(J, rows, columns), inverse(L.size());
    const std::size_t m = std::min(rows, columns);
    double squares = 0.0;
    product = 1.0;
    for (std::size_t r = 0; r < m; ++r) {
        for (std::size_t c = 0; c <= r; ++c) {
            double sum = L[r * m + c];
            for (std::size_t i = 0; i < c; ++i) sum -= L[r * m + i] * L[c * m + i];
            if (c == r && !(sum > 1e-12 * L[r * m + r])) return false;
            L[r * m + c] = c < r ? sum / L[c * m + c] : std::sqrt(sum);
        }
        product *= L[r * m + r];
        for (std::size_t c = 0; c <= r; ++c) {
            double sum = c == r ? 1.0 : 0.0;
            for (std::size_t i = c; i < r; ++i) sum -= L[r * m + i] * inverse[i * m + c];
            inverse[r * m + c] = sum / L[r * m + r];
            squares += inverse[r * m + c] * inverse[r * m + c];
        }
    }
    return squares * least * least <= 1.0;
}

TaskSummary task_program(const TaskRows &rows, const double *v, const double *a, const std::int64_t *main,
                         std::size_t main_size, std::size_t first, std::size_t last, double weight,
                         const TaskRules &rules, const TaskProgram &out) {
    const std::size_t n = rows.n, k = rows.cost.size();
    std::fill_n(out.H, n * n, 0.0), std::fill_n(out.g, n, 0.0);
    for (std::size_t i = 0; i < k; ++i) {
        const double *J = rows.J.data() + i * n, cost = rows.cost[i], wanted = rows.wanted[i];
        double asked = rows.asked[i];
        if (!rows.by_rate[i]) {
            const double rate = row_times(J, v, n) - rules.dt * rows.drift[i] + rows.change[i];
            asked = rules.late == 0.0 ? wanted : wanted + rules.late * (rate - wanted);
        }
        const double b = out.rates[i] = cost * asked;
        out.rates[k + i] = cost * rows.error[i], out.rates[2 * k + i] = cost * wanted;
        double *A = out.A + i * n;
        for (std::size_t j = 0; j < n; ++j) A[j] = cost * J[j], out.g[j] -= A[j] * b;
        for (std::size_t r = 0; r < n; ++r)
            for (std::size_t c = 0; c <= r; ++c) out.H[r * n + c] += A[r] * A[c];
    }
    TaskSummary found{norm_of(out.rates + k, main, main_size), 1.0};
    if (first < last) {
        const double *J = out.A + first * n;
        if (!clearly_regular(J, last - first, n, rules.near_singular, found.manipulability)) {
            const std::vector<double> values = singular_values(J, last - first, n);
            found.manipulability = 1.0;
            for (double value : values) found.manipulability *= value;
            const double share = values.back() / rules.near_singular;
            if (share < 1.0) weight += std::pow(rules.singular_damping * (1.0 - share * share), 2);
        }
    }
    for (std::size_t r = 0; r < n; ++r) {
        out.H[r * n + r] += weight + rules.steadiness;
        for (std::size_t c = 0; c < r; ++c) out.H[c * n + r] = out.H[r * n + c];
        out.g[r] -= rules.steadiness * (v[r] + rules.lasting * a[r]) + weight * rules.late * v[r];
    }
    return found;
}

std::vector<double> singular_values(const double *J, std::size_t rows, std::size_t columns) {
    const std::size_t m = std::min(rows, columns);
    std::vector<double> S = gram(J, rows, columns);
    double scale = 0.0;
    for (std::size_t i = 0; i < m; ++i) scale = std::max(scale, S[i * m + i]);
    for (int sweep = 0; sweep < 30; ++sweep) {
        double off = 0.0;
        for (std::size_t i = 0; i < m; ++i)
            for (std::size_t k = 0; k < i; ++k) off = std::max(off, std::fabs(S[i * m + k]));
        if (!(off > 1e-17 * scale)) break;
        for (std::size_t i = 1; i < m; ++i)
            for (std::size_t k = 0; k < i; ++k) {
                const double s_ik = S[i * m + k];
                if (s_ik == 0.0) continue;
                const double theta = 0.5 * (S[i * m + i] - S[k * m + k]) / s_ik;
                const double t = std::copysign(1.0, theta) / (std::fabs(theta) + std::sqrt(1.0 + theta * theta));
                const double c = 1.0 / std::sqrt(1.0 + t * t), s = t * c;
                for (std::size_t r = 0; r < m; ++r) {  // columns
                    const double x = S[r * m + k], y = S[r * m + i];
                    S[r * m + k] = c * x - s * y, S[r * m + i] = s * x + c * y;
                }
                for (std::size_t r = 0; r < m; ++r) {  // rows
                    const double x = S[k * m + r], y = S[i * m + r];
                    S[k * m + r] = c * x - s * y, S[i * m + r] = s * x + c * y;
                }
            }
    }
    std::vector<double> values(m);
    for (std::size_t i = 0; i < m; ++i) values[i] = std::sqrt(std::max(S[i * m + i], 0.0));
    std::sort(values.begin(), values.end(), std::greater<double>());
    return values;
}

// d log(R) / d(turn) for R = exp(u), turned about its own axes: β 1 + ½ [u]× + α u u' with β = (θ / 2) cot(θ / 2).
static Mat3 rotation_vector_rates(const Vec3 &u) {
    const double square = squared_norm(u), half = 0.5 * std::sqrt(square);
    const bool small = half < 1e-4;
    const double beta = small ? 1.0 - square / 12.0 : half / std::tan(half);
    const double alpha = small ? 1.0 / 12.0 + square / 720.0 : (1.0 - beta) / square;
    Mat3 found{{(alpha * u.x) * u, (alpha * u.y) * u, (alpha * u.z) * u}};
    found.rows[0] += {beta, -0.5 * u.z, 0.5 * u.y};
    found.rows[1] += {0.5 * u.z, beta, -0.5 * u.x};
    found.rows[2] += {-0.5 * u.y, 0.5 * u.x, beta};
    return found;
}

void pose_error(const Pose &X_WF, const Pose &X_WT, double *error, double *turn) {
    const Vec3 p = X_WF.p - X_WT.p, u = rotation_vector(transpose(X_WT.R) * X_WF.R);
    const Mat3 rates = rotation_vector_rates(u) * transpose(X_WF.R);
    std::fill_n(turn, 36, 0.0);
    for (int i = 0; i < 3; ++i) {
        error[i] = p[i], error[3 + i] = u[i];
        turn[7 * i] = 1.0;
        for (int j = 0; j < 3; ++j) turn[21 + 6 * i + j] = rates.rows[i][j];
    }
}

// gain size, less where it could not be lost in time, and at most `speed`.
static double wanted_speed(double size, double gain, double speed, double brake) {
    double wanted = gain * size;
    if (gain * wanted > brake) wanted = std::sqrt(2.0 * brake * (size - 0.5 * brake / (gain * gain)));
    return std::min(wanted, speed);
}

void capped(const double *e, double gain, double speed, double brake, double *out) {
    const double size = std::sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    const double wanted = wanted_speed(size, gain, speed, brake);
    for (int i = 0; i < 3; ++i) out[i] = size > 0.0 ? e[i] * (-wanted / size) : -e[i];
}

double norm_left(const double *A, const double *wanted, const double *x, const std::int64_t *which, std::size_t size,
                 std::size_t n) {
    double squares = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
        const double left = row_times(A + which[i] * n, x, n) - wanted[which[i]];
        squares += left * left;
    }
    return std::sqrt(squares);
}

void curbed(const double *error, double gain, const double *brake, const double *speed, std::size_t n, double *out) {
    bool curbs = false;
    for (std::size_t j = 0; j < n; ++j) {
        out[j] = -gain * error[j];
        if (gain * std::fabs(out[j]) > brake[j]) curbs = true;
    }
    for (std::size_t j = 0; curbs && j < n; ++j)
        out[j] = -std::copysign(wanted_speed(std::fabs(error[j]), gain, speed[j], brake[j]), error[j]);
}

}  // namespace optiplan
