// Chunks of set-points and the proof of motions in the core, for Python.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>

#include "arrays.hpp"
#include "chunks/chunk_timing.hpp"
#include "chunks/nearest_chunk.hpp"
#include "module.hpp"
#include "verify/interval_proof.hpp"
#include "verify/rate_proof.hpp"
#include "verify/torque_proof.hpp"

namespace optiplan {

using namespace nb::literals;

namespace {

Curve curve_of(const Vector &breakpoints, const Stack &coefficients, int joints) {
    const std::size_t pieces = coefficients.shape(0);
    expect(pieces > 0 && breakpoints.size() == pieces + 1 && coefficients.shape(1) > 0 && coefficients.shape(1) <= 16,
           "breakpoints (m + 1,), coefficients (m, degree + 1, n), of degree 15 at most");
    for (std::size_t i = 0; i < pieces; ++i)
        expect(breakpoints.data()[i] < breakpoints.data()[i + 1], "breakpoints that rise");
    expect(static_cast<int>(coefficients.shape(2)) == joints && joints <= 64, "the joints of the robot, 64 at most");
    return {to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1, joints};
}

nb::tuple arrays_of(Curve curve) {
    const std::size_t pieces = curve.breakpoints.size() - 1, n = static_cast<std::size_t>(curve.joints);
    return nb::make_tuple(to_numpy(std::move(curve.breakpoints), {pieces + 1}),
                          to_numpy(std::move(curve.coefficients),
                                   {pieces, static_cast<std::size_t>(curve.degree) + 1, n}));
}

JointState state_of(const Matrix &state) {
    expect(state.shape(0) == 3, "a state (3, n): position, velocity, acceleration");
    const std::size_t n = state.shape(1);
    const double *s = state.data();
    return {{s, s + n}, {s + n, s + 2 * n}, {s + 2 * n, s + 3 * n}};
}

JointLimits limits_of(const Matrix &limits) {
    expect(limits.shape(0) >= 5, "limits (5, n): lower, upper, velocity, acceleration, jerk");
    const std::size_t n = limits.shape(1);
    const auto row = [&](std::size_t k) { return Vec(limits.data() + k * n, limits.data() + (k + 1) * n); };
    return {row(0), row(1), {row(2), row(3), row(4)}};
}

void expect_chunk(const Matrix &state, const Matrix &Q, const Matrix &limits) {
    expect(Q.shape(0) > 0 && Q.shape(1) == state.shape(1) && Q.shape(1) == limits.shape(1) && Q.shape(1) <= 64,
           "a state (3, n), set-points (k, n) and limits (5, n) of the same joints");
}

// The spline and its stop: breakpoints, coefficients, and where the stop begins, s.
nb::tuple chunk_curve(const Matrix &state, const Matrix &Q, const Vector &times, bool rests, const Matrix &limits) {
    expect_chunk(state, Q, limits);
    expect(times.size() == Q.shape(0) && times.data()[0] > 0.0, "times (k,) > 0");
    const ChunkSpline spline(to_vector(times), rests);
    Curve curve = spline.curve(spline.through(state_of(state), Q.data()), Q.shape(1));
    if (!rests) append_stop(curve, limits_of(limits));
    return arrays_of(std::move(curve));
}

nb::tuple stop_curve(const Matrix &state, const Matrix &limits, double share) {
    expect(state.shape(1) == limits.shape(1) && state.shape(1) <= 64, "a state (3, n) and limits (5, n)");
    return arrays_of(stop_from(state_of(state), limits_of(limits), share));
}

// A motion, and the stop after its end.
nb::tuple with_stop(const Vector &breakpoints, const Stack &coefficients, const Matrix &limits) {
    Curve curve = curve_of(breakpoints, coefficients, static_cast<int>(limits.shape(1)));
    expect(curve.degree == 3, "coefficients (m, 4, n)");
    append_stop(curve, limits_of(limits));
    return arrays_of(std::move(curve));
}

nb::ndarray<nb::numpy, double> timed(const Matrix &state, const Matrix &Q, const Matrix &limits) {
    expect_chunk(state, Q, limits);
    Vec found = chunk_times(state_of(state), Q.data(), Q.shape(0), limits_of(limits));
    const std::size_t count = found.size();
    return to_numpy(std::move(found), {count});
}

// Everything that is proved of a motion. Not for two threads at once: other threads go on during a proof.
struct MotionProof {
    IntervalProof intervals;
    TorqueProof torques;
    RateLimits limits;
    Vec torque;
    bool limits_torque = false;

