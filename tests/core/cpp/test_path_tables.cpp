#include "execution/path_tables.hpp"

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_path_tables {

namespace {

// Two pieces of degree 3 over [0, 0.8], which do not meet: ranges are of each alone.
Curve path() {
    return {{0.0, 0.5, 0.8},
            {0.2, -0.3, 0.5, 0.4, 1.0, -2.0, 3.0, 1.0, 0.4, 0.1, -0.6, 0.2, 0.3, 0.5, -4.0, 2.0},
            3,
            2};
}

PathTables tables(double torque = 100.0, double width = 0.01) {
    return {path(), {{100.0, 100.0}, {100.0, 100.0}, {torque, torque}}, {{0.4, arm()}, {0.8, arm()}}, width};
}

}  // namespace

TEST(derivatives_are_those_of_the_piece) {
    const PathTables made = tables();
    double at[8];
    made.derivatives(0.3, at);
    NEAR(at[0], 0.2 + 0.3 * (0.5 + 0.3 * (1.0 + 0.3 * 3.0)), 1e-14);
    NEAR(at[2], 0.5 + 0.3 * (2.0 + 0.3 * 9.0), 1e-14);
    NEAR(at[4], 2.0 + 18.0 * 0.3, 1e-14);
    NEAR(at[7], 6.0, 1e-14);
    made.derivatives(9.0, at);  // clamped to the end
    NEAR(at[1], 0.1 + 0.3 * (0.2 + 0.3 * (0.5 + 0.3 * 2.0)), 1e-14);
}

TEST(ranges_of_cells_hold_every_value) {
    const PathTables made = tables();
    CHECK(made.fine().count == 80 && made.coarse().count == 20);
    for (const Cells *cells : {&made.fine(), &made.coarse()})
        for (int k = 0; k < 400; ++k) {
            const double s = uniform(0.0, 0.8);
            double at[8];
            made.derivatives(s, at);
            const int cell = cells->at(s);
            for (int order = 1; order <= 3; ++order)
                for (int j = 0; j < 2; ++j) {
                    CHECK(cells->low[order - 1][cell * 2 + j] <= at[order * 2 + j] + 1e-12);
                    CHECK(cells->high[order - 1][cell * 2 + j] >= at[order * 2 + j] - 1e-12);
                }
        }
    const int inner = made.fine().at(0.302);  // within one piece a range is about as wide as the cell asks
    CHECK(made.fine().high[0][inner * 2] - made.fine().low[0][inner * 2] < 0.01 * 7.6);  // p'' is 7.4
}

TEST(torque_terms_add_up_to_the_torque) {
    const PathTables made = tables(100.0, 0.0025);
    for (double s : {0.1, 0.35, 0.77}) {
        double terms[6], at[8], v[2], a[2], tau[2];
        const double speed = 0.7, rate = -1.3;
        made.torque_terms(s, terms, terms + 2, terms + 4);
        made.derivatives(s, at);
        for (int j = 0; j < 2; ++j) v[j] = at[2 + j] * speed, a[j] = at[4 + j] * speed * speed + at[2 + j] * rate;
        made.torques(s, false, at, v, a, tau);
        for (int j = 0; j < 2; ++j) NEAR(terms[j] * rate + terms[2 + j] * speed * speed + terms[4 + j], tau[j], 0.02);
    }
}

TEST(loads_meet_at_their_ends) {
    const PathTables made = tables();
    CHECK(made.load_at(0.4, true) == 0 && made.load_at(0.4, false) == 1);
    CHECK(made.load_at(0.1, false) == 0 && made.load_at(0.8, false) == 1);
}

TEST(gravity_beyond_the_limit_is_found) {
    CHECK(tables().overloaded() < 0.0);
    CHECK(tables(20.0).overloaded() >= 0.0);
    PathTables bent = tables();  // between the ends of a cell gravity may take more than there
    const auto overloaded = [&bent](double curvature) {
        bent.set_curvature(std::vector<double>(bent.coarse().count * 8, curvature));
        return bent.overloaded();
    };
    CHECK(overloaded(1e12) >= 0.0);
    CHECK(overloaded(8.0 * 100.0 / (0.01 * 0.01)) < 0.0);  // proved in shorter parts of it
}

TEST(a_mirrored_path_is_the_same_path) {
    const PathTables made = tables(100.0, 0.0025), back = made.mirrored();
    CHECK(back.length() == made.length() && back.fine().count == made.fine().count);
    for (int k = 0; k < 200; ++k) {
        const double s = uniform(0.0, 0.8);
        double at[8], there[8], terms[6], v[2], a[2], tau[2];
        made.derivatives(0.8 - s, at);
        back.derivatives(s, there);
        for (int i = 0; i < 8; ++i) NEAR(there[i], (i / 2) % 2 ? -at[i] : at[i], 1e-12);
        const int cell = back.fine().at(s);
        for (int order = 1; order <= 3; ++order)
            for (int j = 0; j < 2; ++j) {
                CHECK(back.fine().low[order - 1][cell * 2 + j] <= there[order * 2 + j] + 1e-12);
                CHECK(back.fine().high[order - 1][cell * 2 + j] >= there[order * 2 + j] - 1e-12);
            }
        for (int j = 0; j < 2; ++j) v[j] = 0.7 * there[2 + j], a[j] = 0.49 * there[4 + j] - 1.3 * there[2 + j];
        back.torque_terms(s, terms, terms + 2, terms + 4);
        back.torques(s, false, there, v, a, tau);
        if (std::fabs(s - 0.3) > 0.01)  // it jumps there
            for (int j = 0; j < 2; ++j) NEAR(-1.3 * terms[j] + 0.49 * terms[2 + j] + terms[4 + j], tau[j], 0.05);
    }
    CHECK(back.load_at(0.2, false) == 0 && back.load_at(0.6, false) == 1 && back.load_at(0.4, true) == 0);
}

TEST(sizes_bound_every_value) {
    const PathTables made = tables();
    const std::vector<double> sizes = made.sizes();
    for (int k = 0; k < 200; ++k) {
        const double s = uniform(0.0, 0.8);
        double at[8];
        made.derivatives(s, at);
        for (int i = 0; i < 8; ++i)
            CHECK(sizes[(i / 2 * made.coarse().count + made.coarse().at(s)) * 2 + i % 2] >= std::fabs(at[i]));
    }
    for (double most : std::vector<double>(sizes.end() - 2 * made.coarse().count, sizes.end())) CHECK(most == 0.0);
}

TEST(curvature_adds_up_from_its_factors) {
    PathTables made = tables();
    CHECK(made.curvature(3, 1, {1.0, 2.0, 3.0}) == 0.0);  // nothing is known of it
    std::vector<double> factors(20 * 4 * 2, 0.0);
    for (int k = 0; k < 4; ++k) factors[(3 * 4 + k) * 2 + 1] = std::pow(10.0, k);
    made.set_curvature(factors);
    NEAR(made.curvature(3, 1, {0.5, 2.0, 3.0}), 0.25 + 10.0 * 2.0 + 100.0 * 4.0 + 1000.0 * 1.5, 1e-9);
    CHECK(made.curvature(3, 0, {0.5, 2.0, 3.0}) == 0.0 && made.curvature(4, 1, {0.5, 2.0, 3.0}) == 0.0);
    CHECK(made.mirrored().curvature(16, 1, {0.5, 2.0, 3.0}) == made.curvature(3, 1, {0.5, 2.0, 3.0}));
}

}  // namespace optiplan::test_path_tables
