// Shapes and their distances.
#include "arrays.hpp"
#include "convex/convex.hpp"
#include "convex/triangle_mesh.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

namespace {

double length(double value) {
    expect(std::isfinite(value) && value >= 0.0, "lengths are finite and not negative");
    return value;
}

Shape box(const Vector &half) {
    expect(half.size() == 3, "half edges of a box (3,)");
    return Shape::box({length(half.data()[0]), length(half.data()[1]), length(half.data()[2])});
}

std::vector<Vec3> points_of(const Matrix &points) {
    expect(points.shape(1) == 3, "points (K, 3)");
    std::vector<Vec3> found;
    found.reserve(points.shape(0));
    for (std::size_t k = 0; k < points.shape(0); ++k) found.push_back(vec3_at(points.data() + 3 * k));
    return found;
}

Shape triangles(const Matrix &vertices,
                const nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig> &corners) {
    const std::vector<Vec3> points = points_of(vertices);
    std::vector<TriangleMesh::Corners> found;
    for (std::size_t k = 0; k < corners.shape(0); ++k) {
        TriangleMesh::Corners triangle;
        for (std::size_t i = 0; i < 3; ++i) {
            const std::int64_t vertex = corners.data()[3 * k + i];
            expect(vertex >= 0 && vertex < std::int64_t(points.size()), "triangles are indices of vertices");
            triangle[i] = std::uint32_t(vertex);
        }
        found.push_back(triangle);
    }
    return Shape::triangles(std::make_shared<const TriangleMesh>(points, found));
}

Shape half_space(const Vector &normal, double offset) {
    expect(normal.size() == 3 && std::fabs(norm(vec3_at(normal.data())) - 1.0) < 1e-9, "a unit normal (3,)");
    return Shape::half_space(vec3_at(normal.data()), offset);
}

std::size_t pairs_of(const Stack &X_WA, const Stack &X_WB) {
    const std::size_t count = X_WA.shape(0);
    expect(X_WB.shape(0) == count && X_WA.shape(1) == 4 && X_WA.shape(2) == 4 && X_WB.shape(1) == 4 &&
               X_WB.shape(2) == 4,
           "poses (N, 4, 4) of both shapes");
    return count;
}

nb::tuple distances(const Shape &a, const Stack &X_WA, const Shape &b, const Stack &X_WB, double cutoff) {
    const std::size_t count = pairs_of(X_WA, X_WB);
    std::vector<double> distance(count), points(6 * count), normals(3 * count);
    {
        nb::gil_scoped_release released;
        for (std::size_t k = 0; k < count; ++k) {
            const Witness w =
                optiplan::distance(a, pose_at(X_WA.data() + 16 * k), b, pose_at(X_WB.data() + 16 * k), cutoff);
            distance[k] = w.distance;
            const double vectors[] = {w.a.x, w.a.y, w.a.z, w.b.x, w.b.y, w.b.z};
            std::copy(vectors, vectors + 6, points.data() + 6 * k);
            normals[3 * k] = w.normal.x, normals[3 * k + 1] = w.normal.y, normals[3 * k + 2] = w.normal.z;
        }
    }
    return nb::make_tuple(to_numpy(std::move(distance), {count}), to_numpy(std::move(points), {count, 2, 3}),
                          to_numpy(std::move(normals), {count, 3}));
}

nb::ndarray<nb::numpy, std::uint8_t> overlaps_within(const Shape &a, const Stack &X_WA, const Shape &b,
                                                     const Stack &X_WB, double margin) {
    const std::size_t count = pairs_of(X_WA, X_WB);
    std::vector<std::uint8_t> found(count);
    {
        nb::gil_scoped_release released;
        for (std::size_t k = 0; k < count; ++k)
            found[k] = overlap_within(a, pose_at(X_WA.data() + 16 * k), b, pose_at(X_WB.data() + 16 * k), margin);
    }
    return to_numpy(std::move(found), {count});
}

}  // namespace

void bind_convex(nb::module_ &m) {
    nb::class_<Shape>(m, "Shape", "A solid in its own frame, lengths in m.")
        .def_static(
            "sphere", [](double radius) { return Shape::sphere(length(radius)); }, "radius"_a)
        .def_static(
            "capsule",
            [](double radius, double half_length) { return Shape::capsule(length(radius), length(half_length)); },
            "radius"_a, "half_length"_a, "About z; `half_length` without the caps.")
        .def_static(
            "cylinder",
            [](double radius, double half_length) { return Shape::cylinder(length(radius), length(half_length)); },
            "radius"_a, "half_length"_a, "About z.")
        .def_static("box", &box, "half"_a, "Half edges (3,).")
        .def_static(
            "convex_hull", [](const Matrix &points) { return Shape::convex_hull(points_of(points)); }, "points"_a,
            "Convex hull of points (K, 3).")
        .def_static("triangles", &triangles, "vertices"_a, "triangles"_a,
                    "Surface of triangles (M, 3), indices of vertices (K, 3); it encloses nothing.")
        .def_static("half_space", &half_space, "normal"_a, "offset"_a,
                    "All p with normal . p <= offset; unit normal (3,).");
    m.def("distances", &distances, "a"_a, "X_WA"_a, "b"_a, "X_WB"_a, "cutoff"_a = HUGE_VAL,
          "Signed distances (N,) of two shapes at N poses (N, 4, 4), their nearest points (N, 2, 3) and normals (N, 3) "
          "from A to B, world; beyond the cutoff a lower bound, with points and normal 0.");
    m.def("overlaps_within", &overlaps_within, "a"_a, "X_WA"_a, "b"_a, "X_WB"_a, "margin"_a = 0.0,
          "Whether (N,) two shapes are nearer than a margin at N poses (N, 4, 4).");
}

}  // namespace optiplan
