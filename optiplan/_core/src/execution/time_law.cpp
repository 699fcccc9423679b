#include "execution/time_law.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace optiplan {

static constexpr double ROUNDING = 1e-12;    // of a speed, which lies in [0, 1]
static constexpr int MOST_PIECES = 4'000;    // of a law
static constexpr double LONGEST = 1.0;       // s, of the last piece before the target
static constexpr double LONGEST_END = 0.3;   // s, in which an acceleration must be able to end
static constexpr double FIRST_WAIT = 1e-3, LONGER_WAIT = 1.1;  // s, times after which a change may begin
static constexpr double SLOWEST_WAY = 20.0, LONGER_PART = 1.15;  // s, of a quarter of a way from rest to rest
static constexpr double WEAKER[] = {1.0,  0.9, 0.75, 0.55,
                                    0.35, 0.2, 0.1};  // shares of the strongest jerk that are tried
static constexpr int MOST_TRUSTED = 3, CAREFUL = 8;  // steps without that check, and with it after it failed
static constexpr double GENTLER[] = {1.0, 0.95, 0.85, 0.7, 0.55, 0.4, 0.25};  // the same on the way to a steady speed

LawState LawState::after(double t, double ddds) const {
    return {s + t * (ds + t * (0.5 * dds + t * ddds / 6.0)), ds + t * (dds + 0.5 * t * ddds), dds + t * ddds};
}

const LawPiece &TimeLaw::piece_at(double t) const {
    auto after = std::upper_bound(pieces.begin() + 1, pieces.end(), t,
                                  [](double time, const LawPiece &piece) { return time < piece.begin; });
    return *(after - 1);
}

LawState TimeLaw::at(double t) const {
    const LawPiece &piece = piece_at(t);
    return piece.at.after(t - piece.begin, piece.ddds);
}

TimeLaw TimeLaw::then(const TimeLaw &next) const {
    const double begin = next.pieces.front().begin;
    TimeLaw joined;
    for (const LawPiece &piece : pieces)
        if (piece.begin < begin) joined.pieces.push_back(piece);
    joined.pieces.insert(joined.pieces.end(), next.pieces.begin(), next.pieces.end());
    return joined;
}

namespace {

struct Range {
    double low, high;
};

Range operator+(Range a, Range b) { return {a.low + b.low, a.high + b.high}; }
Range scaled(Range a, double factor) {
    return factor >= 0.0 ? Range{a.low * factor, a.high * factor} : Range{a.high * factor, a.low * factor};
}
// Of a number that is not negative.
Range times_size(Range a, Range size) {
    return {a.low * (a.low >= 0.0 ? size.low : size.high), a.high * (a.high >= 0.0 ? size.high : size.low)};
}
Range product(Range a, Range b) {
    const double corner[4] = {a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high};
    return {std::min(std::min(corner[0], corner[1]), std::min(corner[2], corner[3])),
            std::max(std::max(corner[0], corner[1]), std::max(corner[2], corner[3]))};
}

}  // namespace

