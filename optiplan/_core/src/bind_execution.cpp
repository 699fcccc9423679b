// Time laws along proved paths, for Python.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>

#include "arrays.hpp"
#include "execution/path_watch.hpp"
#include "execution/set_point_history.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

namespace {

// A path with the search of laws along it, up to `end`.
struct PathLaws {
    std::shared_ptr<PathTables> tables;
    LawRules rules;
    double end;
};

std::unique_ptr<PathLaws> make_laws(Vector breakpoints, Stack coefficients, Matrix limits, Vector ends,
                                    const std::vector<const Tree *> &trees, double width, Vector rules) {
    const std::size_t n = coefficients.shape(2);
    expect(coefficients.size() > 0 && breakpoints.size() == coefficients.shape(0) + 1,
           "breakpoints (m + 1,), coefficients (m, degree + 1, n)");
    expect(limits.shape(0) == 3 && limits.shape(1) == n, "limits (3, n): acceleration, jerk, torque");
    expect(ends.size() == trees.size() && !trees.empty(), "a tree for every load");
    expect(rules.size() == 4, "step, look, most rate, most jerk");
    std::vector<Load> loads;
    for (std::size_t k = 0; k < trees.size(); ++k) {
        expect(trees[k] && trees[k]->planned == static_cast<int>(n), "trees of n joints");
        loads.push_back({ends.data()[k], *trees[k]});
    }
    Curve path{to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1,
               static_cast<int>(n)};
    const double *l = limits.data(), *r = rules.data();
    JointRates rates{{l, l + n}, {l + n, l + 2 * n}, {l + 2 * n, l + 3 * n}};
    const nb::gil_scoped_release release;
    auto tables = std::make_shared<PathTables>(std::move(path), std::move(rates), std::move(loads), width);
    const double end = tables->length();
    return std::make_unique<PathLaws>(PathLaws{std::move(tables), LawRules{r[0], r[1], r[2], r[3], 0.0}, end});
}

LawSearch search_of(const PathLaws &self, double reserve) {
    LawRules rules = self.rules;
    rules.reserve = reserve;
    return {*self.tables, rules, self.end};
}

std::optional<TimeLaw> change(const PathLaws &self, double s, double ds, double dds, double begin, double target,
                              double reserve) {
    TimeLaw law;
    const LawSearch search = search_of(self, reserve);
    if (!search.change({s, ds, dds}, begin, target, law) || !search.holds(law, begin)) return std::nullopt;
    return law;
}

std::optional<TimeLaw> change_along(const PathLaws &self, const TimeLaw &old, double now, double target,
                                    double reserve) {
    TimeLaw law;
    if (!search_of(self, reserve).change_along(old, now, target, law)) return std::nullopt;
    return law;
}

std::optional<TimeLaw> rest_to_rest(const PathLaws &self, double s, double begin) {
    TimeLaw law;
    if (!search_of(self, 0.0).rest_to_rest(s, begin, law)) return std::nullopt;
    return law;
}

// Whether the motion itself, which was not planned, keeps the limits of torque.
bool keeps_torque(const PathLaws &self) {
    const TimeLaw as_it_is{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {self.end, {self.end, 1.0, 0.0}, 0.0}}};
    return search_of(self, 0.0).holds(as_it_is, 0.0, false);
}

// q, v, a and tau (4, n), and s, ds, dds, at time t of a law.
nb::tuple set_point(const PathLaws &self, const TimeLaw &law, double t) {
    const std::size_t n = self.tables->joints();
    LawState state = law.at(t);
    if (state.s >= self.end) state = {self.end, 0.0, 0.0};
    std::vector<double> at(4 * n);
    self.tables->derivatives(state.s, at.data());
    for (std::size_t j = 0; j < n; ++j) {
        at[2 * n + j] = at[2 * n + j] * state.ds * state.ds + at[n + j] * state.dds;
        at[n + j] *= state.ds;
    }
    // At the end of a way back the robot still carries what it does on the stretch: the event there is not undone.
    const bool back_at_event = state.s >= self.end && self.end < self.tables->length();
    self.tables->torques(state.s, back_at_event, at.data(), at.data() + n, at.data() + 2 * n, at.data() + 3 * n);
    return nb::make_tuple(to_numpy(std::move(at), {4, n}), state.s, state.ds, state.dds);
}

