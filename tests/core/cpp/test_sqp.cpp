#include "program/sqp.hpp"

#include "arm.hpp"
#include "bezier.hpp"
#include "check.hpp"

namespace optiplan::test_sqp {

static Sqp descent(const NearBodies &near) {
    const Vec none{HUGE_VAL, HUGE_VAL};
    Sqp sqp(std::make_shared<Spline>(bezier()), near, TorqueRows(arm(), none, none), {1.0, 1.0, 0.01, 1e-4});
    sqp.set_samples(bezier_samples({0.2, 0.4, 0.6, 0.8}));
    return sqp;
}

TEST(a_curve_without_bodies_costs_its_duration_and_steps_shorten_it) {
    Sqp sqp = descent([](const Vec &, const Vec &) { return NearRows{}; });
    CurvePoint here = sqp.begin(control().data());
    NEAR(here.duration, sqp.spline().shortest_duration(here.control.data()), 1e-14);
    NEAR(here.merit, here.duration, 1e-14);
    CHECK(here.feasible() && here.missing() == 0.0 && std::isinf(here.nearest()));
    for (int k = 0; k < 5; ++k) {
        const Step step = sqp.solve(here, 0.05);
        CHECK(step.solved);
        const CurvePoint next = sqp.follow(here, step);
        CHECK(next.merit < here.merit + 1e-9);
        here = next;
    }
    CHECK(here.duration < 0.95 * sqp.spline().shortest_duration(control().data()));
}

TEST(contacts_cost_and_make_it_infeasible) {
    Sqp sqp = descent([](const Vec &u, const Vec &Q) {
        CHECK(Q.size() == 2 * u.size());
        return NearRows{{1}, {-0.03}, {1.0, 0.0}};
    });
    const CurvePoint here = sqp.begin(control().data());
    CHECK(!here.feasible());
    NEAR(here.nearest(), -0.03, 0.0);
    NEAR(here.missing(), 0.03, 1e-15);
    NEAR(here.merit, here.duration + here.duration * 0.03 / 0.01, 1e-12);
}

}  // namespace optiplan::test_sqp
