// Sums in an order of their own, so that every build (SSE2, AVX2, AVX-512) returns the same bits.
#pragma once

#include <cstddef>
#include <vector>

namespace optiplan {

using Vec = std::vector<double>;

inline constexpr std::size_t LANES = 8;

// The least multiple of LANES that is not below `count`.
inline std::size_t padded(std::size_t count) { return (count + LANES - 1) / LANES * LANES; }

inline double add_lanes(const double *part) {
    return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
}

// a . b over `count` entries.
inline double dot(const double *__restrict a, const double *__restrict b, std::size_t count) {
    double part[LANES] = {0, 0, 0, 0, 0, 0, 0, 0};
    std::size_t k = 0;
    for (; k + LANES <= count; k += LANES)
        for (std::size_t i = 0; i < LANES; ++i) part[i] += a[k + i] * b[k + i];
    for (std::size_t i = 0; k + i < count; ++i) part[i] += a[k + i] * b[k + i];
    return add_lanes(part);
}

// y += factor x
inline void add_scaled(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) y[k] += factor * x[k];
}

// y += factor x, where `count` is a multiple of LANES: whole vectors, without a remainder.
inline void add_vectors(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; k += LANES)
        for (std::size_t i = 0; i < LANES; ++i) y[k + i] += factor * x[k + i];
}

}  // namespace optiplan
