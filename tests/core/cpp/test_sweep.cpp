#include "world/sweep.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_sweep {

// The first joint at a constant rate for 1 s, the second still.
static Curve turn(double from, double by) { return {{0.0, 1.0}, {from, 0.0, by, 0.0}, 1, 2}; }

static const SweepRules RULES{0.2, 0.0, 1e-5, 16};

TEST(a_free_motion_is_proved_and_one_through_the_box_is_not) {
    const World world = arm_and_box();
    std::vector<Touched> found;
    std::vector<double> touching;
    Sweep away(world, turn(0.0, -1.5), RULES);
    away.look(0, away.intervals(), touching);
    away.prove(0, away.intervals(), found);
    CHECK(touching.empty() && found.empty());
    Sweep through(world, turn(0.0, 1.5), RULES);
    through.look(0, through.intervals(), touching);
    CHECK(!touching.empty());
    for (double t : touching) {
        const double q[2] = {1.5 * t, 0.0};
        CHECK(collides(world, q));
    }
    Sweep again(world, turn(0.0, 1.5), RULES);
    again.prove(0, again.intervals(), found);
    CHECK(!found.empty());
}

TEST(the_reach_of_a_piece_bounds_where_it_goes) {
    const Curve curve{{0.0, 2.0}, {0.1, 0.2, -0.4, 0.5, 0.7, -0.3, -0.2, 0.1}, 3, 2};
    double q[2], reach[2], here[2], none[2];
    for (int k = 0; k < 50; ++k) {
        const double middle = uniform(0.2, 1.8), half = uniform(0.0, 0.2);
        curve.around(0, middle, half, q, reach);
        for (double s = -1.0; s <= 1.0; s += 0.25) {
            curve.around(0, middle + s * half, 0.0, here, none);
            for (int j = 0; j < 2; ++j) CHECK(std::fabs(here[j] - q[j]) <= reach[j] + 1e-12);
        }
    }
}

}  // namespace optiplan::test_sweep
