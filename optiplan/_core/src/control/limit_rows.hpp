// Rows low <= G x <= high of the velocities at the end of a step: of torques, of a frame's speed, of distances.
//
// The formulas and their reasons are in optiplan/control/limits/{torque,tool_speed,stop_limits}.py.
#pragma once

#include <cstdint>
#include <vector>

namespace optiplan {

struct LimitRows {
    std::size_t n;
    std::vector<double> G, low, high, unit;  // (k, n), then (k,); `unit` is what each row was divided by

    LimitRows(std::size_t n, std::size_t k) : n(n), G(k * n), low(k), high(k), unit(k) {}

    std::size_t size() const { return low.size(); }

    // Divides row k, its ends too, by its size or `least`.
    void normalise(std::size_t k, double least);
};

// M (n, n), h (n,) of tau = M a + h; `torque` (n,).
LimitRows torque_rows(const double *M, const double *h, const double *v, const double *torque, double dt,
                      std::size_t n);

// Three rows for each of `parts`, which are the first rows of J (6, n) that they are about: 0 linear, 3 angular.
// `bounds` (3 parts,); `delay` (n,), s: how long an acceleration goes on.
LimitRows speed_rows(const double *J, const double *v, const double *delay, const double *bounds,
                     const std::vector<std::int64_t> &parts, double dt, std::size_t n);

// What is near: gradients (K, columns >= n), distances (K,), their pairs.
struct NearPairs {
    const double *gradient, *distance;
    const std::int64_t *near;
    std::size_t size, columns;
};

// `delay`, `brake` (n,): see Abilities; `least`, `margin` (P,); `drift`, `lost` (K,): what distances change by
// themselves in the step, and what of them is lost until the joints have matched that. `rate`: 1/s.
struct StopRules {
    const double *delay, *brake, *least, *margin, *drift, *lost;
    double dt, rate;
};

LimitRows stop_rows(const NearPairs &near, const double *v, const StopRules &rules, std::size_t n);

// `least` (P,) anew: `asked` (P,), or where a distance is less now, that less `slip`, or what it has been.
void raise_least(double *least, const double *asked, std::size_t pairs, const NearPairs &near, double slip);

// Whether x (n,) keeps all rows C (m, n) but for `slack`.
bool rows_hold(const double *C, const double *low, const double *high, const double *x, std::size_t m, std::size_t n,
               double slack);

}  // namespace optiplan
