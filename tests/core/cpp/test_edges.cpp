#include "search/edges.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_edges {

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

TEST(what_is_looked_at_here_and_there_is_free_at_these_places) {
    const World world = arm_and_box();
    EdgeRules rules = RULES;
    rules.spacing = 0.05;
    EdgeChecker proof(world, arms(), {}, RULES), looks(world, arms(), {}, rules);
    int proved = 0, seen = 0;
    for (int k = 0; k < 300; ++k) {
        const double a[2] = {uniform(-1, 2), uniform(-2, 2)}, b[2] = {uniform(-1, 2), uniform(-2, 2)};
        if (collides(world, a)) continue;
        const bool free = looks.free(a, b);
        CHECK(free || !proof.free(a, b));
        proved += proof.free(a, b), seen += free;
        const double way = 2.1 * std::fabs(b[0] - a[0]) + 1.1 * std::fabs(b[1] - a[1]);
        const int count = 4 * std::max(1, static_cast<int>(std::ceil(way / 0.2)));
        bool touches = false;
        for (int i = 1; i <= count; ++i) {
            const double s = i / (1.0 * count), q[2] = {a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])};
            touches |= collides(world, q);
        }
        CHECK(free == !touches);
    }
    CHECK(proved > 20 && seen >= proved && seen < 280);
}

TEST(a_look_sees_what_is_too_heavy) {
    const World world = arm_and_box();
    EdgeRules rules = RULES;
    rules.spacing = 0.05;
    EdgeChecker weak(world, arms(), {5.0, 5.0}, rules), strong(world, arms(), {500.0, 500.0}, rules);
    const double up[2] = {M_PI / 2, 0.0}, hanging[2] = {-M_PI / 2, 0.0}, near[2] = {-M_PI / 2, 0.01};
    CHECK(!weak.free(hanging, up) && weak.free(hanging, near));
    CHECK(strong.free(hanging, near));
}

}  // namespace optiplan::test_edges
