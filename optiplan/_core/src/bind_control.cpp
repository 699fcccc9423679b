#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>

#include "arrays.hpp"
#include "control/active_set.hpp"
#include "control/clearance_watch.hpp"
#include "control/joint_box.hpp"
#include "control/limit_rows.hpp"
#include "control/task_program.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

static std::size_t same_size(std::initializer_list<const Vector *> vectors) {
    const std::size_t n = (*vectors.begin())->size();
    for (const Vector *vector : vectors) expect(vector->size() == n, "vectors (n,)");
    return n;
}

static StopPath make_path(const Vector &q, const Vector &v, const Vector &a, const Vector &limit, const Vector &jerk,
                          double dt) {
    StopPath path;
    path.start(q.data(), v.data(), a.data(), limit.data(), jerk.data(), same_size({&q, &v, &a, &limit, &jerk}), dt);
    return path;
}

// `effects` (2, n): how far each joint turns, rad, and slides, m, what it carries. `influence` (P,), `kept`: see
// WatchRules.
static void make_watch(ClearanceWatch *self, const World &world, const Matrix &arms, const Matrix &reaches,
                       const Matrix &effects, const Vector &influence, double kept) {
    expect(arms.shape(0) == world.pairs().size() && arms.shape(1) == static_cast<std::size_t>(world.tree().planned),
           "moment arms (P, n)");
    expect(reaches.shape(0) == world.pairs().size() && reaches.shape(1) == 2, "reaches (P, 2)");
    const std::size_t n = arms.shape(1);
    expect(effects.shape(0) == 2 && effects.shape(1) == n, "turns and slides (2, n)");
    expect(influence.size() == arms.shape(0), "influence (P,)");
    const double *e = effects.data(), *i = influence.data();
    new (self) ClearanceWatch(world, to_vector(arms), to_vector(reaches), {{e, e + n}, {e + n, e + 2 * n}},
                              {{i, i + influence.size()}, kept});
}

static View look(ClearanceWatch &watch, const Vector &q, const View *before) {
    expect(q.size() == watch.joints(), "a configuration (n,)");
    expect(!before || before->bound.size() == watch.pairs(), "a view of this watch");
    return watch.look(q.data(), before);
}

static bool stop_is_clear(ClearanceWatch &watch, const StopPath &path, const View &start, const Vector &least) {
    expect(path.size() == watch.joints() && start.bound.size() == watch.pairs() && least.size() == watch.pairs(),
           "path, view and distances (P,) of this watch");
    return watch.stop_is_clear(path, start, least.data());
}

// Arrays that are written to, allocated by the caller.
using VectorOut = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MatrixOut = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
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

// What a task gave, whatever it is; nothing for None.
static void read_given(nb::handle given, std::size_t rows, std::size_t columns, double *out) {
    if (given.is_none()) return;
    Strided found;
    if (!nb::try_cast(given, found))
        found = nb::cast<Strided>(nb::module_::import_("numpy").attr("asarray")(given, "float64"));
    read(found, rows, columns, out);
}

static void check_rows(const Indices &rows, std::size_t count) {
    for (std::size_t i = 0; i < rows.size(); ++i) expect(std::size_t(rows.data()[i]) < count, "rows of the matrix");
}

