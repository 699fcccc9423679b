#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "arrays.hpp"
#include "control/clearance_watch.hpp"
#include "control/limit_rows.hpp"
#include "control/task_program.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

// With strides: pinocchio's matrices are stored column by column.
using Strided = nb::ndarray<const double, nb::device::cpu>;

// A matrix (rows, columns) row by row; one row, or one column, may come as a vector.
static void read(const Strided &given, std::size_t rows, std::size_t columns, double *out) {
    const std::size_t axes = given.ndim();
    if (axes == 2) {
        expect(given.shape(0) == rows && given.shape(1) == columns, "a matrix (rows, columns)");
        for (std::size_t i = 0; i < rows; ++i)
            for (std::size_t j = 0; j < columns; ++j)
                *out++ = given.data()[std::int64_t(i) * given.stride(0) + std::int64_t(j) * given.stride(1)];
        return;
    }
    const std::size_t size = rows * columns;
    expect((rows == 1 || columns == 1) && (axes == 1 ? given.shape(0) == size : axes == 0 && size == 1), "numbers");
    for (std::size_t i = 0; i < size; ++i) *out++ = given.data()[axes ? std::int64_t(i) * given.stride(0) : 0];
}

static std::vector<double> read(const Strided &given, std::size_t rows, std::size_t columns) {
    std::vector<double> found(rows * columns);
    read(given, rows, columns, found.data());
    return found;
}

static Pose pose_of(const Strided &X) { return pose_at(read(X, 4, 4).data()); }

template <typename Array> static Array array_of(nb::handle given) {
    Array found;
    expect(nb::try_cast(given, found), "an array of numbers");
    return found;
}

// What a task gave, whatever it is; nothing for None.
static void read_given(nb::handle given, std::size_t rows, std::size_t columns, double *out) {
    if (given.is_none()) return;
    Strided found;
    if (!nb::try_cast(given, found))
        found = array_of<Strided>(nb::module_::import_("numpy").attr("asarray")(given, "float64"));
    read(found, rows, columns, out);
}

static void check_rows(const Indices &rows, std::size_t count) {
    for (std::size_t i = 0; i < rows.size(); ++i) expect(std::size_t(rows.data()[i]) < count, "rows of the matrix");
}

// `parts`: of each task J (r, n), error, wanted, cost, rates that are asked or None, change, drift (r,) or None.
// `measured`: rows whose singular values count, first and last + 1. Returns the error and the manipulability.
static std::pair<double, double> fill_program(const nb::list &parts, const Indices &main, std::pair<int, int> measured,
                                              const std::pair<Vector, Vector> &motion, double weight,
                                              const Vector &rules,
                                              const std::tuple<MatrixOut, MatrixOut, MatrixOut, VectorOut> &out) {
    const auto &[v, a] = motion;
    const auto &[A, rates, H, g] = out;
    const std::size_t n = same_size({&v, &a}), k = rates.shape(1);
    expect(rates.shape(0) == 3 && A.shape(0) == k && (k == 0 || A.shape(1) == n), "A (k, n), rates (3, k)");
    expect(H.shape(0) == n && H.shape(1) == n && g.size() == n && rules.size() == 6, "H (n, n), g (n,), six rules");
    TaskRows rows{n, std::vector<double>(k * n), {}, {}, {}, {}, {}, {}, std::vector<char>(k)};
    std::vector<double> *columns[6] = {&rows.error, &rows.wanted, &rows.cost, &rows.asked, &rows.change, &rows.drift};
    for (auto *column : columns) column->resize(k);
    std::size_t first = 0;
    for (nb::handle each : parts) {
        const nb::tuple part = nb::cast<nb::tuple>(each);
        expect(part.size() == 7, "seven arrays of a task");
        const std::size_t size = nb::len(nb::object(part[3]));
        expect(first + size <= k, "rows of tasks (k,)");
        read_given(part[0], size, n, rows.J.data() + first * n);
        for (std::size_t c = 0; c < 6; ++c) read_given(part[c + 1], size, 1, columns[c]->data() + first);
        std::fill_n(rows.by_rate.begin() + first, size, !part[4].is_none());
        first += size;
    }
    const bool inside = measured.first >= 0 && measured.first <= measured.second && std::size_t(measured.second) <= k;
    expect(first == k && inside, "rows of tasks (k,)");
    check_rows(main, k);
    const double *r = rules.data();
    const TaskSummary found =
        task_program(rows, v.data(), a.data(), main.data(), main.size(), measured.first, measured.second, weight,
                     {r[0], r[1], r[2], r[3], r[4], r[5]}, {A.data(), rates.data(), H.data(), g.data()});
    return {found.error, found.manipulability};
}

