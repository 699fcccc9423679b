#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "arrays.hpp"
#include "control/active_set.hpp"
#include "control/clearance_watch.hpp"
#include "control/joint_box.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

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

// Into `out` (14, n): bounds, lower and upper; position, velocity and acceleration of the quickest stop after dt; the
// velocity of the step nearest to it; then lower and upper ends of each limit by its number, of those that are
// returned. `table` (8, n): see JointTable. `rules`: dt, the share of it by which a new velocity moves a joint, lag.
static std::vector<std::int64_t> joint_box(const Vector &q, const Vector &v, const Vector &a, const Matrix &table,
                                           const std::vector<std::int64_t> &order, const Vector &rules,
                                           const MatrixOut &out) {
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
            "carrying",
            [](StopPath path, const Matrix &coefficients, const Vector &until, double horizon) {
                const std::size_t count = until.size(), size = coefficients.shape(1);
                expect(coefficients.shape(0) == count, "coefficients (k, powers), until (k,)");
                std::vector<Drift> drifts(count);
                for (std::size_t k = 0; k < count; ++k) {
                    const double *row = coefficients.data() + k * size;
                    drifts[k] = {{row, row + size}, until.data()[k]};
                }
                path.carry(std::move(drifts), horizon);
                return path;
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
        .def("__len__", [](const View &view) { return view.near.size(); })
        .def_prop_ro("q", member(&View::q))
        .def_prop_ro("bound", member(&View::bound))
        .def_prop_ro("near", member(&View::near))
        .def_prop_ro("distance", member(&View::distance))
        .def_prop_ro("least",
                     [](const View &view) {
                         const auto least = std::min_element(view.distance.begin(), view.distance.end());
                         expect(least != view.distance.end(), "something in view");
                         return std::pair(view.near[least - view.distance.begin()], *least);
                     })
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
    m.def("solve_from", &solve_from, "H"_a, "g"_a, "C"_a, "low"_a, "high"_a, "lower"_a, "upper"_a, "A"_a, "b"_a,
          "bounds"_a, "rows"_a, "rules"_a);
}

}  // namespace optiplan