// `parts`: of each task J (r, n), error, wanted, cost, rates that are asked or None, change, drift (r,) or None.
// `measured`: rows whose singular values count, first and last + 1. Returns the error and the manipulability.
static std::pair<double, double> fill_program(nb::list parts, const Indices &main, std::pair<int, int> measured,
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
static bool is_finite(nb::args arrays) {
    double sum = 0.0;
    for (nb::handle each : arrays) {
        const Strided array = nb::cast<Strided>(each);
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

static nb::tuple as_arrays(LimitRows rows) {
    const std::size_t n = rows.n, k = rows.size();
    return nb::make_tuple(to_numpy(std::move(rows.G), {k, n}), to_numpy(std::move(rows.low), {k}),
                          to_numpy(std::move(rows.high), {k}), to_numpy(std::move(rows.unit), {k}));
}

static nb::tuple rows_of_torques(const Strided &M, const Vector &h, const Vector &v, const Vector &torque, double dt) {
    const std::size_t n = same_size({&h, &v, &torque});
    return as_arrays(torque_rows(read(M, n, n).data(), h.data(), v.data(), torque.data(), dt, n));
}

// Of a Jacobian (6, n) and its rate of change: the rows are those at the end of the step.
static nb::tuple rows_of_speeds(const Strided &J, const Strided &rate, const Vector &v, double dt, const Vector &delay,
                                const Vector &bounds, const std::vector<std::int64_t> &parts) {
    const std::size_t n = same_size({&v, &delay});
    expect(bounds.size() == 3 * parts.size(), "three bounds of each part");
    for (std::int64_t part : parts) expect(part == 0 || part == 3, "linear or angular parts");
    std::vector<double> then = read(J, 6, n);
    const std::vector<double> change = read(rate, 6, n);
    for (std::size_t i = 0; i < then.size(); ++i) then[i] += dt * change[i];
    return as_arrays(speed_rows(then.data(), v.data(), delay.data(), bounds.data(), parts, dt, n));
}

static NearRows near_rows(const double *gradient, std::size_t columns, const Vector &distance, const Indices &near,
                          std::size_t pairs) {
    expect(near.size() == distance.size(), "pairs (K,)");
    check_rows(near, pairs);
    return {gradient, distance.data(), near.data(), near.size(), columns};
}

// Rows of `StopLimit.rows`. `delay`, `brake` (n,): see Abilities; `least`, `margin` (P,); `drift`, `lost` (K,): what
// distances change by themselves in the step, and what is lost of them.
static nb::tuple rows_of_stops(const Matrix &gradient, const Vector &distance, const Indices &near, const Vector &v,
                               const Vector &delay, const Vector &brake, const Vector &least, const Vector &margin,
                               const Vector &drift, const Vector &lost, double dt, double rate) {
    const std::size_t n = same_size({&v, &delay, &brake});
    expect(gradient.shape(0) == same_size({&distance, &drift, &lost}) && gradient.shape(1) >= n, "gradients (K, n)");
    const NearRows rows = near_rows(gradient.data(), gradient.shape(1), distance, near, same_size({&least, &margin}));
    const StopRules rules{delay.data(), brake.data(), least.data(), margin.data(), drift.data(), lost.data(), dt, rate};
    return as_arrays(stop_rows(rows, v.data(), rules, n));
}

static void raise(VectorOut least, const Vector &asked, const Vector &distance, const Indices &near, double slip) {
    expect(least.size() == asked.size(), "distances (P,)");
    raise_least(least.data(), asked.data(), asked.size(), near_rows(nullptr, 0, distance, near, asked.size()), slip);
}

// Into `out` (14, n): bounds, lower and upper; position, velocity and acceleration of the quickest stop after dt; the
// velocity of the step nearest to it; then lower and upper ends of each limit by its number, of those that are
// returned. `table` (8, n): see JointTable. `rules`: dt, the share of it by which a new velocity moves a joint, lag.
static std::vector<std::int64_t> joint_box(const Vector &q, const Vector &v, const Vector &a, const Matrix &table,
                                           const std::vector<std::int64_t> &order, const Vector &rules, MatrixOut out) {
    const std::size_t n = same_size({&q, &v, &a});
    expect(table.shape(0) == 8 && table.shape(1) == n && out.shape(0) == 14 && out.shape(1) == n, "a table (8, n)");
    expect(rules.size() == 3, "dt, share, lag");
    const double *t = table.data(), *r = rules.data();
    const JointTable rows{n, t, t + n, t + 2 * n, t + 3 * n, t + 4 * n, t + 5 * n, t + 6 * n, t + 7 * n};
    for (std::int64_t code : order) expect(code >= 0 && code <= 3, "limits of joints");
    JointBounds found = joint_bounds(q.data(), v.data(), a.data(), rows, order, {r[0], r[1] * r[0], r[2]});
    double *o = out.data();
    std::copy_n(found.low.data(), n, o), std::copy_n(found.high.data(), n, o + n);
    std::copy_n(found.brake.data(), 4 * n, o + 2 * n);
    for (std::size_t k = 0; k < found.made.size(); ++k)
        std::copy_n(found.intervals.data() + 2 * n * k, 2 * n, o + (6 + 2 * found.made[k]) * n);
    return std::move(found.made);
}

using Signed = std::vector<std::int64_t>;

// x (n,), active bounds and active rows; None where a few changes of the guess do not lead to the solution.
static nb::object solve_from(const Matrix &H, const Vector &g, const Matrix &C, const Vector &low, const Vector &high,
                             const Vector &lower, const Vector &upper, const Matrix &A, const Vector &b, Signed bounds,
                             Signed rows, const Vector &rules) {
    const std::size_t n = same_size({&g, &lower, &upper}), m = same_size({&low, &high}), p = b.size();
    expect(H.shape(0) == n && H.shape(1) == n && C.shape(0) == m && A.shape(0) == p && rules.size() == 4, "a program");
    expect((m == 0 || C.shape(1) == n) && (p == 0 || A.shape(1) == n), "rows (m, n), equations (p, n)");
    for (std::int64_t bound : bounds) expect(bound != 0 && std::llabs(bound) <= std::int64_t(n), "bounds of joints");
    for (std::int64_t row : rows) expect(row != 0, "rows from 1");
    const double *r = rules.data();
    ActiveSet active;
    active.bounds = std::move(bounds), active.rows = std::move(rows);
    const SmallProgram program{n,        m,          p,           H.data(),     g.data(),
                               C.data(), low.data(), high.data(), lower.data(), upper.data(),
                               A.data(), b.data()};
    if (!active.solve(program, {static_cast<int>(r[0]), r[1], r[2], r[3]})) return nb::none();
    return nb::make_tuple(to_numpy(std::move(active.x), {n}), std::move(active.bounds), std::move(active.rows));
}

// A part of a view as an array that lives as long as the view.
template <typename T>
static nb::object part(nb::handle self, const std::vector<T> &values, std::initializer_list<std::size_t> shape) {
    return nb::cast(nb::ndarray<nb::numpy, T>(const_cast<T *>(values.data()), shape, self));
}

// The getter of a member that is such an array.
template <typename Owner, typename T> static auto member(std::vector<T> Owner::*values) {
    return [values](nb::handle self) {
        const std::vector<T> &found = nb::cast<const Owner &>(self).*values;
        return part(self, found, {found.size()});
    };
}

void bind_control(nb::module_ &m) {
    nb::class_<StopPath>(m, "StopPath")
        .def_static("of", &make_path, "q"_a, "v"_a, "a"_a, "limit"_a, "jerk"_a, "dt"_a)
        .def_ro("steps", &StopPath::steps)
        .def_prop_ro("end", member(&StopPath::end))
        .def_prop_ro("way", member(&StopPath::way))
        .def(
            "strongest",
            [](const StopPath &self, int first, int last) {
                const std::size_t n = self.q.size();
                std::vector<double> found(n);
                for (std::size_t j = 0; j < n; ++j) found[j] = self.strongest(j, first, last);
                return to_numpy(std::move(found), {n});
            },
            "first"_a, "last"_a)
        .def(
            "carry",
            [](StopPath &self, const Matrix &coefficients, const Vector &until, double horizon) {
                const std::size_t count = until.size(), size = coefficients.shape(1);
                expect(coefficients.shape(0) == count, "coefficients (k, powers), until (k,)");
                std::vector<Drift> drifts(count);
                for (std::size_t k = 0; k < count; ++k) {
                    const double *row = coefficients.data() + k * size;
                    drifts[k] = {{row, row + size}, until.data()[k]};
                }
                self.carry(std::move(drifts), horizon);
            },
            "coefficients"_a, "until"_a, "horizon"_a)
        .def(
            "at",
            [](const StopPath &self, int step) {
                std::vector<double> q(self.q.size());
                self.at(step, q.data());
                return to_numpy(std::move(q), {self.q.size()});
            },
            "step"_a)
        .def(
            "motion",
            [](const StopPath &self, const Indices &steps) {
                const std::size_t n = self.q.size(), count = steps.size();
                std::vector<double> q(count * n), v(count * n);
                for (std::size_t k = 0; k < count; ++k)
                    self.at(static_cast<int>(steps.data()[k]), q.data() + k * n, v.data() + k * n);
                return nb::make_tuple(to_numpy(std::move(q), {count, n}), to_numpy(std::move(v), {count, n}));
            },
            "steps"_a);
    nb::class_<View>(m, "View")
        .def_prop_ro("bound", member(&View::bound))
        .def_prop_ro("near", member(&View::near))
        .def_prop_ro("distance", member(&View::distance))
        .def_prop_ro("gradient", [](nb::handle self) {
            const View &view = nb::cast<const View &>(self);
            return part(self, view.gradient, {view.near.size(), view.q.size()});
        });
    nb::class_<ClearanceWatch>(m, "ClearanceWatch")
        .def("__init__", &make_watch, "world"_a, "arms"_a, "reaches"_a, "effects"_a, "influence"_a, "kept"_a,
             nb::keep_alive<1, 2>())
        .def("look", &look, "q"_a, "before"_a.none())
        .def("stop_is_clear", &stop_is_clear, "path"_a, "start"_a, "least"_a);
    m.def("joint_box", &joint_box, "q"_a, "v"_a, "a"_a, "table"_a, "order"_a, "rules"_a, "out"_a.noconvert());
    m.def("is_finite", &is_finite);
    m.def("task_program", &fill_program, "parts"_a, "main"_a, "measured"_a, "motion"_a, "weight"_a, "rules"_a,
          "out"_a.noconvert());
    m.def("pose_rows", &pose_rows, "X_WF"_a, "X_WT"_a, "J"_a);
    m.def("capped", &capped_rates, "error"_a, "gain"_a, "limits"_a);
    m.def("curbed", &curbed_rates, "error"_a, "gain"_a, "brake"_a, "speed"_a);
    m.def("undone", &undone, "A"_a, "wanted"_a, "main"_a, "x"_a);
    m.def("torque_rows", &rows_of_torques, "M"_a, "h"_a, "v"_a, "torque"_a, "dt"_a);
    m.def("speed_rows", &rows_of_speeds, "J"_a, "rate"_a, "v"_a, "dt"_a, "delay"_a, "bounds"_a, "parts"_a);
    m.def("stop_rows", &rows_of_stops, "gradient"_a, "distance"_a, "near"_a, "v"_a, "delay"_a, "brake"_a, "least"_a,
          "margin"_a, "drift"_a, "lost"_a, "dt"_a, "rate"_a);
    m.def("raise_least", &raise, "least"_a.noconvert(), "asked"_a, "distance"_a, "near"_a, "slip"_a);
    m.def(
        "rows_hold",
        [](const Matrix &C, const Vector &low, const Vector &high, const Vector &x, double slack) {
            const std::size_t m = same_size({&low, &high});
            expect(C.shape(0) == m && C.shape(1) == x.size(), "rows (m, n)");
            return rows_hold(C.data(), low.data(), high.data(), x.data(), m, x.size(), slack);
        },
        "C"_a, "low"_a, "high"_a, "x"_a, "slack"_a);
    m.def("solve_from", &solve_from, "H"_a, "g"_a, "C"_a, "low"_a, "high"_a, "lower"_a, "upper"_a, "A"_a, "b"_a,
          "bounds"_a, "rows"_a, "rules"_a);
}

}  // namespace optiplan
