// Sums in an order of their own, so that every build (SSE2, AVX2, AVX-512) returns the same bits.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace optiplan {

using Vec = std::vector<double>;

inline constexpr std::size_t LANES = 8;

// Doubles in a vector register of the build.
#if defined(__AVX512F__)
inline constexpr std::size_t NATIVE = 8;
#elif defined(__AVX__)
inline constexpr std::size_t NATIVE = 4;
#else
inline constexpr std::size_t NATIVE = 2;
#endif

// LANES neighbours, anywhere in memory, lane by lane: with the same results in every build.
struct Lanes {
    typedef double Native __attribute__((vector_size(NATIVE * sizeof(double)), aligned(sizeof(double)), may_alias));
    static constexpr std::size_t PARTS = LANES / NATIVE;

    Native part[PARTS];

    Lanes &operator+=(const Lanes &b) { return *this = *this + b; }
    Lanes &operator-=(const Lanes &b) { return *this = *this - b; }
    Lanes &operator*=(double factor) { return *this = factor * *this; }

    template <class F> static Lanes of(const F &each) {
        Lanes made;
        for (std::size_t i = 0; i < PARTS; ++i) made.part[i] = each(i);
        return made;
    }

    friend Lanes operator+(const Lanes &a, const Lanes &b) {
        return of([&](std::size_t i) { return a.part[i] + b.part[i]; });
    }
    friend Lanes operator-(const Lanes &a, const Lanes &b) {
        return of([&](std::size_t i) { return a.part[i] - b.part[i]; });
    }
    friend Lanes operator*(const Lanes &a, const Lanes &b) {
        return of([&](std::size_t i) { return a.part[i] * b.part[i]; });
    }
    friend Lanes operator/(const Lanes &a, const Lanes &b) {
        return of([&](std::size_t i) { return a.part[i] / b.part[i]; });
    }
    friend Lanes operator-(const Lanes &a) {
        return of([&](std::size_t i) { return -a.part[i]; });
    }
    friend Lanes operator*(double a, const Lanes &b) {
        return of([&](std::size_t i) { return a * b.part[i]; });
    }
    friend Lanes operator-(double a, const Lanes &b) {
        return of([&](std::size_t i) { return a - b.part[i]; });
    }
    friend Lanes operator-(const Lanes &a, double b) {
        return of([&](std::size_t i) { return a.part[i] - b; });
    }
    friend Lanes operator/(double a, const Lanes &b) {
        return of([&](std::size_t i) { return a / b.part[i]; });
    }
    friend Lanes larger(const Lanes &a, const Lanes &b) {
        return of([&](std::size_t i) { return b.part[i] > a.part[i] ? b.part[i] : a.part[i]; });
    }
};

inline Lanes &lanes(double *at) { return *reinterpret_cast<Lanes *>(at); }
inline const Lanes &lanes(const double *at) { return *reinterpret_cast<const Lanes *>(at); }

// The least multiple of LANES that is not below `count`.
inline std::size_t padded(std::size_t count) { return (count + LANES - 1) / LANES * LANES; }

inline double add_lanes(const double *part) {
    return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
}

inline double total(const Lanes &sums) { return add_lanes(reinterpret_cast<const double *>(&sums)); }

// a . b over `count` entries.
inline double dot(const double *__restrict a, const double *__restrict b, std::size_t count) {
    Lanes sum = {};
    std::size_t k = 0;
    for (; k + LANES <= count; k += LANES) sum += lanes(a + k) * lanes(b + k);
    double part[LANES];
    lanes(part) = sum;
    for (std::size_t i = 0; k + i < count; ++i) part[i] += a[k + i] * b[k + i];
    return add_lanes(part);
}

// y += factor x
inline void add_scaled(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) y[k] += factor * x[k];
}

// y += factor x, where `count` is a multiple of LANES: whole vectors, without a remainder.
inline void add_vectors(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; k += LANES) lanes(y + k) += factor * lanes(x + k);
}

// y = the sum of `count` vectors, each times its factor: `term(i)` is {factor, vector}. Kept in registers.
template <class F> void sum_vectors(double *__restrict y, std::size_t width, std::size_t count, const F &term) {
    for (std::size_t k = 0; k < width; k += LANES) {
        Lanes sum = {};
        for (std::size_t i = 0; i < count; ++i) {
            const std::pair<double, const double *> each = term(i);
            sum += each.first * lanes(each.second + k);
        }
        lanes(y + k) = sum;
    }
}

}  // namespace optiplan
