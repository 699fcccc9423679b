#include "verify/plane_proof.hpp"

#include "check.hpp"

namespace optiplan::test_plane_proof {

// A ball of 0.1 m that slides along x, and one of 0.1 m that stands at (1, 0, 0).
static PlaneProof balls(std::vector<ProvedPair> pairs = {{0, 1, 0, true, {}}}) {
    auto ball = std::make_shared<ProvedShape>();
    ball->outline = Shape::sphere(0.1);
    ball->round = {0, 0, 0, 0, 0.1};
    const Vec3 half{0.1, 0.1, 0.1};
    ProvedTree tree{{0, 0}, {Pose{}, Pose{}}, {Vec3{1, 0, 0}, Vec3{1, 0, 0}}, {0, 0}, 1, {1.0}, {0.0}};
    std::vector<ProvedBody> bodies{{ball, 1, {}, {}, half, 0.1}, {ball, 0, {{}, {1, 0, 0}}, {}, half, 0.1}};
    return {tree, bodies, std::move(pairs)};
}

// From 0 to `end`, m, in a second at constant speed.
static ProvedMotion slide(double end) { return {{0.0, 1.0}, {0.0, end}, {0.0}, 1}; }

static const ProvedIntervals WHOLE{{0}, {0.5}, {0.5}, {0}, {{}}};
static const PlaneRules RULES{0.0, 0.8, 1.0, {1.0, 1.0}, 1e-6, 10000, 10000};
static const double FAR[2] = {HUGE_VAL, HUGE_VAL};

TEST(the_gap_in_the_middle_is_that_of_the_balls) {
    const PlaneVerdict seen = balls().scan(slide(0.4), WHOLE, 0.0);
    CHECK(!seen.given_up);
    NEAR(seen.nearest[0].gap, 0.6, 1e-9);
    CHECK(seen.nearest[0].pair == 0);
}

TEST(a_proved_clearance_holds_at_all_times) {
    for (double end : {0.2, 0.5, 0.7}) {
        const PlaneVerdict found = balls().prove(slide(end), WHOLE, RULES, FAR);
        CHECK(!found.given_up);
        CHECK(found.left_pair.empty());
        CHECK(found.least[0] > 0.0);
        CHECK(found.least[0] <= 0.8 - end + 1e-9);
    }
}

TEST(what_touches_is_not_proved) {
    for (double end : {0.801, 1.0, 2.5}) {
        const PlaneVerdict found = balls().prove(slide(end), WHOLE, RULES, FAR);
        CHECK(found.given_up || !found.left_pair.empty());
    }
}

TEST(a_pair_is_left_once_on_an_interval) {
    PlaneProof of_parts = balls({{0, 1, 0, false, {1, 2}}, {0, 1, 0, false, {}}, {0, 1, 0, false, {}}});
    const ProvedIntervals two{{0, 0}, {0.25, 0.75}, {0.25, 0.25}, {0}, {{}, {}}};
    const PlaneVerdict found = of_parts.prove(slide(2.5), two, RULES, FAR);
    CHECK((found.left_interval == std::vector<int>{0, 1}));
    CHECK((found.left_pair == std::vector<int>{0, 0}));
}

TEST(intervals_and_normals_are_counted_apart) {
    PlaneRules few = RULES;
    few.most_intervals = 1;
    CHECK(balls().prove(slide(0.7), WHOLE, few, FAR).given_up);
    few = RULES, few.most_queries = 0;
    CHECK(balls().prove(slide(0.7), WHOLE, few, FAR).given_up);
}

}  // namespace optiplan::test_plane_proof