// e (6,), J (6, n) and the matrix (6, 6) that takes twists to rates of e; `X_WF`, `X_WT` (4, 4), `J` (6, n) of twists.
static nb::tuple pose_rows(const Strided &X_WF, const Strided &X_WT, const Strided &J) {
    expect(J.ndim() == 2, "a Jacobian (6, n)");
    const std::size_t n = J.shape(1);
    const std::vector<double> twists = read(J, 6, n);
    std::vector<double> error(6), turn(36), rows(6 * n);
    pose_error(pose_of(X_WF), pose_of(X_WT), error.data(), turn.data());
    for (std::size_t i = 0; i < 6; ++i)
        for (std::size_t k = i < 3 ? i : 3; k < (i < 3 ? i + 1 : 6); ++k)
            for (std::size_t j = 0; j < n; ++j) rows[i * n + j] += turn[6 * i + k] * twists[k * n + j];
    return nb::make_tuple(to_numpy(std::move(error), {6}), to_numpy(std::move(rows), {6, n}),
                          to_numpy(std::move(turn), {6, 6}));
}

// Rates for vectors (3,) one behind the other; `limits`: the speed of each, and how quickly it is lost.
static nb::ndarray<nb::numpy, double> capped_rates(const Vector &error, double gain, const Vector &limits) {
    expect(error.size() % 3 == 0 && 3 * limits.size() == 2 * error.size(), "vectors (3,), two limits of each");
    std::vector<double> found(error.size());
    for (std::size_t k = 0; k < error.size(); k += 3)
        capped(error.data() + k, gain, limits.data()[2 * k / 3], limits.data()[2 * k / 3 + 1], found.data() + k);
    return to_numpy(std::move(found), {error.size()});
}

static nb::ndarray<nb::numpy, double> curbed_rates(const Vector &error, double gain, const Vector &brake,
                                                   const Vector &speed) {
    const std::size_t n = same_size({&error, &brake, &speed});
    std::vector<double> found(n);
    curbed(error.data(), gain, brake.data(), speed.data(), n, found.data());
    return to_numpy(std::move(found), {n});
}

// Norms, over the rows `main`, of what velocities x (n,) leave of what is wanted, and of that.
static std::pair<double, double> undone(const Matrix &A, const Vector &wanted, const Indices &main, const Vector &x) {
    expect(A.shape(0) == wanted.size() && A.shape(1) == x.size(), "A (k, n), wanted (k,), x (n,)");
    check_rows(main, wanted.size());
    return {norm_left(A.data(), wanted.data(), x.data(), main.data(), main.size(), x.size()),
            norm_of(wanted.data(), main.data(), main.size())};
}

// Whether there is no NaN and no infinity in arrays of one or two axes, and their squares do not overflow.
static bool is_finite(const nb::args &arrays) {
    double sum = 0.0;
    for (nb::handle each : arrays) {
        const Strided array = array_of<Strided>(each);
        expect(array.ndim() == 1 || array.ndim() == 2, "arrays of one or two axes");
        const bool flat = array.ndim() == 1;
        for (std::size_t i = 0; i < array.shape(0); ++i)
            for (std::size_t j = 0; j < (flat ? 1 : array.shape(1)); ++j) {
                const std::int64_t across = flat ? 0 : std::int64_t(j) * array.stride(1);
                const double x = array.data()[std::int64_t(i) * array.stride(0) + across];
                sum += x * x;
            }
    }
    return std::isfinite(sum);
}

