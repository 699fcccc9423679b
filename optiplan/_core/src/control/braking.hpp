// The quickest stop of a joint within acceleration and jerk limits, step by step, and how far it travels.
//
// The formulas and their reasons are in optiplan/control/braking.py; the bits are the same.
#pragma once

#include <limits>

namespace optiplan {

// Steps of a stop whose accelerations are first + (i - 1) change, i = 1 … count.
struct Phase {
    double count = 0.0, first = 0.0, change = 0.0;
};

// Three phases at most: away from the present acceleration, at the limit, and back to zero.
struct JointStop {
    Phase phases[3];
    int size = 0;

    void add(const Phase &phase) { phases[size++] = phase; }

    // Steps until the joint stands.
    double steps() const {
        double sum = 0.0;
        for (int k = 0; k < size; ++k) sum += phases[k].count;
        return sum;
    }

    // Sum of dt v_i over the steps of the stop from velocity v, rad or m.
    double travel(double v, double dt) const;
};

// What a joint may do from step to step: acceleration at most, and its change.
struct Brakes {
    double limit, change, dt;

    // Velocity that is gone when an acceleration of size alpha runs back to zero.
    double velocity_to_zero(double alpha) const;

    // The size of acceleration that stops a velocity u >= 0 while it runs back to zero.
    double acceleration(double u) const;

    // The stop from velocity v and acceleration a.
    JointStop stop(double v, double a) const;

    // How far a joint gets in the positive direction at most while it brakes, rad or m, >= 0.
    double farthest(double v, double a) const;

    // How far a joint gets at most, either way, in the stop from velocity v and acceleration a, rad or m, >= 0.
    double farthest(double v, double a, const JointStop &stop) const;

    // Largest x in [low, high] with dt x + (how far a joint gets that brakes from x) <= room; `low` without one.
    double fastest(double room, double v, double low, double high) const;

  private:
    JointStop falling(double v, double a) const;
    double falling_steps(double v, double a) const;
};

static constexpr double POSITION_ROUNDING = 1e-10;  // rad or m, of positions at their limits: what rounding may cost

}  // namespace optiplan
