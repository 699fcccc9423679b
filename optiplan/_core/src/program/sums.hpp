// Sums in an order of their own, so that every build (SSE2, AVX2, AVX-512) returns the same bits.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace optiplan {

using Vec = std::vector<double>;

inline constexpr std::size_t OCTET = 8;

// Doubles in a vector register of the build.
#if defined(__AVX512F__)
inline constexpr std::size_t NATIVE = 8;
#elif defined(__AVX__)
inline constexpr std::size_t NATIVE = 4;
#else
inline constexpr std::size_t NATIVE = 2;
#endif

// OCTET neighbours, anywhere in memory, lane by lane: with the same results in every build.
struct Octet {
    typedef double Native __attribute__((vector_size(NATIVE * sizeof(double)), aligned(sizeof(double)), may_alias));
    static constexpr std::size_t PARTS = OCTET / NATIVE;

    Native part[PARTS];

    Octet &operator+=(const Octet &b) { return *this = *this + b; }
    Octet &operator-=(const Octet &b) { return *this = *this - b; }
    Octet &operator*=(double factor) { return *this = factor * *this; }

    template <class F> static Octet of(const F &each) {
        Octet made;
        for (std::size_t i = 0; i < PARTS; ++i) made.part[i] = each(i);
        return made;
    }

    friend Octet operator+(const Octet &a, const Octet &b) {
        return of([&](std::size_t i) { return a.part[i] + b.part[i]; });
    }
    friend Octet operator-(const Octet &a, const Octet &b) {
        return of([&](std::size_t i) { return a.part[i] - b.part[i]; });
    }
    friend Octet operator*(const Octet &a, const Octet &b) {
        return of([&](std::size_t i) { return a.part[i] * b.part[i]; });
    }
    friend Octet operator/(const Octet &a, const Octet &b) {
        return of([&](std::size_t i) { return a.part[i] / b.part[i]; });
    }
    friend Octet operator-(const Octet &a) {
        return of([&](std::size_t i) { return -a.part[i]; });
    }
    friend Octet operator*(double a, const Octet &b) {
        return of([&](std::size_t i) { return a * b.part[i]; });
    }
    friend Octet operator-(double a, const Octet &b) {
        return of([&](std::size_t i) { return a - b.part[i]; });
    }
    friend Octet operator-(const Octet &a, double b) {
        return of([&](std::size_t i) { return a.part[i] - b; });
    }
    friend Octet operator/(double a, const Octet &b) {
        return of([&](std::size_t i) { return a / b.part[i]; });
    }
    friend Octet larger(const Octet &a, const Octet &b) {
        return of([&](std::size_t i) { return b.part[i] > a.part[i] ? b.part[i] : a.part[i]; });
    }
};

inline Octet &octet(double *at) { return *reinterpret_cast<Octet *>(at); }
inline const Octet &octet(const double *at) { return *reinterpret_cast<const Octet *>(at); }

// The least multiple of OCTET that is not below `count`.
inline std::size_t padded(std::size_t count) { return (count + OCTET - 1) / OCTET * OCTET; }

inline double add_lanes(const double *part) {
    return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
}

inline double total(const Octet &sums) { return add_lanes(reinterpret_cast<const double *>(&sums)); }

// a . b over `count` entries.
inline double dot(const double *__restrict a, const double *__restrict b, std::size_t count) {
    Octet sum = {};
    std::size_t k = 0;
    for (; k + OCTET <= count; k += OCTET) sum += octet(a + k) * octet(b + k);
    double part[OCTET];
    octet(part) = sum;
    for (std::size_t i = 0; k + i < count; ++i) part[i] += a[k + i] * b[k + i];
    return add_lanes(part);
}

// y += factor x
inline void add_scaled(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) y[k] += factor * x[k];
}

// y += factor x, where `count` is a multiple of OCTET: whole vectors, without a remainder.
inline void add_vectors(double *__restrict y, double factor, const double *__restrict x, std::size_t count) {
    for (std::size_t k = 0; k < count; k += OCTET) octet(y + k) += factor * octet(x + k);
}

// y = the sum of `count` vectors, each times its factor: `term(i)` is {factor, vector}. Kept in registers.
template <class F> void sum_vectors(double *__restrict y, std::size_t width, std::size_t count, const F &term) {
    for (std::size_t k = 0; k < width; k += OCTET) {
        Octet sum = {};
        for (std::size_t i = 0; i < count; ++i) {
            const std::pair<double, const double *> each = term(i);
            sum += each.first * octet(each.second + k);
        }
        octet(y + k) = sum;
    }
}

}  // namespace optiplan
