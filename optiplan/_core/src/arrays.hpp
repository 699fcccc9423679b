// NumPy arrays in and out of the core.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <stdexcept>
#include <vector>

#include "pose.hpp"

namespace optiplan {

namespace nb = nanobind;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Stack = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IndexPairs = nb::ndarray<const std::int64_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

// Arrays that are written to, allocated by the caller.
using VectorOut = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MatrixOut = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// A NumPy array that owns `values`.
template <typename T>
nb::ndarray<nb::numpy, T> to_numpy(std::vector<T> values, std::initializer_list<std::size_t> shape) {
    auto *kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return nb::ndarray<nb::numpy, T>(kept->data(), shape, owner);
}

template <typename A> std::vector<double> to_vector(const A &array) {
    return std::vector<double>(array.data(), array.data() + array.size());
}

// A part of a view as an array that lives as long as the view.
template <typename T>
nb::object part(nb::handle self, const std::vector<T> &values, std::initializer_list<std::size_t> shape) {
    return nb::cast(nb::ndarray<nb::numpy, T>(const_cast<T *>(values.data()), shape, self));
}

inline Vec3 vec3_at(const double *p) { return {p[0], p[1], p[2]}; }

// A homogeneous matrix (4, 4), row by row.
inline Pose pose_at(const double *p) { return {{{vec3_at(p), vec3_at(p + 4), vec3_at(p + 8)}}, {p[3], p[7], p[11]}}; }

inline void expect(bool holds, const char *what) {
    if (!holds) throw std::invalid_argument(what);
}

// The size of vectors that must have the same one.
inline std::size_t same_size(std::initializer_list<const Vector *> vectors) {
    const std::size_t n = (*vectors.begin())->size();
    for (const Vector *vector : vectors) expect(vector->size() == n, "vectors (n,)");
    return n;
}

}  // namespace optiplan