// Rows of one limit, with what each is about: `optiplan.control.limits.row_limit.LimitRows`, whose arrays are made when
// they are used.
struct NamedRows : LimitRows {
    nb::object labels;

    NamedRows(LimitRows rows, nb::object labels) : LimitRows(std::move(rows)), labels(std::move(labels)) {}
};

// C (m, n), low and high (m,) of rows of all limits, one below the other.
static nb::tuple stack_rows(const nb::list &parts, std::size_t n) {
    std::vector<double> C, low, high;
    for (nb::handle part : parts) {
        const NamedRows *native = nullptr;
        if (nb::try_cast(part, native)) {
            expect(native->n == n, "rows (k, n)");
            C.insert(C.end(), native->G.begin(), native->G.end());
            low.insert(low.end(), native->low.begin(), native->low.end());
            high.insert(high.end(), native->high.begin(), native->high.end());
            continue;
        }
        const std::size_t first = low.size(), size = nb::len(part);
        C.resize((first + size) * n), low.resize(first + size), high.resize(first + size);
        read_given(part.attr("G"), size, n, C.data() + first * n);
        read_given(part.attr("low"), size, 1, low.data() + first);
        read_given(part.attr("high"), size, 1, high.data() + first);
    }
    const std::size_t m = low.size();
    return nb::make_tuple(to_numpy(std::move(C), {m, n}), to_numpy(std::move(low), {m}),
                          to_numpy(std::move(high), {m}));
}

static NamedRows rows_of_torques(const Strided &M, const Vector &h, const Vector &v, const Vector &torque, double dt,
                                 nb::object labels) {
    const std::size_t n = same_size({&h, &v, &torque});
    return {torque_rows(read(M, n, n).data(), h.data(), v.data(), torque.data(), dt, n), std::move(labels)};
}

// Of a Jacobian (6, n) and its rate of change: the rows are those at the end of the step.
static NamedRows rows_of_speeds(const Strided &J, const Strided &rate, const Vector &v, double dt, const Vector &delay,
                                const Vector &bounds, const std::vector<std::int64_t> &parts, nb::object labels) {
    const std::size_t n = same_size({&v, &delay});
    expect(bounds.size() == 3 * parts.size(), "three bounds of each part");
    for (std::int64_t part : parts) expect(part == 0 || part == 3, "linear or angular parts");
    std::vector<double> then = read(J, 6, n);
    const std::vector<double> change = read(rate, 6, n);
    for (std::size_t i = 0; i < then.size(); ++i) then[i] += dt * change[i];
    return {speed_rows(then.data(), v.data(), delay.data(), bounds.data(), parts, dt, n), std::move(labels)};
}

// What is in view, of the core's View or of another with the same arrays, which are kept here.
struct SeenRows {
    NearPairs rows;
    Matrix gradient;
    Vector distance;
    Indices near;

    SeenRows(nb::handle given, std::size_t pairs) {
        const View *view = nullptr;
        if (nb::try_cast(given, view)) {
            rows = {view->gradient.data(), view->distance.data(), view->near.data(), view->near.size(), view->q.size()};
        } else {
            gradient = array_of<Matrix>(given.attr("gradient")), distance = array_of<Vector>(given.attr("distance"));
            near = array_of<Indices>(given.attr("near"));
            expect(near.size() == distance.size() && gradient.shape(0) == near.size(), "gradients (K, n), pairs (K,)");
            rows = {gradient.data(), distance.data(), near.data(), near.size(), gradient.shape(1)};
        }
        for (std::size_t k = 0; k < rows.size; ++k) expect(std::size_t(rows.near[k]) < pairs, "pairs");
    }
};

