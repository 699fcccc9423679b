// The quickest stop of a joint within acceleration and jerk limits, and how far it travels.
//
// The formulas and their reasons are in optiplan/control/braking.py; the bits are the same.
#pragma once

#include <limits>

namespace optiplan {

// `lasting` s in which the acceleration is first + jerk t.
struct Phase {
    double lasting = 0.0, first = 0.0, jerk = 0.0;
};

// Three phases at most: away from the present acceleration, at the limit, and back to zero.
struct JointStop {
    Phase phases[3];
    int size = 0;

    void add(const Phase &phase) { phases[size++] = phase; }

    // Seconds until the joint stands.
    double lasting() const {
        double sum = 0.0;
        for (int k = 0; k < size; ++k) sum += phases[k].lasting;
        return sum;
    }

    // How far the stop from velocity v leads, rad or m.
    double travel(double v) const;

    // Position, velocity and acceleration after t seconds of the stop from q and v.
    void after(double t, double &q, double &v, double &a) const;
};

// What a joint may do: acceleration and jerk at most.
struct Brakes {
    double limit, jerk;

    // The acceleration, in a step of dt, that leaves no more than u >= 0 to be turned back.
    double acceleration(double u, double dt) const;

    // The stop from velocity v and acceleration a.
    JointStop stop(double v, double a) const;

    // How far a joint gets in the positive direction at most while it brakes, rad or m, >= 0.
    double farthest(double v, double a) const;

    // How far a joint gets at most, either way, in the stop from velocity v and acceleration a, rad or m, >= 0.
    double farthest(double v, double a, const JointStop &stop) const;

  private:
    JointStop falling(double v, double a) const;
    double clamped(double a) const;
};

static constexpr double POSITION_ROUNDING = 1e-10;  // rad or m, of positions at their limits: what rounding may cost

// A step of `dt` s in which a new velocity moves the joint by `moves` (dt or dt / 2) times that; `lag`, s: see
// `fastest_velocity` in optiplan/control/limits/joint_box.py.
struct StepRule {
    double dt, moves, lag;
};

// Largest x in [low, high] from which a joint that has velocity v now halts within `room`; `low` without one.
double fastest(const Brakes &brakes, const StepRule &step, double room, double v, double low, double high);

}  // namespace optiplan
