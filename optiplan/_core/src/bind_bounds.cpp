#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "module.hpp"
#include "verify/box_closing.hpp"

namespace optiplan {

using namespace nb::literals;

// `ends` (2 M, 3), `radius` (M,), `joint` (M,), `body` (M,) from 0; `pairs` (P, 2) of body and box; `turns` (T, 3, 3)
// with axes as rows; `boxes` (K, 7): centre along the axes, half edges, round; `turn_of` (K,); `arms` (2 M, J).
static void make_closing(BoxClosing *self, const Tree &tree, const Matrix &ends, const Vector &radius,
                         const Indices &joint, const Indices &body, const IndexPairs &pairs, const Stack &turns,
                         const Matrix &boxes, const Indices &turn_of, const Matrix &arms) {
    const std::size_t M = radius.size(), K = boxes.shape(0), J = tree.count() - 1;
    expect(ends.shape(0) == 2 * M && ends.shape(1) == 3 && joint.size() == M && body.size() == M, "rods (M,)");
    expect(turns.shape(1) == 3 && turns.shape(2) == 3, "turns (T, 3, 3)");
    expect((K == 0 || boxes.shape(1) == 7) && turn_of.size() == K, "boxes (K, 7)");
    expect(arms.shape(0) == 2 * M && arms.shape(1) == J, "arms (2 M, J)");
    std::vector<Rod> rods(M);
    std::vector<RodBody> bodies;
    for (std::size_t k = 0; k < M; ++k) {
        const std::int64_t j = joint.data()[k], b = body.data()[k];
        expect(j > 0 && j <= static_cast<std::int64_t>(J) && b >= 0 && b <= static_cast<std::int64_t>(M), "rods");
        const double *e = ends.data() + 6 * k;
        rods[k] = {static_cast<int>(j), {vec3_at(e), vec3_at(e + 3)}, radius.data()[k]};
        if (static_cast<std::size_t>(b) >= bodies.size()) bodies.resize(b + 1);
        bodies[b].joint = static_cast<int>(j);
        bodies[b].rods.push_back(static_cast<int>(k));
    }
    for (RodBody &one : bodies) {
        for (const int r : one.rods) one.centre += (0.5 / one.rods.size()) * (rods[r].ends[0] + rods[r].ends[1]);
        one.radius = 0.0;
        for (const int r : one.rods)
            for (const Vec3 &end : rods[r].ends)
                one.radius = std::max(one.radius, norm(end - one.centre) + rods[r].radius);
    }
    for (std::size_t k = 0; k < pairs.shape(0); ++k) {
        const std::int64_t b = pairs.data()[2 * k], box = pairs.data()[2 * k + 1];
        expect(b >= 0 && b < static_cast<std::int64_t>(bodies.size()) && box >= 0 && box < static_cast<std::int64_t>(K),
               "pairs of bodies and boxes");
        bodies[b].boxes.push_back(static_cast<int>(box));
    }
    std::vector<Mat3> frames(turns.shape(0));
    for (std::size_t t = 0; t < frames.size(); ++t) {
        const double *r = turns.data() + 9 * t;
        frames[t] = {{vec3_at(r), vec3_at(r + 3), vec3_at(r + 6)}};
    }
    std::vector<ObstacleBox> obstacles(K);
    for (std::size_t k = 0; k < K; ++k) {
        const double *b = boxes.data() + 7 * k;
        expect(turn_of.data()[k] >= 0 && turn_of.data()[k] < static_cast<std::int64_t>(frames.size()),
               "turns of boxes");
        obstacles[k] = {static_cast<int>(turn_of.data()[k]), {b[0], b[1], b[2]}, {b[3], b[4], b[5]}, b[6]};
    }
    new (self)
        BoxClosing(tree, std::move(rods), std::move(bodies), std::move(obstacles), std::move(frames), to_vector(arms));
}

// What is known of each of the boxes `low`, `high` (N, n), see `Box`, by at most `parts` parts each; for motions within
// the corridor `lowest`, `highest` (n, K).
static nb::ndarray<nb::numpy, std::uint8_t> close_boxes(BoxClosing &self, const Matrix &lowest, const Matrix &highest,
                                                        const Matrix &low, const Matrix &high, std::int64_t parts) {
    const std::size_t n = self.joints(), N = low.shape(0), K = lowest.shape(1);
    expect(lowest.shape(0) == n && highest.shape(0) == n && highest.shape(1) == K && K > 0, "corridor (n, K)");
    expect(low.shape(1) == n && high.shape(0) == N && high.shape(1) == n, "boxes (N, n)");
    std::vector<std::uint8_t> found(N);
    {
        nb::gil_scoped_release release;
        self.keep_within({lowest.data(), highest.data(), static_cast<int>(K)});
        for (std::size_t k = 0; k < N; ++k)
            found[k] = static_cast<std::uint8_t>(self.close(low.data() + k * n, high.data() + k * n, parts));
    }
    return to_numpy(std::move(found), {N});
}

void bind_bounds(nb::module_ &m) {
    nb::class_<BoxClosing>(m, "BoxClosing")
        .def("__init__", &make_closing, "tree"_a, "ends"_a, "radius"_a, "joint"_a, "body"_a, "pairs"_a, "turns"_a,
             "boxes"_a, "turn_of"_a, "arms"_a)
        .def("close", &close_boxes, "lowest"_a, "highest"_a, "low"_a, "high"_a, "parts"_a);
}

}  // namespace optiplan