void note(SetPointHistory &self, double time, Vector q, double place, int epoch) {
    expect(static_cast<int>(q.size()) == self.joints(), "a set-point (n,)");
    self.note(time, q.data(), place, epoch);
}

nb::tuple nearest_place(const SetPointHistory &self, Vector q, Vector weights) {
    const std::size_t n = static_cast<std::size_t>(self.joints());
    expect(q.size() == n && weights.size() == n, "a configuration (n,) and a weight of each joint");
    std::vector<double> off(n);
    const NearestPlace found = self.nearest(q.data(), weights.data(), off.data());
    return nb::make_tuple(to_numpy(std::move(off), {n}), found.place, found.progress, found.epoch);
}

std::unique_ptr<PathWatch> make_watch(World &world, Vector breakpoints, Stack coefficients, double width, double begin,
                                      const std::vector<double> &error) {
    const std::size_t n = coefficients.shape(2);
    expect(error.empty() || error.size() == n, "an error of each joint");
    expect(coefficients.size() > 0 && breakpoints.size() == coefficients.shape(0) + 1,
           "breakpoints (m + 1,), coefficients (m, degree + 1, n)");
    expect(static_cast<int>(n) == world.tree().planned, "a path of the world's joints");
    const Curve path{to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1,
                     static_cast<int>(n)};
    const nb::gil_scoped_release release;
    return std::make_unique<PathWatch>(world, path, width, begin, error);
}

// `poses` (k, 4, 4); `motions` (k, 5): velocity, spread, time.
std::vector<Seen> seen_of(const PathWatch &self, Indices bodies, Stack poses, Matrix motions) {
    const std::size_t count = bodies.size();
    expect(poses.shape(0) == count && poses.shape(1) == 4 && poses.shape(2) == 4, "poses (k, 4, 4)");
    expect(motions.shape(0) == count && motions.shape(1) == 5, "velocity, spread and time (k, 5)");
    std::vector<Seen> seen;
    for (std::size_t k = 0; k < count; ++k) {
        const double *m = motions.data() + 5 * k;
        expect(bodies.data()[k] >= 0 && bodies.data()[k] < self.bodies(), "bodies of the world");
        seen.push_back({static_cast<int>(bodies.data()[k]), pose_at(poses.data() + 16 * k), vec3_at(m), m[3], m[4]});
    }
    return seen;
}

// The place and both bodies; None where nothing blocks.
std::optional<nb::tuple> blocked(PathWatch &self, const TimeLaw &law, double now, Indices bodies, Stack poses,
                                 Matrix motions, double margin, double linger) {
    const Blocked found = self.blocked(law, now, seen_of(self, bodies, poses, motions), margin, linger);
    if (found.pair < 0) return std::nullopt;
    const Pair &pair = self.pair(found.pair);
    return nb::make_tuple(found.s, pair.a, pair.b);
}

// The place, both bodies and the slack, m; None where all are farther apart.
std::optional<nb::tuple> nearest(PathWatch &self, const TimeLaw &law, double now, Indices bodies, Stack poses,
                                 Matrix motions, double margin, double most) {
    const Blocked found = self.nearest(law, now, seen_of(self, bodies, poses, motions), margin, most);
    if (found.pair < 0) return std::nullopt;
    const Pair &pair = self.pair(found.pair);
    return nb::make_tuple(found.s, pair.a, pair.b, found.slack);
}

}  // namespace

