#include "chunks/nearest_chunk.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_nearest_chunk {

namespace {

JointLimits limits() { return {{-3.0, -3.0}, {3.0, 3.0}, {{2.0, 2.0}, {10.0, 10.0}, {500.0, 500.0}}}; }

// The first joint turns by 1 rad within a second; the second stands.
Vec turn(std::size_t k, double noise = 0.0) {
    Vec Q;
    for (std::size_t i = 1; i <= k; ++i) {
        const double s = static_cast<double>(i) / static_cast<double>(k);
        Q.push_back(s * s * (3.0 - 2.0 * s) + uniform(-noise, noise)), Q.push_back(uniform(-noise, noise));
    }
    return Q;
}

Vec every(std::size_t k, double dt) {
    Vec times;
    for (std::size_t i = 1; i <= k; ++i) times.push_back(dt * static_cast<double>(i));
    return times;
}

const JointState START{{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};

double largest(const Curve &curve, int order) {
    double most = 0.0;
    for (std::size_t i = 0; i + 1 < curve.breakpoints.size(); ++i)
        for (std::size_t j = 0; j < 2; ++j)
            most = std::max(most, std::fabs(curve.coefficients[(i * 4 + order) * 2 + j]));
    return most;
}

}  // namespace

TEST(a_chunk_within_its_limits_stays) {
    const Vec Q = turn(20);
    NearestChunk chunk(ChunkSpline(every(20, 0.05), false), START, Q.data(), limits(), 0.6);
    CHECK(chunk.step({}, 0.0));
    const Vec found = chunk.set_points();
    for (std::size_t i = 0; i < Q.size(); ++i) NEAR(found[i], Q[i], 1e-3);
}

TEST(noise_beyond_the_limits_is_taken_out_and_no_more) {
    const Vec Q = turn(20, 0.02);
    const ChunkSpline spline(every(20, 0.05), false);
    const Curve plain = spline.curve(spline.through(START, Q.data()), 2);
    NearestChunk chunk(spline, START, Q.data(), limits(), 0.6);
    CHECK(chunk.step({}, 0.0));
    const Curve curve = chunk.curve();
    CHECK(2.0 * largest(plain, 2) > 10.0);
    CHECK(2.0 * largest(curve, 2) <= 10.0 && 6.0 * largest(curve, 3) <= 500.0 * (1.0 + 1e-9));
    const Vec found = chunk.set_points();
    double moved = 0.0;
    for (std::size_t i = 0; i < Q.size(); ++i) moved = std::max(moved, std::fabs(found[i] - Q[i]));
    CHECK(moved > 1e-4 && moved < 0.02);
}

TEST(set_points_are_moved_out_of_a_box) {
    const World world = arm_and_box({1.37, 1.56, 0.0});
    Placement at = world.placement();
    Vec Q = turn(20);
    for (std::size_t i = 1; i < Q.size(); i += 2) Q[i] = 0.5;  // where it is stretched, no joint takes the tip away
    NearestChunk chunk(ChunkSpline(every(20, 0.05), false), {{0.0, 0.5}, {0.0, 0.0}, {0.0, 0.0}}, Q.data(), limits(),
                       0.6);
    double least = HUGE_VAL;
    for (const NearPlace &place : near_places(world, at, chunk.curve(), 0.05, 0.02))
        least = std::min(least, place.distance);
    CHECK(least < -0.005);
    for (int round = 0; round < 4; ++round) CHECK(chunk.step(near_places(world, at, chunk.curve(), 0.05, 0.02), 2e-3));
    least = HUGE_VAL;
    for (const NearPlace &place : near_places(world, at, chunk.curve(), 0.05, 0.02))
        least = std::min(least, place.distance);
    CHECK(least > 1e-3 && least < 4e-3);
}

TEST(what_no_motion_can_do_has_no_solution) {
    const Vec Q{2.5, 0.0, -2.5, 0.0};
    NearestChunk chunk(ChunkSpline({0.01, 0.02}, false), {{0.0, 0.0}, {1.9, 0.0}, {11.0, 0.0}}, Q.data(), limits(),
                       0.6);
    CHECK(!chunk.step({}, 0.0));
}

}  // namespace optiplan::test_nearest_chunk
