#include <algorithm>
#include <cmath>

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "module.hpp"
#include "search/edges.hpp"
#include "search/rrt_connect.hpp"
#include "search/shortcuts.hpp"

namespace optiplan {

using namespace nb::literals;

static void expect_configuration(const EdgeChecker &check, const Vector &q) {
    expect(q.size() == static_cast<std::size_t>(check.joints()), "a configuration (n,)");
}

static bool finite(const double *values, std::size_t count) {
    return std::all_of(values, values + count, [](double x) { return std::isfinite(x); });
}

static void make_checker(EdgeChecker *self, const World &world, const Matrix &arms, const Vector &torque,
                         const Vector &rules) {
    expect(arms.shape(0) == world.pairs().size() && arms.shape(1) == static_cast<std::size_t>(world.tree().planned),
           "moment arms (P, n)");
    expect(torque.size() == 0 || torque.size() == arms.shape(1), "torques (n,) or none");
    expect(rules.size() == 6, "first, margin, least, most, heavy step, spacing");
    const double *r = rules.data();
    const EdgeRules given{r[0], r[1], r[2], static_cast<int>(r[3]), r[4], r[5]};
    new (self) EdgeChecker(world, to_vector(arms), to_vector(torque), given);
}

// `rows` (5, m): box, units, limits of velocity and acceleration.
static void make_search(RrtConnect *self, EdgeChecker &check, const Vector &still, const Indices &joints,
                        const Matrix &rows, double least, int carriers, const Vector &start, const Matrix &goals,
                        double reach, std::uint64_t seed) {
    const std::size_t m = joints.size();
    expect_configuration(check, still);
    expect(rows.shape(0) == 5 && rows.shape(1) == m && start.size() == m && goals.shape(1) == m && goals.shape(0) > 0,
           "m searched joints");
    expect(m > 0 && reach > 0.0 && finite(still.data(), still.size()) && finite(start.data(), m) &&
               finite(goals.data(), goals.size()) && finite(rows.data(), 3 * m),
           "finite numbers");
    SearchSpace space;
    space.still = to_vector(still);
    for (std::size_t k = 0; k < m; ++k) {
        expect(joints.data()[k] >= 0 && joints.data()[k] < check.joints(), "joints of the robot");
        space.joints.push_back(static_cast<int>(joints.data()[k]));
    }
    const auto row = [&](int k) { return std::vector<double>(rows.data() + k * m, rows.data() + (k + 1) * m); };
    space.lower = row(0), space.upper = row(1), space.units = row(2);
    space.velocity = row(3), space.acceleration = row(4);
    for (double unit : space.units) expect(unit > 0.0, "units above 0");
    expect(carriers >= 0 && carriers <= static_cast<int>(m), "carriers among the searched joints");
    space.least = least, space.carriers = carriers;
    new (self) RrtConnect(check, std::move(space), start.data(), to_vector(goals), reach, seed);
}

static nb::ndarray<nb::numpy, double> configurations(std::vector<double> values, std::size_t n) {
    const std::size_t count = values.size() / n;
    return to_numpy(std::move(values), {count, n});
}

// The path after as many of the `draws` (attempts, 3) as `seconds` allow, with its needless corners dropped.
static nb::ndarray<nb::numpy, double> shorten(EdgeChecker &check, const Matrix &waypoints, const Vector &velocity,
                                              const Matrix &draws, double seconds) {
    expect_configuration(check, velocity);
    const std::size_t n = velocity.size();
    expect(waypoints.shape(1) == n && draws.shape(1) == 3, "waypoints (k, n), draws (attempts, 3)");
    Path path;
    for (std::size_t k = 0; k < waypoints.shape(0); ++k)
        path.emplace_back(waypoints.data() + k * n, waypoints.data() + (k + 1) * n);
    {
        nb::gil_scoped_release release;
        using Clock = std::chrono::steady_clock;
        const auto end = Clock::now() + std::chrono::duration<double>(seconds);
        const Stop stop = [end] { return Clock::now() >= end; };
        const Configuration limits = to_vector(velocity);
        drop_corners(check, path, limits, stop);
        for (std::size_t k = 0; k < draws.shape(0) && path.size() > 2 && !stop(); ++k)
            attempt_shortcut(check, path, limits, draws.data() + 3 * k);
        drop_corners(check, path, limits, stop);
    }
    std::vector<double> out;
    for (const Configuration &q : path) out.insert(out.end(), q.begin(), q.end());
    return configurations(std::move(out), n);
}

void bind_search(nb::module_ &m) {
    nb::class_<EdgeChecker>(m, "EdgeChecker")
        .def("__init__", &make_checker, "world"_a, "arms"_a, "torque"_a, "rules"_a, nb::keep_alive<1, 2>())
        .def(
            "blocked",
            [](EdgeChecker &self, const Vector &q) {
                expect_configuration(self, q);
                return self.blocked(q.data());
            },
            "q"_a)
        .def(
            "free",
            [](EdgeChecker &self, const Vector &a, const Vector &b) {
                expect_configuration(self, a);
                expect_configuration(self, b);
                return self.free(a.data(), b.data());
            },
            "a"_a, "b"_a)
        .def(
            "polyline_free",
            [](EdgeChecker &self, const Matrix &waypoints) {
                expect(waypoints.shape(1) == static_cast<std::size_t>(self.joints()), "waypoints (k, n)");
                nb::gil_scoped_release release;
                return self.polyline_free(waypoints.data(), static_cast<int>(waypoints.shape(0)));
            },
            "waypoints"_a);
    m.def("shorten", &shorten, "check"_a, "waypoints"_a, "velocity"_a, "draws"_a, "seconds"_a);
    nb::class_<RrtConnect>(m, "RrtConnect")
        .def("__init__", &make_search, "check"_a, "still"_a, "joints"_a, "rows"_a, "least"_a, "carriers"_a, "start"_a,
             "goals"_a, "reach"_a, "seed"_a, nb::keep_alive<1, 2>())
        .def("grow", &RrtConnect::grow, "iterations"_a, "seconds"_a, nb::call_guard<nb::gil_scoped_release>())
        .def_prop_ro("iterations", &RrtConnect::iterations)
        .def_prop_ro("met", &RrtConnect::met)
        .def_prop_ro("full", &RrtConnect::full)
        .def(
            "size",
            [](const RrtConnect &self, int tree) {
                expect(tree == 0 || tree == 1, "tree 0 or 1");
                return self.size(tree);
            },
            "tree"_a)
        .def(
            "path",
            [](const RrtConnect &self, std::size_t n) {
                expect(self.met() && n > 0, "trees that have met");
                return configurations(self.path(), n);
            },
            "joints"_a)
        .def(
            "sample",
            [](const RrtConnect &self, int tree, int most, std::size_t n) {
                expect((tree == 0 || tree == 1) && most > 0 && n > 0, "tree 0 or 1, at least one of its states");
                return configurations(self.sample(tree, most), n);
            },
            "tree"_a, "most"_a, "joints"_a);
}

}  // namespace optiplan
