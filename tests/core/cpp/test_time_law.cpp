#include "execution/time_law.hpp"

#include <algorithm>

#include "arm.hpp"
#include "check.hpp"

namespace optiplan::test_time_law {

namespace {

const double ACCELERATION = 6.0, JERK = 40.0, TORQUE = 90.0;
const LawRules RULES{2e-3, 8e-3, 50.0, 5e3, 0.0};

// The same bound on |tau''| for every law that is no slower than it may be.
void set_curvature(PathTables &made, double bound) {
    std::vector<double> factors(made.coarse().count * 8, 0.0);
    for (std::size_t i = 0; i < factors.size(); ++i)
        if (i % 8 < 4) factors[i] = bound;  // of ds^2 and of |dds|
    made.set_curvature(factors);
}

// A quintic from rest to rest, 1 rad and -0.5 rad in 1 s: it takes 5.78 rad/s^2 and, at its ends, 60 rad/s^3 of 62.
PathTables tables(double torque = TORQUE) {
    Curve path{{0.0, 1.0}, {}, 5, 2};
    for (double c : {0.0, 0.0, 0.0, 10.0, -15.0, 6.0}) path.coefficients.insert(path.coefficients.end(), {c, -0.5 * c});
    PathTables made(path, {{ACCELERATION, ACCELERATION}, {62.0, JERK}, {torque, torque}}, {{1.0, arm()}}, 2e-3);
    set_curvature(made, 4e3);
    return made;
}

// The largest share of a limit that a law takes, at many times; torques apart.
double worst(const PathTables &made, const TimeLaw &law, double &torque) {
    double most = torque = 0.0;
    for (double t = law.pieces.front().begin; t < law.settled(); t += 3e-4) {
        const LawPiece &piece = law.piece_at(t);
        const LawState at = piece.at.after(t - piece.begin, piece.ddds);
        if (at.s >= made.length()) break;
        double p[8], v[2], a[2], tau[2];
        made.derivatives(at.s, p);
        for (int j = 0; j < 2; ++j) {
            v[j] = p[2 + j] * at.ds;
            a[j] = p[4 + j] * at.ds * at.ds + p[2 + j] * at.dds;
            const double jerk =
                p[6 + j] * at.ds * at.ds * at.ds + 3.0 * p[4 + j] * at.ds * at.dds + p[2 + j] * piece.ddds;
            most = std::max({most, std::fabs(a[j]) / ACCELERATION, std::fabs(jerk) / made.limits().jerk[j]});
        }
        made.torques(at.s, false, p, v, a, tau);
        torque = std::max({torque, std::fabs(tau[0]) / TORQUE, std::fabs(tau[1]) / TORQUE});
    }
    return most;
}

}  // namespace

TEST(a_state_follows_its_cubic) {
    const LawState next = LawState{1.0, 0.5, -2.0}.after(0.1, 30.0);
    NEAR(next.s, 1.0 + 0.05 - 0.01 + 0.005, 1e-15);
    NEAR(next.ds, 0.5 - 0.2 + 0.15, 1e-15);
    NEAR(next.dds, 1.0, 1e-15);
}

TEST(every_law_reaches_its_speed_within_the_limits) {
    const PathTables made = tables();
    const LawSearch search(made, RULES);
    for (double s = 0.0; s < 0.95; s += 0.05)
        for (double target : {0.0, 0.3, 0.9}) {
            TimeLaw law;
            CHECK(search.change({s, 1.0, 0.0}, 2.0, target, law));
            const LawState end = law.at(law.settled());
            CHECK(end.s >= made.length() || std::fabs(end.ds - target) < 1e-12);
            CHECK(law.pieces.front().begin == 2.0 && end.dds == 0.0);
            double torque = 0.0;
            CHECK(worst(made, law, torque) <= 1.0 + 1e-9);
            CHECK(search.holds(law, 2.0) && torque <= 1.0);
            for (std::size_t k = 0; k + 1 < law.pieces.size(); ++k) {  // one piece begins where the last one ends
                const LawPiece &piece = law.pieces[k], &next = law.pieces[k + 1];
                const LawState there = piece.at.after(next.begin - piece.begin, piece.ddds);
                NEAR(there.s, next.at.s, 1e-9);
                NEAR(there.ds, next.at.ds, 1e-9);
                if (next.at.s < made.length()) NEAR(there.dds, next.at.dds, 1e-6);
            }
        }
}

TEST(one_law_follows_another) {
    const TimeLaw first{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {1.0, {1.0, 1.0, 0.0}, -1.0}}};
    const TimeLaw next{{{1.0, {1.0, 1.0, 0.0}, 0.0}, {2.0, {2.0, 0.0, 0.0}, 0.0}}};
    const TimeLaw both = first.then(next);
    CHECK(both.pieces.size() == 3 && both.settled() == 2.0 && both.target() == 0.0);
    NEAR(both.at(0.5).s, 0.5, 0.0);
    NEAR(both.at(1.5).s, 1.5, 0.0);
}