bool LawSearch::allowed(const LawState &at, double ddds, double lasting, const Cells &cells, bool torque) const {
    const LawState next = at.after(lasting, ddds);
    Range speed{std::min(at.ds, next.ds), std::max(at.ds, next.ds)};
    if (at.dds * next.dds < 0.0) {  // the speed turns in between
        const double turn = at.ds - 0.5 * at.dds * at.dds / ddds;
        speed = {std::min(speed.low, turn), std::max(speed.high, turn)};
    }
    if (speed.low < -ROUNDING || speed.high > 1.0 + ROUNDING) return false;
    if (std::fabs(next.dds) > rules_.most_rate || std::fabs(ddds) > rules_.most_jerk) return false;
    if (at.s >= end_ || (at.dds == 0.0 && ddds == 0.0)) return true;
    speed = {std::max(speed.low, 0.0), std::min(speed.high, 1.0)};
    const Range rate{std::min(at.dds, next.dds), std::max(at.dds, next.dds)};
    const Range square{speed.low * speed.low, speed.high * speed.high};
    const Range cube{square.low * speed.low, square.high * speed.high};
    const Range turning = times_size(rate, speed);
    const std::size_t n = tables_.joints();
    const int last = cells.at(next.s);
    const double *most = tables_.limits().acceleration.data(), *most_jerk = tables_.limits().jerk.data();
    for (int cell = cells.at(at.s); cell <= last; ++cell) {
        const std::size_t i = cell * n;
        const double *low1 = cells.low[0].data() + i, *high1 = cells.high[0].data() + i;
        const double *low2 = cells.low[1].data() + i, *high2 = cells.high[1].data() + i;
        const double *low3 = cells.low[2].data() + i, *high3 = cells.high[2].data() + i;
        int beyond = 0;
        for (std::size_t j = 0; j < n; ++j) {  // without a branch, so that joints are computed side by side
            const Range first{low1[j], high1[j]}, second{low2[j], high2[j]}, third{low3[j], high3[j]};
            const Range acceleration = times_size(second, square) + product(first, rate);
            const Range jerk = times_size(third, cube) + scaled(product(second, turning), 3.0) + scaled(first, ddds);
            beyond |= (acceleration.low < -most[j]) | (acceleration.high > most[j]) | (jerk.low < -most_jerk[j]) |
                      (jerk.high > most_jerk[j]);
        }
        if (beyond) return false;
    }
    if (!torque || !tables_.limits_torque()) return true;
    terms_.resize(3 * n);
    const double end = std::min(next.s, end_);
    tables_.torque_terms(end, terms_.data(), terms_.data() + n, terms_.data() + 2 * n);
    const LawSizes sizes(speed.high, std::max(-rate.low, rate.high), std::fabs(ddds));
    const int middle = tables_.coarse().at(end);
    for (std::size_t j = 0; j < n; ++j) {
        const double tau = terms_[j] * next.dds + terms_[n + j] * next.ds * next.ds + terms_[2 * n + j];
        const double between = 0.125 * rules_.step * rules_.step * tables_.curvature(middle, j, sizes);
        if (std::fabs(tau) + between > (1.0 - rules_.reserve) * tables_.limits().torque[j]) return false;
    }
    return true;
}

bool LawSearch::allowed_along(const LawState &at, double ddds, double lasting) const {
    for (double t = 0.0; t < lasting; t += rules_.look) {
        const LawState from = at.after(t, ddds);
        const double part = std::min(rules_.look, lasting - t);
        if (allowed(from, ddds, part, tables_.coarse(), true)) continue;
        for (double u = 0.0; u < part; u += rules_.step)
            if (!allowed(at.after(t + u, ddds), ddds, std::min(rules_.step, part - u), tables_.fine(), true))
                return false;
    }
    return true;
}

// The size of the strongest jerk of that sign by the ranges of the present cell; a first guess for `allowed`.
double LawSearch::strongest(const LawState &at, double direction) const {
    double most = std::min(rules_.most_jerk, (rules_.most_rate - direction * at.dds) / rules_.step);
    if (at.s >= end_) return most;
    const Cells &cells = tables_.fine();
    const std::size_t n = tables_.joints(), cell = cells.at(at.s);
    const double square = at.ds * at.ds, cube = square * at.ds, turning = 3.0 * at.ds * at.dds;
    for (std::size_t j = 0; j < n; ++j) {
        const std::size_t i = cell * n + j;
        const double low = direction > 0.0 ? cells.low[0][i] : -cells.high[0][i];
        const double high = direction > 0.0 ? cells.high[0][i] : -cells.low[0][i];
        const Range second{cells.low[1][i], cells.high[1][i]}, third{cells.low[2][i], cells.high[2][i]};
        const double limit = tables_.limits().acceleration[j], jerk = tables_.limits().jerk[j];
        const Range bent = scaled(second, square);
        const Range still = std::isfinite(jerk) ? scaled(third, cube) + scaled(second, turning) : Range{0.0, 0.0};
        const double sized = direction * at.dds;  // of the acceleration already there
        if (high > 0.0) {
            most = std::min(most, (jerk - still.high) / high);
            most = std::min(most, ((limit - bent.high) / high - sized) / rules_.step);
        }
        if (low < 0.0) {
            most = std::min(most, (jerk + still.low) / -low);
            most = std::min(most, ((limit + bent.low) / -low - sized) / rules_.step);
        }
    }
    return std::max(most, 0.0);
}

