// The certificate's own geometry, for Python.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "arrays.hpp"
#include "module.hpp"
#include "verify/plane_proof.hpp"
#include "verify/torque_proof.hpp"

namespace optiplan {

using namespace nb::literals;

namespace {

std::shared_ptr<const ProvedShape> make_shape(const Shape &outline, const Vector &round, const Matrix &points) {
    expect(round.size() == 5 && (points.size() == 0 || points.shape(1) == 3), "round (5,), points (k, 3)");
    auto shape = std::make_shared<ProvedShape>();
    shape->outline = outline;
    std::copy_n(round.data(), 5, shape->round.begin());
    for (std::size_t k = 0; k < points.shape(0); ++k) {
        const double *p = points.data() + 3 * k;
        shape->points.add({p[0], p[1], p[2]});
    }
    shape->points.pad();
    if (outline.kind == Kind::half_space)
        shape->half_space = true, shape->normal = outline.normal, shape->offset = outline.offset;
    expect(outline.kind != Kind::mesh, "the outline of a mesh");
    return shape;
}

ProvedTree make_tree(const Indices &parents, const Stack &placements, const Matrix &axes, const Vector &turns,
                     const Matrix &coupling, const Vector &offset) {
    const std::size_t joints = axes.shape(0);
    expect(parents.size() == joints + 1 && placements.shape(0) == joints + 1 && turns.size() == joints &&
               coupling.shape(0) == joints && offset.size() == joints,
           "J joints: parents (J + 1,), placements (J + 1, 4, 4), axes (J, 3), turns, coupling (J, n), offset");
    ProvedTree tree;
    for (std::size_t j = 0; j <= joints; ++j) {
        expect(parents.data()[j] >= 0 && parents.data()[j] <= static_cast<std::int64_t>(j ? j - 1 : 0),
               "parents before their children");
        tree.parents.push_back(static_cast<int>(parents.data()[j]));
        tree.placements.push_back(pose_at(placements.data() + 16 * j));
        if (!j) continue;
        tree.axes.push_back(vec3_at(axes.data() + 3 * (j - 1)));
        tree.turns.push_back(turns.data()[j - 1] > 0.5);
    }
    tree.planned = coupling.shape(1);
    tree.coupling = to_vector(coupling), tree.offset = to_vector(offset);
    return tree;
}

std::unique_ptr<PlaneProof> make_proof(const Indices &parents, const Stack &placements, const Matrix &axes,
                                       const Vector &turns, const Matrix &coupling, const Vector &offset,
                                       const std::vector<std::shared_ptr<const ProvedShape>> &shapes,
                                       const Indices &joints, const Stack &poses, const Matrix &volumes,
                                       const IndexPairs &pairs, const Indices &kinds, const Indices &exact,
                                       const Indices &first_part, const Indices &parts) {
    ProvedTree tree = make_tree(parents, placements, axes, turns, coupling, offset);
    expect(shapes.size() == joints.size() && poses.shape(0) == joints.size() && volumes.shape(0) == joints.size() &&
               (volumes.size() == 0 || volumes.shape(1) == 7),
           "joints, poses (G, 4, 4) and volumes (G, 7) of all bodies");
    std::vector<ProvedBody> bodies;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
        expect(joints.data()[k] >= 0 && joints.data()[k] < static_cast<std::int64_t>(tree.parents.size()), "joints");
        const double *v = volumes.data() + 7 * k;
        bodies.push_back({shapes[k], static_cast<int>(joints.data()[k]), pose_at(poses.data() + 16 * k), vec3_at(v),
                          vec3_at(v + 3), v[6]});
    }
    const std::size_t count = pairs.shape(0);
    expect(kinds.size() == count && exact.size() == count && first_part.size() == count + 1, "of every pair");
    std::vector<ProvedPair> all;
    for (std::size_t k = 0; k < count; ++k) {
        ProvedPair pair{static_cast<int>(pairs.data()[2 * k]),
                        static_cast<int>(pairs.data()[2 * k + 1]),
                        kinds.data()[k] ? 1 : 0,
                        exact.data()[k] != 0,
                        {}};
        const int bound = static_cast<int>(bodies.size());
        expect(pair.a >= 0 && pair.b >= 0 && pair.a < bound && pair.b < bound, "bodies of pairs");
        for (std::int64_t i = first_part.data()[k]; i < first_part.data()[k + 1]; ++i) {
            expect(i >= 0 && i < static_cast<std::int64_t>(parts.size()), "parts");
            const std::int64_t part = parts.data()[i];
            expect(part >= 0 && part < static_cast<std::int64_t>(count) && part != static_cast<std::int64_t>(k),
                   "parts");
            pair.parts.push_back(static_cast<int>(part));
        }
        all.push_back(std::move(pair));
    }
    return std::make_unique<PlaneProof>(std::move(tree), std::move(bodies), std::move(all));
}

// The same proof of bodies that stand elsewhere on their joints.
std::unique_ptr<PlaneProof> placed(const PlaneProof &self, const Stack &poses) {
    expect(poses.shape(0) == self.bodies() && poses.size() == 16 * self.bodies(), "poses (G, 4, 4)");
    auto twin = std::make_unique<PlaneProof>(self);
    for (std::size_t k = 0; k < self.bodies(); ++k) twin->put(k, pose_at(poses.data() + 16 * k));
    return twin;
}

// A motion and its intervals, as `scan` and `prove` ask for them.
struct Asked {
    ProvedMotion motion;
    ProvedIntervals intervals;
};

std::unique_ptr<Asked> make_asked(const PlaneProof &proof, const Vector &breakpoints, const Stack &coefficients,
                                  const Matrix &jump, const Indices &piece, const Vector &middle, const Vector &half,
                                  const Indices &common, const Indices &first_more, const Indices &more) {
    const std::size_t pieces = coefficients.shape(0), n = proof.planned(), count = piece.size();
    expect(breakpoints.size() == pieces + 1 && coefficients.shape(1) > 0 && coefficients.shape(1) <= 16 &&
               coefficients.shape(2) == n && jump.shape(0) == pieces && jump.shape(1) == n,
           "breakpoints (m + 1,), coefficients (m, degree + 1, n), of degree 15 at most, jump (m, n)");
    expect(middle.size() == count && half.size() == count && first_more.size() == count + 1,
           "middles, half widths and pairs of all intervals");
    const auto pair_at = [&](const Indices &pairs, std::size_t i) {
        expect(pairs.data()[i] >= 0 && pairs.data()[i] < static_cast<std::int64_t>(proof.pairs()), "pairs");
        return static_cast<int>(pairs.data()[i]);
    };
    auto asked = std::make_unique<Asked>();
    asked->motion = {to_vector(breakpoints), to_vector(coefficients), to_vector(jump),
                     static_cast<int>(coefficients.shape(1)) - 1};
    ProvedIntervals &made = asked->intervals;
    for (std::size_t i = 0; i < common.size(); ++i) made.common.push_back(pair_at(common, i));
    for (std::size_t k = 0; k < count; ++k) {
        std::vector<int> own;
        expect(piece.data()[k] >= 0 && piece.data()[k] < static_cast<std::int64_t>(pieces), "pieces");
        made.piece.push_back(static_cast<int>(piece.data()[k]));
        for (std::int64_t i = first_more.data()[k]; i < first_more.data()[k + 1]; ++i) {
            expect(i >= 0 && i < static_cast<std::int64_t>(more.size()), "pairs of intervals");
            own.push_back(pair_at(more, static_cast<std::size_t>(i)));
        }
        made.more.push_back(std::move(own));
    }
    made.middle = to_vector(middle), made.half = to_vector(half);
    return asked;
}

nb::tuple nearest_of(const NearestGap &found) { return nb::make_tuple(found.gap, found.time, found.pair); }

nb::tuple told(PlaneVerdict found) {
    const std::size_t left = found.left_pair.size();
    return nb::make_tuple(found.given_up, nb::make_tuple(found.least[0], found.least[1]),
                          nb::make_tuple(nearest_of(found.nearest[0]), nearest_of(found.nearest[1])),
                          nb::make_tuple(nearest_of(found.hull[0]), nearest_of(found.hull[1])),
                          to_numpy(std::move(found.left_interval), {left}),
                          to_numpy(std::move(found.left_pair), {left}), found.intervals, found.queries);
}

// Other threads go on meanwhile, and may ask the same object: each call works with a copy.
template <typename Call> nb::tuple on_a_copy(const PlaneProof &proof, const Call &call) {
    PlaneProof own = proof;
    PlaneVerdict found;
    {
        nb::gil_scoped_release release;
        found = call(own);
    }
    return told(std::move(found));
}

nb::tuple scan(const PlaneProof &self, const Asked &asked, double clearance) {
    return on_a_copy(self, [&](PlaneProof &own) { return own.scan(asked.motion, asked.intervals, clearance); });
}

nb::tuple prove(const PlaneProof &self, const Asked &asked, const Vector &rules, const Vector &measured,
                int most_intervals, int most_queries) {
    expect(rules.size() == 6 && measured.size() == 2, "rules (6,), measured (2,)");
    const double *r = rules.data();
    expect(r[5] > 0.0, "a shortest interval > 0");
    const PlaneRules made{r[0], r[1], r[2], {r[3], r[4]}, r[5], most_intervals, most_queries};
    const double known[2] = {measured.data()[0], measured.data()[1]};
    return on_a_copy(self, [&](PlaneProof &own) { return own.prove(asked.motion, asked.intervals, made, known); });
}

// Bounds over K intervals, of which motion (5, K, n) are bounds.
nb::tuple torque_bounds(TorqueProof &self, const Stack &motion) {
    const std::size_t count = motion.shape(1), n = motion.shape(2);
    expect(motion.shape(0) == 5 && n == self.joints(), "motion (5, K, n) of the robot's joints");
    std::vector<double> size(count * n), curvature(count * n), one(5 * n);
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < 5; ++k) std::copy_n(motion.data() + (k * count + i) * n, n, &one[k * n]);
        self.bounds(one.data(), &size[i * n], &curvature[i * n]);
    }
    return nb::make_tuple(to_numpy(std::move(size), {count, n}), to_numpy(std::move(curvature), {count, n}));
}

}  // namespace