    MotionProof(const MotionProof &) = delete;
    MotionProof(IntervalProof proof, TorqueProof other, RateLimits rates, Vec most)
        : intervals(std::move(proof)), torques(std::move(other)), limits(std::move(rates)), torque(std::move(most)) {
        for (double limit : torque) limits_torque |= std::isfinite(limit);
    }
    int joints() const { return intervals.world().tree().planned; }
};

std::unique_ptr<MotionProof>
make_proof(const World &world, const Indices &kinds,
           const std::vector<std::tuple<int, std::vector<int>, std::vector<bool>, Matrix>> &kept, const Matrix &limits,
           const Vector &armature) {
    const std::size_t n = static_cast<std::size_t>(world.tree().planned);
    expect(kinds.size() == world.pairs().size(), "a kind for every pair");
    expect(limits.shape(0) == 9 && limits.shape(1) == n && n <= 64,
           "limits (9, n): lower, upper, velocity, acceleration, jerk, torque, three sums of steps");
    expect(armature.size() == n, "armature (n,)");
    const auto row = [&](std::size_t k) { return Vec(limits.data() + k * n, limits.data() + (k + 1) * n); };
    RateLimits rates{row(0), row(1), {row(2), row(3), row(4)}, {row(6), row(7), row(8)}};
    std::vector<int> kind_of(kinds.data(), kinds.data() + kinds.size());
    std::vector<KeptBoxes> boxes;
    for (const auto &[pair, joints, endless, table] : kept) {
        expect(pair >= 0 && pair < static_cast<int>(world.pairs().size()), "kept pairs of the world");
        expect(!joints.empty() && joints.size() <= 2 && table.shape(1) == 2 * joints.size() + 1,
               "one or two joints; a table of middles, halves and clearance");
        expect(endless.size() == joints.size(), "whether each joint is endless");
        KeptBoxes own{pair, {joints[0], joints.size() > 1 ? joints[1] : -1}, {false, false}, {}, {}, {}};
        for (std::size_t k = 0; k < joints.size(); ++k) {
            expect(joints[k] >= 0 && joints[k] < static_cast<int>(n), "planned joints");
            own.endless[k] = endless[k];
        }
        for (std::size_t row = 0; row < table.shape(0); ++row) {
            const double *v = table.data() + row * table.shape(1);
            for (std::size_t k = 0; k < 2; ++k) {
                const bool there = k < joints.size();
                own.low.push_back(there ? v[k] - v[joints.size() + k] : 0.0);
                own.high.push_back(there ? v[k] + v[joints.size() + k] : 0.0);
            }
            own.clearance.push_back(v[2 * joints.size()]);
        }
        boxes.push_back(std::move(own));
    }
    return std::make_unique<MotionProof>(IntervalProof(world, std::move(kind_of), std::move(boxes)),
                                         TorqueProof(world.tree(), to_vector(armature)), std::move(rates), row(5));
}

void move(MotionProof &self, int body, const Matrix &pose) {
    const auto &bodies = self.intervals.world().bodies();
    expect(body >= 0 && body < static_cast<int>(bodies.size()) && bodies[body].joint == 0 && pose.size() == 16,
           "a body that no joint carries, a pose (4, 4)");
    self.intervals.move(body, pose_at(pose.data()));
}

nb::tuple prove_limits(const MotionProof &self, const Vector &breakpoints, const Stack &coefficients,
                       const Matrix &state) {
    const Curve curve = curve_of(breakpoints, coefficients, self.joints());
    expect(state.shape(0) == 3 && state.shape(1) == coefficients.shape(2), "a state (3, n)");
    Beyond b = beyond_limits(curve, self.limits);
    if (b.order < 0) b = beyond_ends(curve, self.limits, state.data());
    return nb::make_tuple(b.order, b.joint, b.time, b.value, b.limit);
}

nb::tuple prove_torques(MotionProof &self, const Vector &breakpoints, const Stack &coefficients) {
    if (!self.limits_torque) return nb::make_tuple(-1, 0.0, 0.0);
    const Curve curve = curve_of(breakpoints, coefficients, self.joints());
    TorqueProof::Overload o;
    {
        nb::gil_scoped_release release;
        o = self.torques.overload(curve, self.torque);
    }
    return nb::make_tuple(o.joint, o.time, o.value);
}

nb::tuple prove_apart(MotionProof &self, const Vector &breakpoints, const Stack &coefficients, double clearance) {
    IntervalRules rules;
    rules.clearance[1] = clearance;
    const Curve curve = curve_of(breakpoints, coefficients, self.joints());
    Verdict v;
    {
        nb::gil_scoped_release release;
        v = self.intervals.prove(curve, rules);
    }
    return nb::make_tuple(v.pair, v.time, v.distance, v.touches, v.least[0], v.least[1], v.intervals, v.queries);
}

// A search for the nearest chunk, with the distances of a work space.
struct Nearest {
    MotionProof &proof;
    NearestChunk chunk;
    std::size_t count;
};

std::unique_ptr<Nearest> make_nearest(MotionProof &proof, const Matrix &state, const Matrix &Q, const Vector &times,
                                      bool rests, const Matrix &limits, double radius) {
    expect_chunk(state, Q, limits);
    expect(times.size() == Q.shape(0) && times.data()[0] > 0.0, "times (k,) > 0");
    expect(static_cast<int>(Q.shape(1)) == proof.joints(), "the joints of the robot");
    return std::unique_ptr<Nearest>(
        new Nearest{proof,
                    {ChunkSpline(to_vector(times), rests), state_of(state), Q.data(), limits_of(limits), radius},
                    Q.shape(0)});
}

// One step towards keeping `distance` from the robot's own bodies, and `clearance` more from obstacles; the curve then,
// without a solution None.
std::optional<nb::tuple> nearest_step(Nearest &self, double distance, double clearance, double window, double width) {
    IntervalProof &proof = self.proof.intervals;
    auto near = near_places(proof.world(), proof.placement(), self.chunk.curve(), window + clearance, width);
    for (NearPlace &place : near)
        if (proof.kind(place.pair)) place.distance -= clearance;
    if (!self.chunk.step(near, distance)) return std::nullopt;
    return arrays_of(self.chunk.curve());
}

}  // namespace

void bind_chunks(nb::module_ &m) {
    m.def("chunk_curve", &chunk_curve, "state"_a, "Q"_a, "times"_a, "rests"_a, "limits"_a);
    m.def("chunk_times", &timed, "state"_a, "Q"_a, "limits"_a);
    m.def("with_stop", &with_stop, "breakpoints"_a, "coefficients"_a, "limits"_a);
    m.def("stop_curve", &stop_curve, "state"_a, "limits"_a, "share"_a);
    nb::class_<MotionProof>(m, "MotionProof")
        .def_static("of", &make_proof, "world"_a, "kinds"_a, "kept"_a, "limits"_a, "armature"_a)
        .def("move", &move, "body"_a, "pose"_a)
        .def("limits", &prove_limits, "breakpoints"_a, "coefficients"_a, "state"_a)
        .def("torques", &prove_torques, "breakpoints"_a, "coefficients"_a)
        .def("apart", &prove_apart, "breakpoints"_a, "coefficients"_a, "clearance"_a);
    nb::class_<Nearest>(m, "NearestChunk")
        .def_static("of", &make_nearest, "proof"_a, "state"_a, "Q"_a, "times"_a, "rests"_a, "limits"_a, "radius"_a,
                    nb::keep_alive<0, 1>())
        .def("step", &nearest_step, "distance"_a, "clearance"_a, "window"_a, "width"_a)
        .def("set_points", [](const Nearest &self) {
            Vec made = self.chunk.set_points();
            const std::size_t n = made.size() / self.count;
            return to_numpy(std::move(made), {self.count, n});
        });
}

}  // namespace optiplan
