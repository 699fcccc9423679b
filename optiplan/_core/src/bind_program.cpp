// The optimiser's programs, for Python.
#include <nanobind/stl/function.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "module.hpp"
#include "program/sqp.hpp"
#include "program/torque_demand.hpp"
#include "program/unit_extrema.hpp"

namespace optiplan {

namespace {

// Rows of one kind as `SoftRows` of planners/trajopt has them: sample (K,), value (K,), by_control (K, M n),
// by_duration (K,), price, unit.
using DenseRows = std::tuple<Indices, Vector, Matrix, Vector, double, double>;

std::shared_ptr<Spline> make_spline(Matrix derivatives, Indices order, Matrix rates, Matrix gram, Matrix limits,
                                    std::size_t fixed, double time, double jerk, bool open_end) {
    auto spline = std::make_shared<Spline>();
    spline->points = derivatives.shape(1), spline->joints = rates.shape(1), spline->fixed = fixed;
    expect(2 * fixed < spline->points, "no free control point");
    expect(order.shape(0) == derivatives.shape(0), "one order a row");
    expect(rates.shape(0) == 3 && limits.shape(0) == 2 && limits.shape(1) == spline->joints, "limits of every joint");
    expect(gram.shape(0) == spline->points && gram.shape(1) == spline->points, "gram (K, K)");
    for (std::size_t r = 0; r < derivatives.shape(0); ++r) {
        spline->derivatives.push_back(stencil_of(derivatives.data() + r * spline->points, spline->points));
        expect(order.data()[r] >= 1 && order.data()[r] <= 3, "orders are 1, 2 or 3");
        spline->order.push_back(static_cast<int>(order.data()[r]));
    }
    spline->rates = to_vector(rates), spline->gram = to_vector(gram);
    spline->lower.assign(limits.data(), limits.data() + spline->joints);
    spline->upper.assign(limits.data() + spline->joints, limits.data() + 2 * spline->joints);
    spline->time = time, spline->jerk = jerk, spline->open_end = open_end;
    return spline;
}

void expect_control(const Spline &spline, const Matrix &control) {
    expect(control.shape(0) == spline.points && control.shape(1) == spline.joints, "control points (K, n)");
}

// The same rows with entries of the control points around their sample alone.
Inequalities near_the_diagonal(const DenseRows &dense, const Spline &spline) {
    const auto &[sample, value, by_control, by_duration, price, unit] = dense;
    const std::size_t count = sample.shape(0), n = spline.joints, free = spline.free();
    expect(value.shape(0) == count && by_duration.shape(0) == count && by_control.shape(0) == count,
           "rows of one length");
    expect(by_control.shape(1) == free * n, "derivatives by every free control point");
    Inequalities rows;
    rows.price = price, rows.unit = unit, rows.compact = false;
    rows.value = to_vector(value), rows.by_duration = to_vector(by_duration);
    rows.entries.assign(count * REACH * n, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
        expect(i == 0 ? sample.data()[i] >= 0 : sample.data()[i] >= sample.data()[i - 1], "samples in rising order");
        rows.sample.push_back(static_cast<int>(sample.data()[i]));
    }
    if (count) rows.over.resize(static_cast<std::size_t>(rows.sample.back()) + 1);
    for (std::size_t i = 0; i < count;) {
        std::size_t end = i, first = free, last = 0;
        for (; end < count && rows.sample[end] == rows.sample[i]; ++end) {
            const double *row = by_control.data() + end * free * n;
            for (std::size_t k = 0; k < free * n; ++k)
                if (row[k] != 0.0) first = std::min(first, k / n), last = std::max(last, k / n);
        }
        if (first < free) {
            expect(last - first < REACH, "rows of a sample depend on neighbouring control points");
            rows.over[rows.sample[i]].first = first;
            for (std::size_t r = i; r < end; ++r)
                std::copy_n(by_control.data() + (r * free + first) * n, (last - first + 1) * n,
                            rows.entries.data() + r * REACH * n);
        }
        i = end;
    }
    return rows;
}

using StepFound = std::tuple<nb::ndarray<nb::numpy, double>, double, double, int>;

// Costs as `CostModel` of planners/trajopt has them: gradient (M n,), by T, band (M, REACH n), twice by T.
using DenseCosts = std::tuple<Vector, double, Matrix, double>;

std::optional<StepFound> solve(StepSolver &solver, Matrix control, double duration, const std::vector<DenseRows> &soft,
                               double radius, double span, double gap, const std::optional<DenseCosts> &costs) {
    const Spline &spline = solver.spline();
    SmoothCosts smooth;
    if (costs) {
        const auto &[gradient, by_duration, band, twice] = *costs;
        expect(gradient.size() == spline.free() * spline.joints && band.size() == REACH * gradient.size(),
               "costs of M n variables");
        smooth = {to_vector(gradient), to_vector(band), by_duration, twice};
    }
    expect_control(spline, control);
    std::vector<Inequalities> rows;
    std::vector<const Inequalities *> pointers;
    rows.reserve(soft.size()), pointers.reserve(soft.size());
    for (const DenseRows &part : soft) rows.push_back(near_the_diagonal(part, spline));
    for (const Inequalities &part : rows) pointers.push_back(&part);
    const double *start = control.data();
    Step step;
    {
        nb::gil_scoped_release released;
        step = solver.solve(start, duration, pointers, radius, span, gap, smooth);
    }
    if (!step.solved) return std::nullopt;
    auto moved = to_numpy(std::move(step.control), {spline.points, spline.joints});
    return StepFound(std::move(moved), step.duration, step.promise, step.iterations);
}

Samples make_samples(const Spline &spline, Vector u, Matrix position, Matrix velocity, Matrix acceleration) {
    for (const Matrix *matrix : {&position, &velocity, &acceleration})
        expect(matrix->shape(0) == u.size() && matrix->shape(1) == spline.points, "a basis (N, K) for each order");
    const double *const matrices[3] = {position.data(), velocity.data(), acceleration.data()};
    return Samples::of(u.data(), u.size(), matrices, spline.points);
}

SqpSettings make_settings(const std::map<std::string, double> &values) {
    const auto get = [&](const char *name) { return values.at(name); };
    return {get("contact_penalty"), get("torque_penalty"), get("centimetre"), get("gap")};
}

// A descent among the bodies of a world.
std::unique_ptr<Sqp> among_bodies(std::shared_ptr<const Spline> spline, const World &world, Vector torque, Vector still,
                                  double cutoff, std::tuple<double, Vector, Vector> margins,
                                  const std::map<std::string, double> &settings) {
    const auto &[middle, start, end] = margins;
    expect(start.size() == world.pairs().size() && end.size() == start.size(), "margins of all pairs");
    expect(torque.size() == spline->joints && still.size() == torque.size() &&
               world.tree().planned == static_cast<int>(spline->joints),
           "n joints");
    const auto pairs = std::make_shared<RowSearch>(world, Margins{middle, to_vector(start), to_vector(end)}, cutoff);
    NearBodies near = [pairs](const Vec &u, const Vec &Q) { return pairs->of(u, Q); };
    return std::make_unique<Sqp>(spline, std::move(near), TorqueRows(world.tree(), to_vector(torque), to_vector(still)),
                                 make_settings(settings));
}

// The same with contacts from Python: `near` takes Q (N, n) to sample (K,), value (K,) and gradient (K, n).
using FoundRows = std::tuple<Indices, Vector, Matrix>;

std::unique_ptr<Sqp> among_others(std::shared_ptr<const Spline> spline, const Tree &tree, Vector torque, Vector still,
                                  std::function<FoundRows(nb::ndarray<nb::numpy, double>)> near,
                                  const std::map<std::string, double> &settings) {
    expect(torque.size() == spline->joints && still.size() == torque.size() &&
               tree.planned == static_cast<int>(spline->joints),
           "n joints");
    const std::size_t n = spline->joints;
    NearBodies ask = [near, n](const Vec &, const Vec &Q) {
        nb::gil_scoped_acquire held;
        const auto [sample, value, gradient] = near(to_numpy(Q, {Q.size() / n, n}));
        expect(value.size() == sample.size() && gradient.size() == sample.size() * n, "rows of one length");
        NearRows rows;
        rows.sample.assign(sample.data(), sample.data() + sample.size());
        rows.value = to_vector(value), rows.gradient = to_vector(gradient);
        return rows;
    };
    return std::make_unique<Sqp>(spline, std::move(ask), TorqueRows(tree, to_vector(torque), to_vector(still)),
                                 make_settings(settings));
}

CurvePoint begin(Sqp &sqp, Matrix control) {
    const Spline &spline = sqp.spline();
    expect_control(spline, control);
    const double *start = control.data();
    nb::gil_scoped_release released;
    return sqp.begin(start);
}

std::optional<Step> next_step(Sqp &sqp, const CurvePoint &point, double radius) {
    nb::gil_scoped_release released;
    Step step = sqp.solve(point, radius);
    return step.solved ? std::optional<Step>(std::move(step)) : std::nullopt;
}

// Rows of a curve, for tests: contacts, then torques: sample, value, by_control (K, M n), by_duration.
using Laid = std::tuple<nb::ndarray<nb::numpy, std::int64_t>, nb::ndarray<nb::numpy, double>,
                        nb::ndarray<nb::numpy, double>, nb::ndarray<nb::numpy, double>>;

Laid laid_out(const Inequalities &rows, const Spline &spline) {
    const std::size_t n = spline.joints, size = spline.free() * n, count = rows.sample.size(), width = rows.width(n);
    Vec dense(count * size, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
        const Stencil &over = rows.over[rows.sample[i]];
        const double *entries = rows.entries.data() + i * width;
        for (std::size_t k = 0; k < REACH && over.first + k < spline.free(); ++k)
            for (std::size_t j = 0; j < n; ++j)
                dense[i * size + (over.first + k) * n + j] =
                    rows.compact ? over.weights[k] * entries[j] : entries[k * n + j];
    }
    std::vector<std::int64_t> sample(rows.sample.begin(), rows.sample.end());
    return {to_numpy(std::move(sample), {count}), to_numpy(rows.value, {count}),
            to_numpy(std::move(dense), {count, size}), to_numpy(rows.by_duration, {count})};
}

std::tuple<double, double, Laid, Laid> evaluate(Sqp &sqp, Matrix control, double duration) {
    const Spline &spline = sqp.spline();
    expect_control(spline, control);
    double span = 0.0;
    CurvePoint point;
    {
        const double *start = control.data();
        nb::gil_scoped_release released;
        point = sqp.evaluate(Vec(start, start + spline.points * spline.joints), duration, span);
    }
    return {point.duration, point.merit, laid_out(point.contacts, spline), laid_out(point.torques, spline)};
}

// Torques (N, n) of states Q, V, A (N, n).
nb::ndarray<nb::numpy, double> torques(InverseDynamics &dynamics, Matrix Q, Matrix V, Matrix A) {
    const std::size_t count = Q.shape(0), n = dynamics.joints();
    for (const Matrix *part : {&Q, &V, &A}) expect(part->shape(0) == count && part->shape(1) == n, "states (N, n)");
    Vec tau(count * n);
    for (std::size_t i = 0; i < count; ++i)
        dynamics.torques(Q.data() + i * n, V.data() + i * n, A.data() + i * n, tau.data() + i * n);
    return to_numpy(std::move(tau), {count, n});
}

nb::ndarray<nb::numpy, double> demand(InverseDynamics &dynamics, Vector breakpoints, Stack coefficients, Vector allowed,
                                      Vector times) {
    const std::size_t pieces = coefficients.shape(0), n = dynamics.joints();
    expect(pieces > 0 && breakpoints.size() == pieces + 1 && coefficients.shape(1) > 0,
           "breakpoints (m + 1,) of m pieces");
    expect(coefficients.shape(2) == n && allowed.size() == n, "coefficients (m, degree + 1, n), limits (n,)");
    const Curve curve{to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1,
                      static_cast<int>(n)};
    const std::vector<double> most = to_vector(allowed);
    std::vector<double> found;
    {
        nb::gil_scoped_release released;
        found = torque_demand(dynamics, curve, most, times.data(), times.size());
    }
    return to_numpy(std::move(found), {times.size()});
}

// Least and largest values of n columns of m polynomials on [0, 1]: low, high, x_low, x_high (4, n); pieces (2, n).
nb::tuple extrema_of_columns(Stack coefficients) {
    const std::size_t pieces = coefficients.shape(0), n = coefficients.shape(1), size = coefficients.shape(2);
    expect(pieces > 0 && size > 0 && size <= MOST_UNIT_COEFFICIENTS, "coefficients (m, n, d + 1) of degree 15 at most");
    Vec values(4 * n);
    std::vector<std::int64_t> where(2 * n);
    for (std::size_t j = 0; j < n; ++j) {
        const UnitExtrema e = unit_extrema(coefficients.data() + j * size, pieces, n * size, static_cast<int>(size));
        values[j] = e.low, values[n + j] = e.high, values[2 * n + j] = e.x_low, values[3 * n + j] = e.x_high;
        where[j] = static_cast<std::int64_t>(e.piece_low), where[n + j] = static_cast<std::int64_t>(e.piece_high);
    }
    return nb::make_tuple(to_numpy(std::move(values), {4, n}), to_numpy(std::move(where), {2, n}));
}

}  // namespace

void bind_program(nb::module_ &m) {
    using namespace nb::literals;
    nb::class_<Spline>(m, "Spline")
        .def(nb::new_(&make_spline), "derivatives"_a, "order"_a, "rates"_a, "gram"_a, "limits"_a, "fixed"_a, "time"_a,
             "jerk"_a, "open_end"_a = false)
        .def("shortest_duration", [](const Spline &spline, Matrix control) {
            expect_control(spline, control);
            return spline.shortest_duration(control.data());
        });
    nb::class_<StepSolver>(m, "StepSolver")
        .def(nb::init<std::shared_ptr<const Spline>>(), "spline"_a)
        .def("solve", &solve, "control"_a, "duration"_a, "soft"_a, "radius"_a, "span"_a, "gap"_a,
             "costs"_a = nb::none());
    m.def("unit_extrema", &extrema_of_columns, "coefficients"_a);
    nb::class_<InverseDynamics>(m, "InverseDynamics")
        .def(nb::init<const Tree &>(), "tree"_a)
        .def("torques", &torques, "Q"_a, "V"_a, "A"_a)
        .def("demand", &demand, "breakpoints"_a, "coefficients"_a, "allowed"_a, "times"_a);
    nb::class_<CurvePoint>(m, "CurvePoint")
        .def_prop_ro(
            "control",
            [](const CurvePoint &point) {
                const std::size_t n = point.joints;
                return to_numpy(point.control, {point.control.size() / n, n});
            },
            nb::rv_policy::automatic)
        .def_ro("duration", &CurvePoint::duration)
        .def_ro("merit", &CurvePoint::merit)
        .def_prop_ro("missing", &CurvePoint::missing)
        .def_prop_ro("nearest", &CurvePoint::nearest)
        .def_prop_ro("feasible", &CurvePoint::feasible);
    nb::class_<Step>(m, "Step").def_ro("promise", &Step::promise);
    nb::class_<Sqp>(m, "Sqp")
        .def_static("among_bodies", &among_bodies, nb::keep_alive<0, 2>(), "spline"_a, "world"_a, "torque"_a, "still"_a,
                    "cutoff"_a, "margins"_a, "settings"_a)
        .def_static("among_others", &among_others, "spline"_a, "tree"_a, "torque"_a, "still"_a, "near"_a, "settings"_a)
        .def(
            "set_samples",
            [](Sqp &sqp, Vector u, Matrix position, Matrix velocity, Matrix acceleration) {
                sqp.set_samples(make_samples(sqp.spline(), u, position, velocity, acceleration));
            },
            "u"_a, "position"_a, "velocity"_a, "acceleration"_a)
        .def("evaluate", &evaluate, "control"_a, "duration"_a)
        .def("begin", &begin, "control"_a)
        .def("step", &next_step, "point"_a, "radius"_a)
        .def("follow", &Sqp::follow, nb::call_guard<nb::gil_scoped_release>(), "point"_a, "step"_a)
        .def("watch", &Sqp::watch, nb::call_guard<nb::gil_scoped_release>(), "point"_a, "trial"_a);
}

}  // namespace optiplan