// Rows of `StopLimit.rows`. `delay`, `brake` (n,): see Abilities; `least`, `margin` (P,); `drift`, `lost` (K,): what
// distances change by themselves in the step, and what is lost of them.
static NamedRows rows_of_stops(nb::handle view, const Vector &v, const Vector &delay, const Vector &brake,
                               const Vector &least, const Vector &margin, const Vector &drift, const Vector &lost,
                               double dt, double rate, nb::object labels) {
    const std::size_t n = same_size({&v, &delay, &brake});
    const SeenRows seen(view, same_size({&least, &margin}));
    expect(seen.rows.columns >= n && same_size({&drift, &lost}) == seen.rows.size, "gradients (K, n), drift (K,)");
    const StopRules rules{delay.data(), brake.data(), least.data(), margin.data(), drift.data(), lost.data(), dt, rate};
    return {stop_rows(seen.rows, v.data(), rules, n), std::move(labels)};
}

static void raise(const VectorOut &least, const Vector &asked, nb::handle view, double slip) {
    expect(least.size() == asked.size(), "distances (P,)");
    raise_least(least.data(), asked.data(), asked.size(), SeenRows(view, asked.size()).rows, slip);
}

static nb::object column(nb::handle self, std::vector<double> LimitRows::*values) {
    const std::vector<double> &found = nb::cast<const NamedRows &>(self).*values;
    return part(self, found, {found.size()});
}

void bind_step(nb::module_ &m) {
    nb::class_<NamedRows>(m, "LimitRows")
        .def("__len__", &NamedRows::size)
        .def_prop_ro("G",
                     [](nb::handle self) {
                         const NamedRows &rows = nb::cast<const NamedRows &>(self);
                         return part(self, rows.G, {rows.size(), rows.n});
                     })
        .def_prop_ro("low", [](nb::handle self) { return column(self, &LimitRows::low); })
        .def_prop_ro("high", [](nb::handle self) { return column(self, &LimitRows::high); })
        .def_prop_ro("unit", [](nb::handle self) { return column(self, &LimitRows::unit); })
        .def_ro("labels", &NamedRows::labels);
    m.def("is_finite", &is_finite);
    m.def("task_program", &fill_program, "parts"_a, "main"_a, "measured"_a, "motion"_a, "weight"_a, "rules"_a,
          "out"_a.noconvert());
    m.def("pose_rows", &pose_rows, "X_WF"_a, "X_WT"_a, "J"_a);
    m.def("capped", &capped_rates, "error"_a, "gain"_a, "limits"_a);
    m.def("curbed", &curbed_rates, "error"_a, "gain"_a, "brake"_a, "speed"_a);
    m.def("undone", &undone, "A"_a, "wanted"_a, "main"_a, "x"_a);
    m.def("torque_rows", &rows_of_torques, "M"_a, "h"_a, "v"_a, "torque"_a, "dt"_a, "labels"_a);
    m.def("speed_rows", &rows_of_speeds, "J"_a, "rate"_a, "v"_a, "dt"_a, "delay"_a, "bounds"_a, "parts"_a, "labels"_a);
    m.def("stop_rows", &rows_of_stops, "view"_a, "v"_a, "delay"_a, "brake"_a, "least"_a, "margin"_a, "drift"_a,
          "lost"_a, "dt"_a, "rate"_a, "labels"_a);
    m.def("stack_rows", &stack_rows, "parts"_a, "n"_a);
    m.def("raise_least", &raise, "least"_a.noconvert(), "asked"_a, "view"_a, "slip"_a);
    m.def(
        "rows_hold",
        [](const Matrix &C, const Vector &low, const Vector &high, const Vector &x, double slack) {
            const std::size_t m = same_size({&low, &high});
            expect(C.shape(0) == m && C.shape(1) == x.size(), "rows (m, n)");
            return rows_hold(C.data(), low.data(), high.data(), x.data(), m, x.size(), slack);
        },
        "C"_a, "low"_a, "high"_a, "x"_a, "slack"_a);
}

}  // namespace optiplan