// Whether the law can end its acceleration by a steady jerk, `ddds`, at a speed in [0, 1] not beyond the target.
bool LawSearch::levels_off(const LawState &at, double direction, double target, double &ddds) const {
    ddds = 0.0;
    if (at.dds == 0.0) return true;
    const double sign = at.dds > 0.0 ? 1.0 : -1.0;
    const double room = sign == direction ? direction * (target - at.ds) : (sign > 0.0 ? 1.0 - at.ds : at.ds);
    const double half = 0.5 * at.dds * at.dds;
    if (room <= 0.0) return false;
    const double least = half / room;
    const double most = strongest(at, -sign);
    const auto open = [&](double size) {
        ddds = -sign * size;
        return size > 0.0 && std::fabs(at.dds) <= LONGEST_END * size &&
               allowed_along(at, ddds, std::fabs(at.dds) / size);
    };
    const auto leads = [&](std::size_t k) { return GENTLER[k] * most >= least && open(GENTLER[k] * most); };
    if (leads(gentle_)) return true;  // as in the step before
    for (std::size_t k = 0; k < std::size(GENTLER); ++k)
        if (k != gentle_ && leads(k)) {
            gentle_ = k;
            return true;
        }
    return least <= rules_.most_jerk && open(least);
}

// Whether a steady speed is in reach, by the jerk `off`; in which direction the target is from where that leads.
bool LawSearch::begins(const LawState &at, double target, double &direction, double &off) const {
    const double back = at.dds == 0.0 ? 0.0 : strongest(at, at.dds > 0.0 ? -1.0 : 1.0);
    const double ends = at.ds + (back > 0.0 ? 0.5 * at.dds * std::fabs(at.dds) / back : 0.0);
    direction = target < ends ? -1.0 : 1.0;
    return levels_off(at, direction, target, off) || levels_off(at, -direction, target, off);
}

bool LawSearch::change_along(const TimeLaw &old, double now, double target, TimeLaw &law) const {
    const double last = std::max(old.settled(), now);
    double direction = 0.0, off = 0.0;
    for (double wait = 0.0, t = now;;
         wait = wait > 0.0 ? LONGER_WAIT * wait : FIRST_WAIT, t = std::min(now + wait, last)) {
        if ((begins(old.at(t), target, direction, off) || t == last) && change(old.at(t), t, target, law)) {
            if (!holds(law, t)) return false;
            std::vector<LawPiece> &pieces = law.pieces;
            if (t > now) pieces.insert(pieces.begin(), &old.piece_at(now), &old.piece_at(t) + 1);
            return true;
        }
        if (t == last) return false;
    }
}