void bind_execution(nb::module_ &m) {
    nb::class_<TimeLaw>(m, "TimeLaw")
        .def_static(
            "steady", [](double s, double ds, double begin) { return TimeLaw{{{begin, {s, ds, 0.0}, 0.0}}}; }, "s"_a,
            "ds"_a, "begin"_a)
        .def_prop_ro("settled", &TimeLaw::settled)
        .def_prop_ro("target", &TimeLaw::target)
        .def(
            "at",
            [](const TimeLaw &self, double t) {
                const LawState state = self.at(t);
                return nb::make_tuple(state.s, state.ds, state.dds);
            },
            "t"_a)
        .def("then", &TimeLaw::then, "next"_a)
        .def("pieces", [](const TimeLaw &self) {  // begin, s, ds, dds, ddds
            std::vector<double> rows;
            for (const LawPiece &piece : self.pieces)
                rows.insert(rows.end(), {piece.begin, piece.at.s, piece.at.ds, piece.at.dds, piece.ddds});
            return to_numpy(std::move(rows), {self.pieces.size(), 5});
        });
    nb::class_<PathLaws>(m, "PathLaws")
        .def_static("of", &make_laws, "breakpoints"_a, "coefficients"_a, "limits"_a, "ends"_a, "trees"_a, "width"_a,
                    "rules"_a)
        .def("mirrored",
             [](const PathLaws &self) {
                 return PathLaws{std::make_shared<PathTables>(self.tables->mirrored()), self.rules, self.end};
             })
        .def(
            "until", [](const PathLaws &self, double end) { return PathLaws{self.tables, self.rules, end}; }, "end"_a)
        .def("sizes",
             [](const PathLaws &self) {
                 return to_numpy(self.tables->sizes(),
                                 {5, static_cast<std::size_t>(self.tables->coarse().count), self.tables->joints()});
             })
        .def_prop_ro("overloaded", [](const PathLaws &self) { return self.tables->overloaded(); })
        .def(
            "set_curvature",
            [](PathLaws &self, Stack factors) {
                expect(factors.shape(0) == static_cast<std::size_t>(self.tables->coarse().count) &&
                           factors.shape(1) == 4 && factors.shape(2) == self.tables->joints(),
                       "factors (coarse cells, 4, n)");
                self.tables->set_curvature(to_vector(factors));
            },
            "factors"_a)
        .def("change", &change, "s"_a, "ds"_a, "dds"_a, "begin"_a, "target"_a, "reserve"_a)
        .def("change_along", &change_along, "old"_a, "now"_a, "target"_a, "reserve"_a)
        .def("rest_to_rest", &rest_to_rest, "s"_a, "begin"_a)
        .def_prop_ro("keeps_torque", &keeps_torque)
        .def("set_point", &set_point, "law"_a, "t"_a);
    nb::class_<PathWatch>(m, "PathWatch")
        .def_static("of", &make_watch, "world"_a, "breakpoints"_a, "coefficients"_a, "width"_a, "begin"_a,
                    "error"_a = std::vector<double>(), nb::keep_alive<0, 1>())
        .def(
            "add",
            [](PathWatch &self, const Body &body) {
                expect(body.joint == 0, "a body that no joint carries");
                return self.add(body);
            },
            "body"_a)
        .def("blocked", &blocked, "law"_a, "now"_a, "bodies"_a, "poses"_a, "motions"_a, "margin"_a, "linger"_a = 0.0)
        .def("nearest", &nearest, "law"_a, "now"_a, "bodies"_a, "poses"_a, "motions"_a, "margin"_a, "most"_a);
    nb::class_<SetPointHistory>(m, "SetPointHistory")
        .def(nb::init<int, double, double>(), "joints"_a, "kept"_a, "spacing"_a)
        .def("note", &note, "time"_a, "q"_a, "place"_a, "epoch"_a)
        .def("progress_at", &SetPointHistory::progress_at, "time"_a)
        .def("nearest", &nearest_place, "q"_a, "weights"_a);
}

}  // namespace optiplan
