#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "arrays.hpp"
#include "module.hpp"
#include "world/many_checks.hpp"
#include "world/sweep.hpp"
#include "world/world.hpp"

namespace optiplan {

using namespace nb::literals;

static Tree make_tree(const Indices &parents, const Stack &placements, const Matrix &screws, const Indices &leaders,
                      const Matrix &couplings, const Matrix &inertias, int planned, const Vector &gravity) {
    const std::size_t count = parents.size();
    expect(placements.shape(0) == count && placements.size() == 16 * count && screws.shape(0) == count &&
               screws.shape(1) == 6 && leaders.size() == count && couplings.shape(0) == count &&
               couplings.shape(1) == 2 && inertias.shape(0) == count && inertias.shape(1) == 13 && gravity.size() == 3,
           "a tree of J joints is made of arrays with J rows");
    Tree tree;
    tree.planned = planned;
    tree.gravity = vec3_at(gravity.data());
    tree.joints.push_back(Joint{});
    for (std::size_t j = 0; j < count; ++j) {
        const double *screw = screws.data() + 6 * j, *mass = inertias.data() + 13 * j;
        const bool revolute = norm(vec3_at(screw + 3)) > 0.5;
        expect(parents.data()[j] >= 0 && parents.data()[j] <= static_cast<std::int64_t>(j), "parents come first");
        expect(leaders.data()[j] >= 0 && leaders.data()[j] < planned, "leaders are planned joints");
        tree.joints.push_back({static_cast<int>(parents.data()[j]),
                               pose_at(placements.data() + 16 * j),
                               revolute,
                               vec3_at(revolute ? screw + 3 : screw),
                               static_cast<int>(leaders.data()[j]),
                               couplings.data()[2 * j],
                               couplings.data()[2 * j + 1],
                               mass[0],
                               vec3_at(mass + 1),
                               {{vec3_at(mass + 4), vec3_at(mass + 7), vec3_at(mass + 10)}}});
    }
    return tree;
}

static Body make_body(int joint, const Matrix &placement, std::vector<Shape> shapes, const Vector &box, double radius) {
    expect(placement.shape(0) == 4 && placement.shape(1) == 4 && box.size() == 6, "a placement (4, 4), a box (6,)");
    expect(shapes.size() == 1 || (shapes.size() > 2 && shapes.back().kind == Kind::mesh),
           "a shape, or a hull, hulls of parts, and triangles");
    const Vec3 centre = vec3_at(box.data());
    std::vector<ConvexPart> parts;
    for (std::size_t k = 1; k + 1 < shapes.size(); ++k) {
        expect(shapes[k].kind == Kind::hull, "parts that are hulls");
        parts.push_back(ConvexPart::hull(shapes[k]));
    }
    if (parts.empty()) parts.push_back({shapes.front(), centre, radius});
    if (shapes.size() > 1) shapes.erase(shapes.begin() + 1, shapes.end() - 1);
    Body body{joint,
              pose_at(placement.data()),
              std::move(shapes),
              std::move(parts),
              centre,
              vec3_at(box.data() + 3),
              radius,
              false,
              {},
              0.0};
    if (body.solid().kind == Kind::half_space) {
        body.half_space = true;
        body.normal = body.solid().normal;
        body.offset = body.solid().offset;
    }
    return body;
}

// A pair's floor about an end: pair, base, m, rise, m/rad or 1, configuration, nan for joints that do not count.
using EndOfPair = std::tuple<int, double, double, std::vector<double>>;

static World make_world(const Tree &tree, const std::vector<Body> &bodies, const IndexPairs &pairs,
                        const std::vector<std::pair<Body, std::vector<int>>> &clusters, const std::vector<int> &never,
                        const std::vector<double> &error, const std::vector<double> &tubes,
                        const std::vector<double> &floors, const std::vector<EndOfPair> &ends) {
    std::vector<std::pair<int, int>> found;
    const auto count = static_cast<std::int64_t>(bodies.size());
    for (std::size_t k = 0; k < 2 * pairs.shape(0); ++k)
        expect(pairs.data()[k] >= 0 && pairs.data()[k] < count, "pairs are indices of bodies");
    found.reserve(pairs.shape(0));
    for (std::size_t k = 0; k < pairs.shape(0); ++k)
        found.emplace_back(static_cast<int>(pairs.data()[2 * k]), static_cast<int>(pairs.data()[2 * k + 1]));
    for (const Body &body : bodies) expect(body.joint >= 0 && body.joint < tree.count(), "bodies are on joints");
    std::vector<Cluster> together;
    for (const auto &[hull, members] : clusters) {
        expect(hull.joint >= 0 && hull.joint < tree.count(), "hulls are on joints");
        for (int body : members)
            expect(body >= 0 && body < count && bodies[body].joint == hull.joint,
                   "members are bodies on their hull's joint");
        together.push_back({hull, members});
    }
    for (int pair : never)
        expect(pair >= 0 && pair < static_cast<int>(found.size()), "pairs that are never asked are pairs");
    expect(error.size() == 0 ||
               (error.size() == static_cast<std::size_t>(tree.planned) && tubes.size() == found.size()),
           "an error of each planned joint, and the tube of each pair");
    expect(floors.empty() ? ends.empty() : floors.size() == found.size(), "a floor of each pair");
    Floors kept{floors, {}};
    for (const auto &[pair, base, rise, q] : ends) {
        expect(pair >= 0 && pair < static_cast<int>(found.size()) && rise >= 0.0, "pairs that rise to their floor");
        expect(static_cast<int>(q.size()) <= tree.planned && q.size() == std::get<3>(ends.front()).size(),
               "configurations of the same planned joints");
        kept.ends.push_back({pair, base, rise, q});
    }
    return World(tree, bodies, found, together, never, {error, tubes}, std::move(kept));
}

static nb::ndarray<nb::numpy, double> poses(const Tree &tree, const Matrix &Q) {
    expect(Q.shape(1) == static_cast<std::size_t>(tree.planned), "configurations (N, n)");
    std::vector<double> out;
    std::vector<Pose> at(tree.joints.size());
    out.reserve(Q.shape(0) * at.size() * 16);
    for (std::size_t row = 0; row < Q.shape(0); ++row) {
        tree.poses(Q.data() + row * Q.shape(1), at.data());
        for (const Pose &X : at) {
            for (int i = 0; i < 3; ++i) out.insert(out.end(), {X.R.rows[i].x, X.R.rows[i].y, X.R.rows[i].z, X.p[i]});
            out.insert(out.end(), {0.0, 0.0, 0.0, 1.0});
        }
    }
    return to_numpy(std::move(out), {Q.shape(0), at.size(), 4, 4});
}

static nb::ndarray<nb::numpy, double> gravity(const Tree &tree, const Matrix &Q) {
    expect(Q.shape(1) == static_cast<std::size_t>(tree.planned), "configurations (N, n)");
    std::vector<double> out(Q.size());
    std::vector<Pose> at(tree.joints.size());
    for (std::size_t row = 0; row < Q.shape(0); ++row) {
        tree.poses(Q.data() + row * Q.shape(1), at.data());
        tree.gravity_torques(at.data(), out.data() + row * Q.shape(1));
    }
    return to_numpy(std::move(out), {Q.shape(0), Q.shape(1)});
}

static void expect_configurations(const World &world, const Matrix &Q) {
    expect(Q.shape(1) == static_cast<std::size_t>(world.tree().planned), "configurations (N, n)");
}

// Rows, pairs, distances (K,), vectors (K, 3, 3): points on a and b, normal; and gradients (K, n).
static nb::tuple contacts_as_arrays(const World &world, const std::vector<Contact> &found, std::vector<double> slopes) {
    std::vector<std::int64_t> rows, pairs;
    std::vector<double> distances, vectors;
    for (const Contact &contact : found) {
        rows.push_back(contact.row);
        pairs.push_back(contact.pair);
        distances.push_back(contact.witness.distance);
        for (const Vec3 &v : {contact.witness.a, contact.witness.b, contact.witness.normal})
            vectors.insert(vectors.end(), {v.x, v.y, v.z});
    }
    const std::size_t count = found.size();
    return nb::make_tuple(to_numpy(std::move(rows), {count}), to_numpy(std::move(pairs), {count}),
                          to_numpy(std::move(distances), {count}), to_numpy(std::move(vectors), {count, 3, 3}),
                          to_numpy(std::move(slopes), {count, static_cast<std::size_t>(world.tree().planned)}));
}

static nb::tuple near(const World &world, const Matrix &Q, double cutoff) {
    expect_configurations(world, Q);
    const std::size_t n = Q.shape(1);
    std::vector<Contact> found;
    std::vector<double> slopes;
    {
        nb::gil_scoped_release release;
        Placement at = world.placement();
        Trail trail = world.trail();
        for (std::size_t row = 0; row < Q.shape(0); ++row) {
            world.place_outside(Q.data() + row * n, at);
            const std::size_t before = found.size();
            world.near(at, static_cast<int>(row), cutoff, found, trail);
            slopes.resize(found.size() * n);
            for (std::size_t k = before; k < found.size(); ++k)
                world.gradient(at.joints.data(), found[k], slopes.data() + k * n);
        }
    }
    return contacts_as_arrays(world, found, std::move(slopes));
}

static nb::object nearest(const World &world, const Matrix &Q) {
    expect_configurations(world, Q);
    expect(Q.shape(0) > 0, "a configuration");
    Placement at = world.placement();
    world.place(Q.data(), at);
    const Contact contact = world.nearest(at);
    if (contact.pair < 0) return nb::none();
    std::vector<double> slope(Q.shape(1));
    world.gradient(at.joints.data(), contact, slope.data());
    return contacts_as_arrays(world, {contact}, std::move(slope));
}

static nb::ndarray<nb::numpy, double> gradients(const World &world, const Matrix &Q, const Indices &rows,
                                                const Indices &pairs, const Stack &points, const Matrix &normals) {
    expect_configurations(world, Q);
    const std::size_t count = rows.size(), n = Q.shape(1);
    expect(pairs.size() == count && points.shape(0) == count && points.shape(1) == 2 && points.shape(2) == 3 &&
               normals.shape(0) == count && normals.shape(1) == 3,
           "K contacts");
    std::vector<double> out(count * n);
    Placement at = world.placement();
    std::int64_t placed = -1;
    for (std::size_t k = 0; k < count; ++k) {
        const std::int64_t row = rows.data()[k], pair = pairs.data()[k];
        expect(row >= 0 && row < static_cast<std::int64_t>(Q.shape(0)), "rows of the configurations");
        expect(pair >= 0 && pair < static_cast<std::int64_t>(world.pairs().size()), "pairs of the world");
        if (row != placed) world.place(Q.data() + row * n, at);
        placed = row;
        const double *p = points.data() + 6 * k;
        const Contact contact{0,
                              static_cast<int>(pair),
                              {0.0, vec3_at(p), vec3_at(p + 3), vec3_at(normals.data() + 3 * k)}};
        world.gradient(at.joints.data(), contact, out.data() + k * n);
    }
    return to_numpy(std::move(out), {count, n});
}

static bool collides(const World &world, const Vector &q) {
    expect(q.size() == static_cast<std::size_t>(world.tree().planned), "a configuration (n,)");
    Placement at = world.placement();
    world.place(q.data(), at);
    return world.collides(at);
}

static nb::ndarray<nb::numpy, std::uint8_t> touching(const World &world, const Matrix &Q) {
    expect_configurations(world, Q);
    std::vector<std::uint8_t> out(Q.shape(0));
    {
        nb::gil_scoped_release release;
        ManyChecks(world).touching(Q.data(), Q.shape(0), out.data());
    }
    return to_numpy(std::move(out), {Q.shape(0)});
}

static nb::ndarray<nb::numpy, double> lower_bounds(const World &world, const Matrix &Q) {
    expect_configurations(world, Q);
    const std::size_t count = world.pairs().size();
    std::vector<double> out(Q.shape(0) * count);
    Placement at = world.placement();
    for (std::size_t row = 0; row < Q.shape(0); ++row) {
        world.place(Q.data() + row * Q.shape(1), at);
        for (std::size_t pair = 0; pair < count; ++pair)
            out[row * count + pair] = world.lower_bound(at, static_cast<int>(pair));
    }
    return to_numpy(std::move(out), {Q.shape(0), count});
}

static nb::ndarray<nb::numpy, double> travel(const World &world, const Matrix &Q, const Matrix &D) {
    expect_configurations(world, Q);
    expect(D.shape(0) == Q.shape(0) && D.shape(1) == Q.shape(1), "half widths as configurations");
    const std::size_t count = world.pairs().size();
    std::vector<double> out(Q.shape(0) * count);
    Placement at = world.placement();
    std::vector<double> reaches;
    for (std::size_t row = 0; row < Q.shape(0); ++row) {
        world.place(Q.data() + row * Q.shape(1), at);
        world.reaches(at, reaches);
        for (std::size_t pair = 0; pair < count; ++pair)
            out[row * count + pair] = world.travel(reaches, D.data() + row * Q.shape(1), static_cast<int>(pair));
    }
    return to_numpy(std::move(out), {Q.shape(0), count});
}

static void make_sweep(Sweep *self, const World &world, const Vector &breakpoints, const Stack &coefficients,
                       const Vector &rules) {
    const std::size_t pieces = coefficients.shape(0), joints = coefficients.shape(2);
    expect(breakpoints.size() == pieces + 1 && coefficients.shape(1) > 0, "breakpoints (m + 1,) of m pieces");
    expect(joints == static_cast<std::size_t>(world.tree().planned), "coefficients (m, degree + 1, n)");
    expect(rules.size() == 4, "first, margin, resolution, most cuts");
    const double *r = rules.data();
    Curve curve{to_vector(breakpoints), to_vector(coefficients), static_cast<int>(coefficients.shape(1)) - 1,
                static_cast<int>(joints)};
    new (self) Sweep(world, std::move(curve), {r[0], r[1], r[2], static_cast<int>(r[3])});
}

static void expect_intervals(const Sweep &sweep, int begin, int end) {
    expect(0 <= begin && begin <= end && end <= sweep.intervals(), "intervals of the sweep");
}

static std::vector<double> look(Sweep &sweep, int begin, int end) {
    expect_intervals(sweep, begin, end);
    nb::gil_scoped_release release;
    std::vector<double> touching;
    sweep.look(begin, end, touching);
    return touching;
}

static std::vector<std::pair<double, int>> prove(Sweep &sweep, int begin, int end) {
    expect_intervals(sweep, begin, end);
    nb::gil_scoped_release release;
    std::vector<Touched> found;
    sweep.prove(begin, end, found);
    std::vector<std::pair<double, int>> out;
    out.reserve(found.size());
    for (const Touched &touched : found) out.emplace_back(touched.t, touched.pair);
    return out;
}

void bind_world(nb::module_ &m) {
    nb::class_<Tree>(m, "Tree")
        .def_static("of", &make_tree, "parents"_a, "placements"_a, "screws"_a, "leaders"_a, "couplings"_a, "inertias"_a,
                    "planned"_a, "gravity"_a)
        .def("poses", &poses, "Q"_a)
        .def("gravity", &gravity, "Q"_a);
    nb::class_<Body>(m, "Body").def_static("of", &make_body, "joint"_a, "placement"_a, "shapes"_a, "box"_a, "radius"_a);
    nb::class_<World>(m, "World")
        .def_static("of", &make_world, "tree"_a, "bodies"_a, "pairs"_a,
                    "clusters"_a = std::vector<std::pair<Body, std::vector<int>>>(), "never"_a = std::vector<int>(),
                    "error"_a = std::vector<double>(), "tubes"_a = std::vector<double>(),
                    "floors"_a = std::vector<double>(), "ends"_a = std::vector<EndOfPair>())
        .def("near", &near, "Q"_a, "cutoff"_a)
        .def("nearest", &nearest, "Q"_a)
        .def("gradients", &gradients, "Q"_a, "rows"_a, "pairs"_a, "points"_a, "normals"_a)
        .def("collides", &collides, "q"_a)
        .def("touching", &touching, "Q"_a)
        .def("lower_bounds", &lower_bounds, "Q"_a)
        .def("travel", &travel, "Q"_a, "D"_a)
        .def(
            "move_body",
            [](World &self, int body, const Matrix &placement) {
                const bool known = body >= 0 && body < static_cast<int>(self.bodies().size());
                expect(known && placement.size() == 16, "a body of the world, placement (4, 4)");
                self.move_body(body, pose_at(placement.data()));
            },
            "body"_a, "placement"_a);
    nb::class_<Sweep>(m, "Sweep")
        .def("__init__", &make_sweep, "world"_a, "breakpoints"_a, "coefficients"_a, "rules"_a, nb::keep_alive<1, 2>())
        .def_prop_ro("intervals", &Sweep::intervals)
        .def("look", &look, "begin"_a, "end"_a)
        .def("prove", &prove, "begin"_a, "end"_a);
}

}  // namespace optiplan