bool LawSearch::change(const LawState &from, double begin, double target, TimeLaw &law) const {
    law.pieces.clear();
    LawState at = from;
    double t = begin, off = 0.0;
    double direction = 0.0;
    if (!begins(at, target, direction, off)) return false;
    const auto push = [&](double ddds, double lasting) {
        law.pieces.push_back({t, at, ddds});
        at = at.after(lasting, ddds), t += lasting;
    };
    // From `sure` on a steady speed is in reach by the jerk `off`; from the steps since then it is only likely.
    struct {
        std::size_t pieces;
        LawState at;
        double t;
    } sure{0, at, t};
    int trusted = 0, careful = 1;
    while (static_cast<int>(law.pieces.size()) < MOST_PIECES && at.s < end_) {
        if (trusted == 0) sure = {law.pieces.size(), at, t};
        if (at.dds == 0.0) {
            if (std::fabs(at.ds - target) <= ROUNDING) {
                at.ds = target;
                break;
            }
            direction = target < at.ds ? -1.0 : 1.0;  // the way here may have led beyond the target
        }
        // The strongest jerk from whose end a steady speed is in reach.
        const double most = strongest(at, direction);
        bool stepped = false;
        for (double share : WEAKER) {
            const double ddds = off + share * (direction * most - off), rate = at.dds + rules_.step * ddds;
            if (direction * at.dds >= 0.0 && direction * rate < 0.0) continue;  // it would lead away from the target
            if (direction * (ddds - off) <= 0.0 || !allowed(at, ddds, rules_.step, tables_.fine(), true)) continue;
            double then = 0.0;
            const LawState next = at.after(rules_.step, ddds);
            const bool passes = direction * (target - at.ds) >= 0.0 && direction * (target - next.ds) < 0.0;
            if (passes) continue;
            if (careful > 0 || trusted == MOST_TRUSTED) {
                if (!levels_off(next, direction, target, then)) continue;
                push(ddds, rules_.step);
                off = then, trusted = 0, careful = std::max(careful - 1, 0);
            } else {
                push(ddds, rules_.step);
                ++trusted;
            }
            stepped = true;
            break;
        }
        if (stepped) continue;
        if (trusted > 0) {  // no steady speed may be in reach from here: back to where one was
            law.pieces.resize(sure.pieces);
            at = sure.at, t = sure.t, trusted = 0, careful = CAREFUL;
            continue;
        }
        const double room = direction * (target - at.ds);
        if (at.dds * direction > 0.0 && room > 0.0) {  // exactly to the target?
            const double ddds = -direction * 0.5 * at.dds * at.dds / room;
            const double lasting = std::fabs(at.dds / ddds);
            if (lasting <= LONGEST && allowed_along(at, ddds, lasting)) {
                push(ddds, lasting);
                at.ds = target, at.dds = 0.0, off = 0.0;
                continue;
            }
        }
        if (at.dds == 0.0 && most > 0.0) {  // little is missing: there and back within a step
            const auto halves = [&](double size) {
                const double lasting = std::sqrt(room / size), ddds = direction * size;
                return lasting <= rules_.step && allowed(at, ddds, lasting, tables_.fine(), true) &&
                       allowed(at.after(lasting, ddds), -ddds, lasting, tables_.fine(), true);
            };
            double size = most;
            while (size > 0.1 * most && !halves(size)) size *= 0.7;
            if (halves(size)) {
                const double lasting = std::sqrt(room / size);
                push(direction * size, lasting);
                push(-direction * size, lasting);
                at.ds = target, at.dds = 0.0, off = 0.0;
                continue;
            }
        }
        if (at.dds == 0.0) {  // not in this cell: on at this speed to the next one
            if (at.ds <= ROUNDING) break;
            const bool steady = !law.pieces.empty() && law.pieces.back().ddds == 0.0 && law.pieces.back().at.dds == 0.0;
            if (!steady) law.pieces.push_back({t, at, 0.0});
            const Cells &cells = tables_.fine();
            const double lasting = std::max(((cells.at(at.s) + 1) * cells.width - at.s) / at.ds, rules_.step);
            at = at.after(lasting, 0.0), t += lasting;
            continue;
        }
        const double lasting = std::fabs(at.dds / off);
        push(off, lasting);
        at.dds = 0.0, off = 0.0;
    }
    if (at.s > end_ && !law.pieces.empty()) {  // at rest there, whatever the law does
        const LawPiece &last = law.pieces.back();
        double low = 0.0, high = t - last.begin;
        while (high - low > ROUNDING) {
            const double middle = 0.5 * (low + high);
            if (middle <= low || middle >= high) break;  // of hours, at a very slow speed, no double is as close
            (last.at.after(middle, last.ddds).s < end_ ? low : high) = middle;
        }
        at = last.at.after(high, last.ddds), t = last.begin + high;
        at.s = end_;
    }
    if (at.dds != 0.0 && at.s < end_) return false;  // too long
    at.dds = 0.0;
    law.pieces.push_back({t, at, 0.0});
    return true;
}

