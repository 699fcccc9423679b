// Chunks of set-points and the proof of motions in the core, for Python.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>

#include "arrays.hpp"
#include "chunks/chunk_timing.hpp"
#include "module.hpp"
#include "verify/interval_proof.hpp"
#include "verify/rate_proof.hpp"
#include "verify/torque_proof.hpp"

namespace optiplan {

using namespace nb::literals;

namespace {

Curve curve_of(const Vector &breakpoints, const Stack &coefficients, int joints) {
    expect(breakpoints.size() == coefficients.shape(0) + 1 && coefficients.shape(1) > 0 && coefficients.shape(1) <= 16,
           "breakpoints (m + 1,), coefficients (m, degree + 1, n), of degree 15 at most");
    expect(static_cast<int>(coefficients.shape(2)) == joints && joints <= 64, "the joints of the robot, 64 at most");
    return {to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1, joints};
}

nb::tuple arrays_of(Curve curve) {
    const std::size_t pieces = curve.breakpoints.size() - 1, n = static_cast<std::size_t>(curve.joints);
    return nb::make_tuple(to_numpy(std::move(curve.breakpoints), {pieces + 1}),
                          to_numpy(std::move(curve.coefficients), {pieces, static_cast<std::size_t>(curve.degree) + 1, n}));
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
nb::tuple chunk_curve(const Matrix &state, const Matrix &Q, const Vector &times, bool rests, const Matrix &limits,
                      double share) {
    expect_chunk(state, Q, limits);
    expect(times.size() == Q.shape(0) && times.data()[0] > 0.0, "times (k,) > 0");
    const ChunkSpline spline(to_vector(times), rests);
    Curve curve = spline.curve(spline.through(state_of(state), Q.data()), Q.shape(1));
    if (!rests) append_stop(curve, limits_of(limits), share);
    return arrays_of(std::move(curve));
}

nb::tuple stop_curve(const Matrix &state, const Matrix &limits, double share) {
    return arrays_of(stop_from(state_of(state), limits_of(limits), share));
}

nb::ndarray<nb::numpy, double> timed(const Matrix &state, const Matrix &Q, const Matrix &limits) {
    expect_chunk(state, Q, limits);
    Vec found = chunk_times(state_of(state), Q.data(), Q.shape(0), limits_of(limits));
    const std::size_t count = found.size();
    return to_numpy(std::move(found), {count});
}

// Everything that is proved of a motion.
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

std::unique_ptr<MotionProof> make_proof(const World &world, const Indices &kinds,
                                        const std::vector<std::tuple<int, std::vector<int>, Matrix>> &kept,
                                        const Matrix &limits, const Vector &armature) {
    const std::size_t n = static_cast<std::size_t>(world.tree().planned);
    expect(kinds.size() == world.pairs().size(), "a kind for every pair");
    expect(limits.shape(0) == 9 && limits.shape(1) == n && n <= 64,
           "limits (9, n): lower, upper, velocity, acceleration, jerk, torque, three sums of steps");
    expect(armature.size() == n, "armature (n,)");
    const auto row = [&](std::size_t k) { return Vec(limits.data() + k * n, limits.data() + (k + 1) * n); };
    RateLimits rates{row(0), row(1), {row(2), row(3), row(4)}, {row(6), row(7), row(8)}};
    std::vector<int> kind_of(kinds.data(), kinds.data() + kinds.size());
    return std::make_unique<MotionProof>(IntervalProof(world, std::move(kind_of), {}),
                                         TorqueProof(world.tree(), to_vector(armature)), std::move(rates), row(5));
}

nb::tuple prove_limits(const MotionProof &self, const Vector &breakpoints, const Stack &coefficients, double from) {
    const Beyond b = beyond_limits(curve_of(breakpoints, coefficients, self.joints()), self.limits, from);
    return nb::make_tuple(b.order, b.joint, b.time, b.value, b.limit);
}

nb::tuple prove_torques(MotionProof &self, const Vector &breakpoints, const Stack &coefficients, double from) {
    if (!self.limits_torque) return nb::make_tuple(-1, 0.0, 0.0);
    const auto o = self.torques.overload(curve_of(breakpoints, coefficients, self.joints()), self.torque, from);
    return nb::make_tuple(o.joint, o.time, o.value);
}

nb::tuple prove_apart(MotionProof &self, const Vector &breakpoints, const Stack &coefficients, double clearance,
                      double from) {
    IntervalRules rules;
    rules.clearance = clearance;
    const Verdict v = self.intervals.prove(curve_of(breakpoints, coefficients, self.joints()), rules, from);
    return nb::make_tuple(v.pair, v.time, v.distance, v.touches, v.least[0], v.least[1], v.intervals, v.queries);
}

}  // namespace

void bind_chunks(nb::module_ &m) {
    m.def("chunk_curve", &chunk_curve, "state"_a, "Q"_a, "times"_a, "rests"_a, "limits"_a, "share"_a = 1.0);
    m.def("chunk_times", &timed, "state"_a, "Q"_a, "limits"_a);
    m.def("stop_curve", &stop_curve, "state"_a, "limits"_a, "share"_a = 1.0);
    nb::class_<MotionProof>(m, "MotionProof")
        .def_static("of", &make_proof, "world"_a, "kinds"_a, "kept"_a, "limits"_a, "armature"_a)
        .def("move", [](MotionProof &self, int body, const Matrix &pose) { self.intervals.move(body, pose_at(pose.data())); },
             "body"_a, "pose"_a)
        .def("limits", &prove_limits, "breakpoints"_a, "coefficients"_a, "begin"_a = 0.0)
        .def("torques", &prove_torques, "breakpoints"_a, "coefficients"_a, "begin"_a = 0.0)
        .def("apart", &prove_apart, "breakpoints"_a, "coefficients"_a, "clearance"_a, "begin"_a = 0.0);
}

}  // namespace optiplan
