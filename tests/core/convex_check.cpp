// Distances of random, parallel, nested and touching shapes, for `make sanitize`: any undefined behaviour ends it.
//
// Checks what holds of every answer: a unit normal, b - a = distance * normal, a plane across the normal that proves
// the distance, the same yes or no from `overlap_within`. Prints a hash of all bits.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>

#include "convex/convex.hpp"
#include "convex/cores.hpp"
#include "convex/triangle_mesh.hpp"

using namespace optiplan;

namespace {

std::mt19937_64 generator(7);

double uniform(double low, double high) {
    return low + (high - low) * (double(generator() >> 11) / 9007199254740992.0);
}

Vec3 point(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }

Mat3 rotation() {
    const Vec3 x = point(1.0), y = point(1.0), c = cross(x, y);
    const Vec3 u = (1.0 / norm(x)) * x, w = (1.0 / norm(c)) * c;
    return {{u, cross(w, u), w}};
}

Mat3 quarter_turn() {
    static const Mat3 turns[] = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                 {{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}},
                                 {{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}},
                                 {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}}};
    return turns[generator() % 4];
}

std::vector<Shape> shapes() {
    std::vector<Vec3> round, prism, flat;
    for (int i = 0; i < 150; ++i) {
        const Vec3 p = point(1.0);
        round.push_back((0.2 / norm(p)) * p);
    }
    for (int i = 0; i < 48; ++i)
        for (double z : {-0.2, 0.2}) prism.push_back({0.1 * std::cos(i * M_PI / 24), 0.1 * std::sin(i * M_PI / 24), z});
    for (int i = 0; i < 20; ++i) flat.push_back({uniform(-0.3, 0.3), uniform(-0.3, 0.3), 1e-5 * (i % 2)});
    std::vector<TriangleMesh::Corners> triangles;
    for (std::uint32_t i = 0; i + 2 < 96; ++i) triangles.push_back({i, i + 1, i + 2});
    return {Shape::sphere(0.1),
            Shape::capsule(0.05, 0.2),
            Shape::capsule(0.05, 0.0),
            Shape::box({0.1, 0.2, 0.3}),
            Shape::box({0.5, 0.5, 1e-5}),
            Shape::box({0.3, 0.2, 0.0}),
            Shape::cylinder(0.1, 0.2),
            Shape::cylinder(0.2, 1e-4),
            Shape::convex_hull(round),
            Shape::convex_hull(prism),
            Shape::convex_hull(flat),
            Shape::convex_hull({{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}}),
            Shape::triangles(std::make_shared<TriangleMesh>(prism, triangles)),
            Shape::half_space({0.0, 0.6, 0.8}, 0.05)};
}

double support(const Shape &shape, const Pose &X, const Vec3 &n) {
    const Vec3 local = transposed(X.R, n);
    if (shape.kind == Kind::half_space)
        return dot(n, X.p) +
               (norm(cross(local, shape.normal)) < 1e-12 && dot(local, shape.normal) > 0.0 ? shape.offset : HUGE_VAL);
    const auto reach = [&](const auto &core) { return dot(local, core.support(local)); };
    return dot(n, X.p) + with_core(shape, reach) + rounding_radius(shape);
}

std::uint64_t hash = 1469598103934665603u;
long failures = 0;

void mix(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    hash = (hash ^ bits) * 1099511628211u;
}

void expect(bool holds, const char *what, const Shape &a, const Shape &b, double distance) {
    if (holds) return;
    if (++failures <= 20) std::printf("kinds %d and %d at %g m: %s\n", int(a.kind), int(b.kind), distance, what);
}

void check(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &X_WB) {
    const Witness w = distance(a, X_WA, b, X_WB);
    for (double value : {w.distance, w.a.x, w.a.y, w.a.z, w.b.x, w.b.y, w.b.z, w.normal.x, w.normal.y, w.normal.z})
        mix(value);
    const bool mesh = a.kind == Kind::mesh || b.kind == Kind::mesh, deep_mesh = mesh && w.distance <= 1e-7;
    if (a.kind == Kind::half_space && b.kind == Kind::half_space) return;
    expect(std::fabs(norm(w.normal) - 1.0) < 1e-12, "normal is not of unit length", a, b, w.distance);
    expect(norm(w.b - w.a - w.distance * w.normal) < 5e-5, "points are not distance times normal apart", a, b,
           w.distance);
    if (!mesh) {
        const double proved = -support(a, X_WA, w.normal) - support(b, X_WB, -w.normal);
        expect(std::fabs(proved - w.distance) < 1e-7, "the plane across the normal proves another distance", a, b,
               w.distance);
    }
    for (double margin : {0.0, 0.03}) {
        const bool within = overlap_within(a, X_WA, b, X_WB, margin);
        mix(within);
        if (std::fabs(w.distance - margin) > 2e-7 && !(deep_mesh && margin == 0.0))
            expect(within == (w.distance <= margin), "overlap_within differs", a, b, w.distance);
        const double cut = distance(a, X_WA, b, X_WB, margin).distance;
        mix(cut);
        expect(w.distance > margin ? cut > margin && cut <= w.distance + 1e-7 : std::fabs(cut - w.distance) < 1e-7,
               "another answer with a cutoff", a, b, w.distance);
    }
}

// What was nearest at another pose, whether near or far from this one, leads to the same answer.
void check_features(const Shape &a, const Pose &X_WA, const Shape &b, const Pose &before, const Pose &X_WB) {
    Features features;
    distance(a, X_WA, b, before, HUGE_VAL, &features);
    const double begun = distance(a, X_WA, b, X_WB, HUGE_VAL, &features).distance,
                 anew = distance(a, X_WA, b, X_WB).distance;
    mix(begun);
    if (std::isfinite(anew) || std::isfinite(begun))
        expect(std::fabs(begun - anew) < 1e-7, "another answer with features", a, b, anew);
}

}  // namespace

int main(int count, char **arguments) {
    const int rounds = count > 1 ? std::atoi(arguments[1]) : 100;
    const std::vector<Shape> all = shapes();
    for (const Shape &a : all)
        for (const Shape &b : all)
            for (int round = 0; round < rounds; ++round) {
                const Pose X_WA{rotation(), point(0.2)};
                check(a, X_WA, b, {rotation(), point(0.6)});
                const Pose aligned{X_WA.R * quarter_turn(), X_WA.p};
                check(a, X_WA, b, aligned);
                check(a, X_WA, b, {aligned.R, X_WA * Vec3{0.0, 0.0, uniform(-0.5, 0.5)}});
                const Pose X_WB{rotation(), point(0.6)};
                check_features(a, X_WA, b, {rotation(), point(0.6)}, X_WB);
                check_features(a, X_WA, b, {X_WB.R, X_WB.p + point(0.01)}, X_WB);
                check_features(a, X_WA, b, {aligned.R, aligned.p + point(0.01)}, aligned);
                const Witness w = distance(a, X_WA, b, aligned);
                const double gaps[] = {0.0, 1e-15, -1e-15, 1e-12, 1e-9, -1e-9, 1e-7, 1e-5, -1e-5};
                if (std::isfinite(w.distance))
                    check(a, X_WA, b, {aligned.R, aligned.p + (gaps[round % 9] - w.distance) * w.normal});
            }
    std::printf("%016llx %ld failures\n", static_cast<unsigned long long>(hash), failures);
    return failures != 0;
}
