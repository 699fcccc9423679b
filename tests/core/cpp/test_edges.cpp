#include "search/edges.hpp"

#include "arm.hpp"
#include "check.hpp"

using namespace optiplan;

static const EdgeRules RULES{0.1, 0.0, 1e-4, 100000, 0.1};

TEST(what_is_proved_free_touches_nowhere) {
    const World world = arm_and_box();
    EdgeChecker check(world, arms(), {}, RULES);
    int proved = 0, refused = 0;
    for (int k = 0; k < 200; ++k) {
        const double a[2] = {uniform(-1, 2), uniform(-2, 2)}, b[2] = {uniform(-1, 2), uniform(-2, 2)};
        CHECK(check.blocked(a) == collides(world, a));
        if (collides(world, a)) continue;
        bool touches = false;
        for (int i = 0; i <= 100 && !touches; ++i) {
            const double q[2] = {a[0] + 0.01 * i * (b[0] - a[0]), a[1] + 0.01 * i * (b[1] - a[1])};
            touches = collides(world, q);
        }
        const bool free = check.free(a, b);
        CHECK(!(free && touches));
        ++(free ? proved : refused);
    }
    CHECK(proved > 20 && refused > 20);
}

TEST(torque_limits_block) {
    const World world = arm_and_box();
    EdgeChecker weak(world, arms(), {5.0, 5.0}, RULES), strong(world, arms(), {500.0, 500.0}, RULES);
    const double stretched[2] = {0.0, 0.0}, hanging[2] = {-M_PI / 2, 0.0};
    CHECK(weak.blocked(stretched) && !weak.blocked(hanging));
    CHECK(!strong.blocked(stretched) && strong.free(hanging, stretched));
    CHECK(!weak.free(stretched, hanging) || weak.blocked(stretched));
    const double polyline[6] = {-M_PI / 2, 0.0, 0.0, 0.0, 1.5, 0.0};
    CHECK(strong.polyline_free(polyline, 2) && !strong.polyline_free(polyline, 3));
}