TEST(a_law_begins_while_the_last_one_still_changes) {
    const PathTables made = tables();
    const LawSearch search(made, RULES);
    TimeLaw down, up;
    CHECK(search.change({0.2, 1.0, 0.0}, 0.0, 0.0, down));
    for (double t = 0.0; t < down.settled(); t += 0.02) {
        const LawState from = down.at(t);
        CHECK(search.change(from, t, 1.0, up));
        double torque = 0.0;
        CHECK(worst(made, up, torque) <= 1.0 + 1e-9);
        NEAR(up.target(), 1.0, up.at(up.settled()).s >= made.length() ? 1.0 : 1e-12);
    }
}

TEST(a_stop_is_about_as_short_as_the_limits_let_it) {
    const PathTables made = tables();
    TimeLaw law;
    CHECK(LawSearch(made, RULES).change({0.5, 1.0, 0.0}, 0.0, 0.0, law));
    // In the middle the first joint runs at 1.875 rad/s: by jerk and acceleration alone 1.875 / 6 + 6 / 62 = 0.41 s.
    CHECK(law.settled() < 1.25 * 0.41);
}

TEST(torques_beyond_the_limit_are_not_proved) {
    const PathTables made = tables(), weak = tables(10.0);
    TimeLaw law;
    CHECK(LawSearch(made, RULES).change({0.5, 1.0, 0.0}, 0.0, 0.0, law));
    CHECK(!LawSearch(weak, RULES).holds(law, 0.0));
}

TEST(a_slow_speed_is_reached_from_both_sides) {
    const PathTables made = tables();
    const LawSearch search(made, RULES);
    TimeLaw down, law;
    CHECK(search.change({0.2, 1.0, 0.0}, 0.0, 0.0, down));
    for (double t = 0.0; t < down.settled(); t += 5e-3)
        for (double target : {1e-6, 1e-3, 1e-2}) {
            if (!search.change(down.at(t), t, target, law)) continue;
            CHECK(law.target() == target || law.at(law.settled()).s >= made.length());
            CHECK(law.settled() < t + 5.0 && law.pieces.size() < 2000);
        }
}

TEST(a_law_does_not_swing_about_its_speed) {
    const PathTables made = tables();
    TimeLaw law;
    for (double s = 0.01; s < 0.95; s += 0.01)
        for (double more : {0.3, 1.2, 1.43, 2.0}) {
            CHECK(LawSearch(made, RULES).change({s, 0.01, 0.0}, 0.0, 0.01 - more * 1e-3, law));
            CHECK(law.target() == 0.01 - more * 1e-3 && law.settled() < 0.5);  // it may wait for a cell, 0.2 s
            for (double t = 0.0; t < law.settled(); t += 1e-4) CHECK(law.at(t).dds <= 1e-9);
        }
}

// p'' is a ridge at 0.1 s: its slope, +-1000 rad/s^3, turns at a breakpoint. A step of 2 ms about it has 99 rad/s^2 at
// both ends and 100 between.
TEST(torques_that_turn_at_a_breakpoint_are_not_missed) {
    Curve path{{0.0, 0.1, 0.2}, {}, 3, 2};
    for (double c : {0.0, 0.0, 0.0, 1e3 / 6.0, 1.0 / 6.0, 5.0, 50.0, -1e3 / 6.0})
        path.coefficients.insert(path.coefficients.end(), {c, 0.0});
    const LawPiece piece{0.0, {0.099, 1.0, -1e-3}, 0.0};
    const TimeLaw law{{piece, {2e-3, piece.at.after(2e-3, 0.0), 0.0}}};
    const auto made = [&path](double torque) {
        PathTables found(path, {{1e3, 1e3}, {1e9, 1e9}, {torque, torque}}, {{0.2, arm()}}, 2e-3);
        set_curvature(found, 0.0);
        return found;
    };
    const PathTables loose = made(1e9);
    const auto most = [&loose](double s) {
        double p[8], tau[2];
        loose.derivatives(s, p);
        loose.torques(s, false, p, p + 2, p + 4, tau);
        return std::max(std::fabs(tau[0]), std::fabs(tau[1]));
    };
    const double ends = std::max(most(0.099), most(0.101)), ridge = most(0.1);
    CHECK(ridge > ends * 1.001);
    CHECK(LawSearch(made(1.001 * ridge), RULES).holds(law, 0.0));
    CHECK(!LawSearch(made(0.5 * (ends + ridge)), RULES).holds(law, 0.0));
}

