#include "verify/interval_proof.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_interval_proof {

namespace {

// Two pieces in which the first joint turns by `speed` rad/s, the second stands at `elbow`.
Curve turning(double speed, double seconds, double elbow = 0.0) {
    const double half = 0.5 * seconds;
    return {{0.0, half, seconds}, {0.0, elbow, speed, 0.0, speed * half, elbow, speed, 0.0}, 1, 2};
}

// The least distance of a pair at many times of a curve, and when.
std::pair<double, double> dense(const World &world, int pair, const Curve &curve) {
    double least = HUGE_VAL, when = 0.0;
    for (int i = 0; i <= 4000; ++i) {
        const double t = curve.breakpoints.back() * i / 4000.0;
        double q[2], reach[2];
        curve.around(t > curve.breakpoints[1] ? 1 : 0, t, 0.0, q, reach);
        const double distance = distance_at(world, pair, q[0], q[1]);
        if (distance < least) least = distance, when = t;
    }
    return {least, when};
}

}  // namespace

TEST(a_motion_is_proved_where_dense_distances_say_so) {
    int free = 0, blocked = 0;
    for (int round = 0; round < 60; ++round) {
        const World world = arm_and_box({uniform(-0.5, 2.2), uniform(0.4, 2.2), 0.0});
        if (std::min(distance_at(world, 0, 0.0, 0.3), distance_at(world, 1, 0.0, 0.3)) < 1e-3) continue;
        const Curve curve = turning(1.0, 1.5, 0.3);
        IntervalProof proof(world, {0, 1}, {});
        const Verdict found = proof.prove(curve, {});
        const auto first = dense(world, 0, curve), second = dense(world, 1, curve);
        const double least = std::min(first.first, second.first);
        if (found.pair < 0) {
            ++free;
            CHECK(least > 0.0);
            CHECK(found.least[0] <= first.first + 1e-9 && found.least[1] <= second.first + 1e-9);
        } else {
            ++blocked;
            CHECK(found.touches && least < 1e-4);
        }
    }
    CHECK(free > 5 && blocked > 5);
}

TEST(a_clearance_is_kept_to_the_micrometre) {
    const World world = arm_and_box({1.0, 1.4, 0.0});
    const Curve curve = turning(1.0, 0.6);
    const double least = std::min(dense(world, 0, curve).first, dense(world, 1, curve).first);
    CHECK(least > 0.01);
    IntervalProof proof(world, {0, 0}, {});
    IntervalRules rules;
    for (double less : {1e-3, 1e-4, 2e-6}) {
        rules.clearance[0] = least - less;
        const Verdict found = proof.prove(curve, rules);
        CHECK(found.pair < 0 && found.least[0] > rules.clearance[0]);
    }
    for (double more : {2e-6, 1e-4, 1e-2}) {
        rules.clearance[0] = least + more;
        CHECK(proof.prove(curve, rules).pair >= 0);
    }
}

TEST(a_motion_of_many_pieces_may_take_many_intervals) {
    const int pieces = 2000;
    Curve standing{{0.0}, std::vector<double>(4 * pieces, 0.0), 1, 2};
    for (int i = 1; i <= pieces; ++i) standing.breakpoints.push_back(0.01 * i);
    IntervalProof proof(arm_and_box({1.0, 0.153, 0.0}), {0, 0}, {});
    const Verdict found = proof.prove(standing, {});
    CHECK(found.pair < 0 && found.intervals > pieces);
}

TEST(everything_before_a_contact_is_proved) {
    const World world = arm_and_box({1.0, 1.0, 0.0});
    const Curve curve = turning(1.0, 1.5);
    IntervalProof proof(world, {0, 0}, {});
    const Verdict found = proof.prove(curve, {});
    CHECK(found.pair == 1 && found.touches);
    double first = 0.0;
    while (distance_at(world, 1, first, 0.0) > 0.0) first += 1e-4;
    CHECK(found.time <= first && found.time > first - 0.2);
}

TEST(a_body_stands_where_it_is_moved) {
    const World world = arm_and_box({1.0, 1.0, 0.0});
    IntervalProof proof(world, {0, 0}, {});
    CHECK(proof.prove(turning(1.0, 1.5), {}).pair >= 0);
    proof.move(2, {{}, {-1.5, -1.5, 0.0}});
    CHECK(proof.prove(turning(1.0, 1.5), {}).pair < 0);
    proof.move(2, {{}, {1.0, 1.0, 0.0}});
    CHECK(proof.prove(turning(1.0, 1.5), {}).pair >= 0);
}

TEST(kept_boxes_answer_within_their_range_alone) {
    const KeptBoxes boxes{0, {0, -1}, {false, false}, {0.0, 0.0, 0.5, 0.0}, {0.5, 0.0, 1.0, 0.0}, {0.01, 0.02}};
    const auto least = [&](double low, double high) { return boxes.least(&low, &high); };
    NEAR(least(0.1, 0.2), 0.01, 0.0);
    NEAR(least(0.6, 0.7), 0.02, 0.0);
    NEAR(least(0.4, 0.6), 0.01, 0.0);
    CHECK(std::isinf(least(0.9, 1.1)) && least(0.9, 1.1) < 0.0);
    const double turn = 6.283185307179586;
    const KeptBoxes endless{0, {0, -1}, {true, false}, {-0.5 * turn, 0.0}, {0.5 * turn, 0.0}, {0.03}};
    const double low = 9.0, high = 9.5;
    NEAR(endless.least(&low, &high), 0.03, 0.0);
}

}  // namespace optiplan::test_interval_proof