bool LawSearch::rest_to_rest(double s, double begin, TimeLaw &law) const {
    const double way = end_ - s;
    for (double part = 0.5 * way; way > 0.0 && part < SLOWEST_WAY; part *= LONGER_PART) {
        const double jerk = 0.5 * way / (part * part * part);
        LawState at{s, 0.0, 0.0};
        double t = begin;
        bool open = true;
        law.pieces.clear();
        for (double sign : {1.0, -1.0, 1.0}) {
            const double lasting = sign > 0.0 ? part : 2.0 * part;
            open = open && allowed_along(at, sign * jerk, lasting);
            law.pieces.push_back({t, at, sign * jerk});
            at = at.after(lasting, sign * jerk), t += lasting;
        }
        law.pieces.push_back({t, {end_, 0.0, 0.0}, 0.0});
        if (open && holds(law, begin)) return true;
    }
    return false;
}

// On a part of a law |tau| is at most the larger value of its ends plus width^2 / 8 max |tau''|. A part ends where the
// path has a breakpoint or the load changes: there tau may jump, or turn sharply.
bool LawSearch::holds(const TimeLaw &law, double from, bool planned) const {
    if (!tables_.limits_torque()) return true;
    const std::size_t n = tables_.joints();
    std::vector<double> at(4 * n), v(n), a(n), ends[2] = {std::vector<double>(n), std::vector<double>(n)};
    const auto demand = [&](const LawState &state, bool before, std::vector<double> &tau) {
        tables_.derivatives(state.s, at.data(), before);
        for (std::size_t j = 0; j < n; ++j) {
            v[j] = at[n + j] * state.ds;
            a[j] = at[2 * n + j] * state.ds * state.ds + at[n + j] * state.dds;
        }
        tables_.torques(state.s, before, at.data(), v.data(), a.data(), tau.data());
    };
    bool fresh = true;
    for (std::size_t k = 0; k + 1 < law.pieces.size(); ++k) {
        const LawPiece &piece = law.pieces[k];
        const double end = law.pieces[k + 1].begin - piece.begin;
        if (end <= from - piece.begin || (planned && piece.at.dds == 0.0 && piece.ddds == 0.0)) {
            fresh = true;
            continue;
        }
        for (double t = std::max(from - piece.begin, 0.0); t < end;) {
            const LawState begin = piece.at.after(t, piece.ddds);
            if (begin.s >= end_) return true;
            if (fresh) demand(begin, false, ends[0]);  // else it is the last end
            const double edge = tables_.edge_after(begin.s);
            double until = end - t <= rules_.step * (1.0 + 1e-6) ? end : t + rules_.step;
            if (piece.at.after(until, piece.ddds).s > edge)
                for (double low = t;;) {
                    const double middle = 0.5 * (low + until);
                    if (middle <= low || middle >= until) break;
                    (piece.at.after(middle, piece.ddds).s < edge ? low : until) = middle;
                }
            for (int cuts = 0;; ++cuts) {
                LawState next = piece.at.after(until, piece.ddds);
                fresh = next.s >= edge;
                if (fresh) next.s = edge;
                demand(next, fresh, ends[1]);
                if (holds_between(begin, next, piece.ddds, until - t, ends)) break;
                const double middle = 0.5 * (t + until);
                if (cuts == 6 || middle <= t) return false;
                until = middle;
            }
            t = until;
            std::swap(ends[0], ends[1]);
        }
    }
    return true;
}

bool LawSearch::holds_between(const LawState &begin, const LawState &end, double ddds, double width,
                              const std::vector<double> (&ends)[2]) const {
    // The speed may turn in between.
    const double speed = std::min(std::max(begin.ds, end.ds) + 0.125 * width * width * std::fabs(ddds), 1.0);
    const LawSizes sizes(speed, std::max(std::fabs(begin.dds), std::fabs(end.dds)), std::fabs(ddds));
    const int first = tables_.coarse().at(begin.s), last = tables_.coarse().at(end.s);
    for (std::size_t j = 0; j < tables_.joints(); ++j) {
        double curvature = 0.0;
        for (int cell = first; cell <= last; ++cell) curvature = std::max(curvature, tables_.curvature(cell, j, sizes));
        const double most = std::max(std::fabs(ends[0][j]), std::fabs(ends[1][j]));
        if (!(most + 0.125 * width * width * curvature <= tables_.limits().torque[j])) return false;
    }
    return true;
}

}  // namespace optiplan