void bind_verify(nb::module_ &m) {
    nb::class_<ProvedShape>(m, "ProvedShape").def_static("of", &make_shape, "outline"_a, "round"_a, "points"_a);
    nb::class_<Asked>(m, "ProvedMotion");
    nb::class_<TorqueProof>(m, "TorqueBounds")
        .def_static(
            "of", [](const Tree &tree, const Vector &armature) { return TorqueProof(tree, to_vector(armature)); },
            "tree"_a, "armature"_a)
        .def("over", &torque_bounds, "motion"_a);
    nb::class_<PlaneProof>(m, "PlaneProof")
        .def_static("of", &make_proof, "parents"_a, "placements"_a, "axes"_a, "turns"_a, "coupling"_a, "offset"_a,
                    "shapes"_a, "joints"_a, "poses"_a, "volumes"_a, "pairs"_a, "kinds"_a, "exact"_a, "first_part"_a,
                    "parts"_a)
        .def("placed", &placed, "poses"_a)
        .def("motion", &make_asked, "breakpoints"_a, "coefficients"_a, "jump"_a, "piece"_a, "middle"_a, "half"_a,
             "common"_a, "first_more"_a, "more"_a)
        .def("scan", &scan, "motion"_a, "clearance"_a)
        .def("prove", &prove, "motion"_a, "rules"_a, "measured"_a, "most_intervals"_a, "most_queries"_a);
}

}  // namespace optiplan