// The load changes at 0.0995 s, in the middle of a step, and with it the torque: the larger arm up to there.
TEST(torques_up_to_another_load_are_not_missed) {
    Curve path{{0.0, 0.2}, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e3 / 6.0, 0.0}, 3, 2};
    const LawPiece piece{0.0, {0.098, 1.0, -1e-3}, 0.0};
    const TimeLaw law{{piece, {2e-3, piece.at.after(2e-3, 0.0), 0.0}}};
    Tree light = arm();
    for (auto &joint : light.joints) joint.mass *= 0.5, joint.inertia = {};
    const auto made = [&](double torque) {
        PathTables found(path, {{1e3, 1e3}, {1e9, 1e9}, {torque, torque}}, {{0.0995, arm()}, {0.2, light}}, 2e-3);
        set_curvature(found, 0.0);
        return found;
    };
    const PathTables loose = made(1e9);
    const auto most = [&loose](double s) {
        double p[8], tau[2];
        loose.derivatives(s, p, true);
        loose.torques(s, true, p, p + 2, p + 4, tau);
        return std::max(std::fabs(tau[0]), std::fabs(tau[1]));
    };
    CHECK(most(0.0995) > 1.001 * most(0.098));
    CHECK(LawSearch(made(1.01 * most(0.0995)), RULES).holds(law, 0.0));
    CHECK(!LawSearch(made(0.5 * (most(0.098) + most(0.0995))), RULES).holds(law, 0.0));
}

TEST(small_speeds_are_met_exactly_and_at_once) {
    const PathTables made = tables();
    const LawSearch search(made, RULES);
    for (double s : {0.1, 0.3, 0.5, 0.7, 0.9})
        for (double target : {1e-4, 0.0024, 0.02}) {
            TimeLaw law;
            CHECK(search.change({s, 0.0, 0.0}, 0.0, target, law));
            CHECK(law.target() == target && law.settled() < 0.1 && law.pieces.size() < 60);
            CHECK(search.change({s, target, 0.0}, 0.0, 0.0, law));
            CHECK(law.target() == 0.0 && law.settled() < 0.1 && law.pieces.size() < 60);
        }
}

TEST(a_change_goes_on_as_before_until_there_is_room) {
    const PathTables made = tables();
    const LawSearch search(made, RULES);
    TimeLaw down, law;
    CHECK(search.change({0.2, 1.0, 0.0}, 1.0, 0.0, down));
    for (double t = 1.0; t < down.settled(); t += 0.01) {
        CHECK(search.change_along(down, t, 1.0, law));
        NEAR(law.at(t).s, down.at(t).s, 1e-12);
        CHECK(law.pieces.front().begin <= t && (law.target() == 1.0 || law.at(law.settled()).s >= made.length()));
        double torque = 0.0;
        CHECK(worst(made, law, torque) <= 1.0 + 1e-9 && torque <= 1.0);
    }
    CHECK(search.change_along({{{0.0, {0.3, 1.0, 0.0}, 0.0}}}, 0.1, 0.5, law));
    NEAR(law.pieces.front().at.s, 0.4, 1e-12);
}

// In the middle the path is in motion: the law itself rests there.
TEST(a_way_from_rest_to_rest_ends_where_the_path_does_not_rest) {
    const PathTables made = tables();
    const LawSearch search(made, RULES, 0.5);
    TimeLaw law;
    CHECK(search.rest_to_rest(0.1, 2.0, law));
    CHECK(law.pieces.size() == 4 && law.target() == 0.0 && law.at(law.settled()).s == 0.5);
    const LawState end = law.pieces[2].at.after(law.settled() - law.pieces[2].begin, law.pieces[2].ddds);
    NEAR(end.s, 0.5, 1e-9);
    NEAR(end.ds, 0.0, 1e-9);
    NEAR(end.dds, 0.0, 1e-7);
    double torque = 0.0;
    CHECK(worst(made, law, torque) <= 1.0 + 1e-9 && torque <= 1.0);
    CHECK(!search.rest_to_rest(0.5, 2.0, law));
}

TEST(a_motion_that_was_not_planned_is_checked_at_its_own_speed) {
    const PathTables made = tables(), weak = tables(10.0);
    const TimeLaw as_it_is{{{0.0, {0.0, 1.0, 0.0}, 0.0}, {1.0, {1.0, 1.0, 0.0}, 0.0}}};
    CHECK(LawSearch(made, RULES).holds(as_it_is, 0.0, false) && LawSearch(weak, RULES).holds(as_it_is, 0.0));
    CHECK(!LawSearch(weak, RULES).holds(as_it_is, 0.0, false));
}

}  // namespace optiplan::test_time_law
