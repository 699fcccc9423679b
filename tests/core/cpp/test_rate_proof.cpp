#include "verify/rate_proof.hpp"

#include "check.hpp"

namespace optiplan::test_rate_proof {

namespace {

RateLimits limits() { return {{-1.0}, {1.0}, {{2.0}, {3.0}, {10.0}}, {{1e-9}, {1e-6}, {1e-6}}}; }

// One joint, one second: q = c0 + c1 t + c2 t^2 + c3 t^3.
Curve cubic(double a, double b, double c, double d) { return {{0.0, 1.0}, {a, b, c, d}, 3, 1}; }

}  // namespace

TEST(a_polynomial_stays_between_its_extremes_and_no_less) {
    const double bump[3] = {0.0, 1.0, 0.0};  // 2 t (1 - t): 1/2 at most
    CHECK(stays_between(bump, 3, 0.0, 0.5 + 1e-9));
    CHECK(!stays_between(bump, 3, 0.0, 0.5 - 1e-9));
    CHECK(stays_between(bump, 3, -1e-9, 1.0));
    const double nothing[2] = {std::nan(""), 0.0};
    CHECK(!stays_between(nothing, 2, -1.0, 1.0));
    const double later[3] = {0.0, std::nan(""), 0.0};
    CHECK(!stays_between(later, 3, -1.0, 1.0));
}

TEST(each_order_has_its_limit) {
    CHECK(beyond_limits(cubic(0.0, 0.5, 0.0, 0.0), limits()).order == -1);
    CHECK(beyond_limits(cubic(0.6, 0.5, 0.0, 0.0), limits()).order == 0);
    CHECK(beyond_limits(cubic(0.0, 1.6, -1.6, 0.0), limits()).order == 2);
    CHECK(beyond_limits(cubic(-0.9, 2.1, 0.0, -0.4), limits()).order == 1);
    CHECK(beyond_limits({{0.0, 0.1}, {0.0, 0.0, 0.0, 1.7}, 3, 1}, limits()).order == 3);
}

TEST(steps_at_breakpoints_add_up) {
    const Curve step{{0.0, 1.0, 2.0}, {0.0, 0.1, 0.1 + 1e-8, 0.1}, 1, 1};
    const Beyond found = beyond_limits(step, limits());
    CHECK(found.order == 4 && found.joint == 0);
    NEAR(found.value, 1e-8, 1e-12);
}

TEST(it_begins_in_the_state_and_ends_at_rest) {
    const double state[3] = {0.0, 0.5, 0.0};
    CHECK(beyond_ends(cubic(0.0, 0.5, 0.0, -1.0 / 6.0), limits(), state).order == 11);  // acceleration at the end
    CHECK(beyond_ends(cubic(0.0, 0.5, -0.5, 1.0 / 6.0), limits(), state).order == 9);   // and at the start
    CHECK(beyond_ends(cubic(0.0, 0.4, 0.0, 0.0), limits(), state).order == 8);
    const double standing[3] = {0.2, 0.0, 0.0};
    CHECK(beyond_ends(cubic(0.2, 0.0, 0.0, 0.0), limits(), standing).order == -1);
    CHECK(beyond_ends(cubic(0.3, 0.0, 0.0, 0.0), limits(), standing).order == 7);
}

}  // namespace optiplan::test_rate_proof
