// The optimiser's programs, for Python.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <tuple>

#include "arrays.hpp"
#include "module.hpp"
#include "program/step.hpp"

namespace optiplan {

namespace {

// Rows of one kind as `SoftRows` of planners/trajopt has them: sample (K,), value (K,), by_control (K, M n),
// by_duration (K,), price, unit.
using DenseRows = std::tuple<Indices, Vector, Matrix, Vector, double, double>;

std::shared_ptr<Spline> make_spline(Matrix derivatives, Indices order, Matrix rates, Matrix gram, Matrix limits,
                                    std::size_t fixed, double time, double jerk) {
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
    spline->time = time, spline->jerk = jerk;
    return spline;
}

// The same rows with entries of the control points around their sample alone.
Inequalities near_the_diagonal(const DenseRows &dense, const Spline &spline) {
    const auto &[sample, value, by_control, by_duration, price, unit] = dense;
    const std::size_t count = sample.shape(0), n = spline.joints, free = spline.free();
    expect(value.shape(0) == count && by_duration.shape(0) == count && by_control.shape(0) == count, "rows of one length");
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

std::optional<StepFound> solve(StepSolver &solver, Matrix control, double duration, const std::vector<DenseRows> &soft,
                               double radius, double span) {
    const Spline &spline = solver.spline();
    expect(control.shape(0) == spline.points && control.shape(1) == spline.joints, "control points (K, n)");
    std::vector<Inequalities> rows;
    std::vector<const Inequalities *> pointers;
    for (const DenseRows &part : soft) rows.push_back(near_the_diagonal(part, spline));
    for (const Inequalities &part : rows) pointers.push_back(&part);
    const double *start = control.data();
    Step step;
    {
        nb::gil_scoped_release released;
        step = solver.solve(start, duration, pointers, radius, span);
    }
    if (!step.solved) return std::nullopt;
    auto moved = to_numpy(std::move(step.control), {spline.points, spline.joints});
    return StepFound(std::move(moved), step.duration, step.promise, step.iterations);
}

}  // namespace

void bind_program(nb::module_ &m) {
    using namespace nb::literals;
    nb::class_<Spline>(m, "Spline")
        .def(nb::new_(&make_spline), "derivatives"_a, "order"_a, "rates"_a, "gram"_a, "limits"_a, "fixed"_a, "time"_a,
             "jerk"_a)
        .def("shortest_duration", [](const Spline &spline, Matrix control) {
            expect(control.shape(0) == spline.points && control.shape(1) == spline.joints, "control points (K, n)");
            return spline.shortest_duration(control.data());
        });
    nb::class_<StepSolver>(m, "StepSolver")
        .def(nb::init<std::shared_ptr<const Spline>>(), "spline"_a)
        .def("solve", &solve, "control"_a, "duration"_a, "soft"_a, "radius"_a, "span"_a);
}

}  // namespace optiplan
