#include "control/braking.hpp"

#include "check.hpp"

namespace optiplan::test_braking {

TEST(a_stop_ends_at_rest_within_the_limits) {
    for (int k = 0; k < 200; ++k) {
        const Brakes brakes{uniform(0.5, 5.0), uniform(5.0, 200.0)};
        const double v = uniform(-2, 2), a = uniform(-brakes.limit, brakes.limit);
        const JointStop stop = brakes.stop(v, a);
        const double T = stop.lasting();
        double q = 0.0, speed = v, acceleration = a, farthest = 0.0;
        stop.after(T, q, speed, acceleration);
        NEAR(speed, 0.0, 1e-9);
        NEAR(acceleration, 0.0, 1e-9);
        NEAR(q, stop.travel(v), 1e-9);
        for (int i = 0; i < stop.size; ++i) CHECK(std::fabs(stop.phases[i].jerk) <= brakes.jerk * (1 + 1e-12));
        for (int i = 0; i <= 40; ++i) {
            double x = 0.0, w = v, b = a;
            stop.after(T * i / 40.0, x, w, b);
            CHECK(std::fabs(b) <= brakes.limit * (1 + 1e-9));
            farthest = std::fmax(farthest, std::fabs(x));
        }
        CHECK(brakes.farthest(v, a, stop) >= farthest - 1e-9);
    }
}

TEST(more_room_allows_no_less_velocity) {
    const Brakes brakes{3.0, 50.0};
    const StepRule step{0.01, 0.005, 0.0};
    double before = -HUGE_VAL;
    for (double room = 0.0; room < 1.0; room += 0.05) {
        const double found = fastest(brakes, step, room, 0.5, 0.2, 0.8);
        CHECK(found >= 0.2 && found <= 0.8 && found >= before - 1e-12);
        before = found;
    }
    CHECK(before == 0.8);
    CHECK(fastest(brakes, step, 0.0, 0.5, 0.2, 0.8) == 0.2);
}

}  // namespace optiplan::test_braking
