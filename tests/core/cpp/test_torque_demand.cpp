#include "program/torque_demand.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_torque_demand {

TEST(the_demand_is_the_share_of_what_gravity_leaves) {
    InverseDynamics dynamics(arm());
    const double times[2] = {0.0, 0.6};
    for (double bend : {1.0, -1.0})  // torques of both signs, and each joint as the one that decides
        for (const std::vector<double> &allowed : {std::vector<double>{80.0, 1e4}, std::vector<double>{1e4, 60.0}}) {
            const Curve curve{{0.0, 1.0}, {0.2, -0.3, 0.5, 0.4, bend, bend}, 2, 2};
            const std::vector<double> found = torque_demand(dynamics, curve, allowed, times, 2);
            for (int i = 0; i < 2; ++i) {
                const double t = times[i], q[2] = {0.2 + 0.5 * t + bend * t * t, -0.3 + 0.4 * t + bend * t * t};
                const double v[2] = {0.5 + 2.0 * bend * t, 0.4 + 2.0 * bend * t}, a[2] = {2.0 * bend, 2.0 * bend};
                double tau[2], gravity[2], most = 0.0;
                dynamics.torques(q, v, a, tau);
                dynamics.at_rest(gravity);
                for (int j = 0; j < 2; ++j) {
                    const double moving = tau[j] - gravity[j];
                    most = std::fmax(most, std::fabs(moving) / (allowed[j] - std::copysign(1.0, moving) * gravity[j]));
                }
                NEAR(found[i], most, 1e-12);
            }
        }
}

TEST(rest_demands_nothing_and_gravity_beyond_the_limit_everything) {
    InverseDynamics dynamics(arm());
    const Curve still{{0.0, 1.0}, {0.0, 0.0}, 0, 2};
    const double times[1] = {0.5};
    CHECK(torque_demand(dynamics, still, {80.0, 60.0}, times, 1)[0] == 0.0);
    CHECK(std::isinf(torque_demand(dynamics, still, {8.0, 6.0}, times, 1)[0]));
}

}  // namespace optiplan::test_torque_demand
