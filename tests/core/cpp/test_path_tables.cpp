#include "execution/path_tables.hpp"

#include "arm.hpp"
#include "check.hpp"

using namespace optiplan;

namespace {

// Two pieces of degree 3 over [0, 0.8], which do not meet: ranges are of each alone.
Curve path() {
    return {{0.0, 0.5, 0.8},
            {0.2, -0.3, 0.5, 0.4, 1.0, -2.0, 3.0, 1.0, 0.4, 0.1, -0.6, 0.2, 0.3, 0.5, -4.0, 2.0},
            3,
            2};
}

PathTables tables(double torque = 100.0) {
    return {path(), {{100.0, 100.0}, {100.0, 100.0}, {torque, torque}}, {{0.4, arm()}, {0.8, arm()}}, 0.01};
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
    const PathTables made = tables();
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
    bent.set_curvature(std::vector<double>(bent.coarse().count * 2, 8.0 * 100.0 / (0.01 * 0.01)), {1.0}, {1.0});
    CHECK(bent.overloaded() >= 0.0);
}

TEST(curvature_is_of_the_lowest_level_that_bounds_the_law) {
    PathTables made = tables();
    std::vector<double> bounds(2 * 20 * 2, 1.0);
    std::fill(bounds.begin() + 40, bounds.end(), 9.0);
    made.set_curvature(bounds, {1.0, 5.0}, {10.0, 50.0});
    CHECK(made.curvature(3, 0.5, 9.0)[1] == 1.0);
    CHECK(made.curvature(3, 0.5, 11.0)[0] == 9.0);
    CHECK(made.curvature(3, 2.0, 1.0)[0] == 9.0);
}
