#include "chunks/chunk_timing.hpp"

#include "check.hpp"
#include "verify/rate_proof.hpp"

namespace optiplan::test_chunk_timing {

namespace {

JointLimits limits() { return {{-9.0, -9.0}, {9.0, 9.0}, {{2.0, 1.5}, {10.0, 8.0}, {200.0, 500.0}}}; }

RateLimits rates() {
    const JointLimits own = limits();
    RateLimits found{own.lower,
                     own.upper,
                     {own.rates[0], own.rates[1], own.rates[2]},
                     {{1e-9, 1e-9}, {1e-6, 1e-6}, {1e-5, 1e-5}}};
    for (Vec &each : found.rates)
        for (double &limit : each) limit *= 1.0 + 1e-6;
    return found;
}

// Points on an arc of radius 0.5.
Vec arc(std::size_t k) {
    Vec Q;
    for (std::size_t i = 1; i <= k; ++i) {
        const double angle = 1.5 * static_cast<double>(i) / static_cast<double>(k);
        Q.push_back(0.5 * std::sin(angle)), Q.push_back(0.5 * (1.0 - std::cos(angle)));
    }
    return Q;
}

}  // namespace

TEST(times_keep_the_limits_and_are_short) {
    for (std::size_t k : {1u, 2u, 5u, 20u, 50u}) {
        const Vec Q = arc(k);
        const JointState start{{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
        const Vec times = chunk_times(start, Q.data(), k, limits());
        CHECK(times.size() == k);
        const ChunkSpline spline(times, true);
        CHECK(beyond_limits(spline.curve(spline.through(start, Q.data()), 2), rates()).order == -1);
        // 0.5 rad at 1.5 rad/s at least, and 0.2 s to speed up and to slow down
        CHECK(times.back() > 0.45 && times.back() < 1.1);
    }
}

TEST(a_chunk_in_motion_keeps_its_velocity) {
    const Vec Q = arc(20);
    const JointState start{{0.0, 0.0}, {1.0, 0.0}, {0.0, 0.0}}, standing{{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
    const Vec times = chunk_times(start, Q.data(), 20, limits());
    CHECK(times.size() == 20);
    CHECK(times.back() < chunk_times(standing, Q.data(), 20, limits()).back());
}

TEST(a_speed_that_leads_hardly_along_the_chunk_makes_it_little_slower) {
    const Vec Q = arc(20);
    const JointState standing{{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
    const double least = chunk_times(standing, Q.data(), 20, limits()).back();
    for (double size : {1e-15, 1e-12, 1e-9, 1e-6, 1e-3}) {
        const Vec slow = chunk_times({{0.0, 0.0}, {size, 0.0}, {0.0, 0.0}}, Q.data(), 20, limits());
        CHECK(slow.size() == 20 && slow.back() < 1.3 * least);
        const double across[2] = {-Q[1] + size * Q[0], Q[0] + size * Q[1]}, length = std::hypot(Q[0], Q[1]);
        const JointState aside{{0.0, 0.0}, {0.5 * across[0] / length, 0.5 * across[1] / length}, {0.0, 0.0}};
        const Vec times = chunk_times(aside, Q.data(), 20, limits());
        CHECK(times.size() == 20 && times.back() < 2.5 * least);
    }
}

TEST(numbers_gone_wrong_have_no_times) {
    const Vec Q{std::nan(""), 0.0};
    CHECK(chunk_times({{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}}, Q.data(), 1, limits()).empty());
}

}  // namespace optiplan::test_chunk_timing
