#include "execution/path_watch.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double SHORTEST_LOOK = 4e-3;  // s, between two places of an obstacle that passes a robot at rest

PathWatch::PathWatch(World &world, const Curve &path, double width, double begin, const std::vector<double> &error)
    : world_(world), of_body_(world.bodies().size()), at_(world.placement()) {
    for (int body = 0; body < static_cast<int>(world.bodies().size()); ++body)
        if (world.bodies()[body].joint > 0) moving_.push_back(body);
    for (; watched_ < static_cast<int>(world.pairs().size()); ++watched_) watch(watched_);
    const std::size_t n = static_cast<std::size_t>(path.joints);
    std::vector<double> q(n), reach(n), reaches;
    for (int piece = 0; piece + 1 < static_cast<int>(path.breakpoints.size()); ++piece) {
        const double low = path.breakpoints[piece], length = path.breakpoints[piece + 1] - low;
        const int parts = std::max(1, static_cast<int>(std::ceil(length / width)));
        const double half = 0.5 * length / parts;
        for (int k = 0; k < parts; ++k) {
            const double middle = low + (2 * k + 1) * half;
            path.around(piece, middle, half, q.data(), reach.data());
            for (std::size_t j = 0; j < error.size(); ++j) reach[j] += error[j];
            world.place(q.data(), at_);
            world.reaches(at_, reaches);
            Cell cell{begin + middle - half, begin + middle + half, {}, {}, {}};
            for (int body : moving_) {
                cell.bodies.push_back(at_.bodies[body]);
                cell.centres.push_back(at_.centres[body]);
                cell.travel.push_back(world.body_travel(reaches, reach.data(), body));
            }
            cells_.push_back(std::move(cell));
        }
    }
}

void PathWatch::watch(int pair) {
    const Pair &both = world_.pairs()[pair];
    const bool first = world_.bodies()[both.a].joint > 0, second = world_.bodies()[both.b].joint > 0;
    if (first == second) return;
    const auto mover = std::lower_bound(moving_.begin(), moving_.end(), first ? both.a : both.b);
    of_body_[first ? both.b : both.a].push_back({pair, static_cast<int>(mover - moving_.begin())});
}

void PathWatch::take_up() {
    of_body_.resize(world_.bodies().size());
    for (std::size_t k = at_.bodies.size(); k < of_body_.size(); ++k) {
        const Body &one = world_.bodies()[k];
        at_.bodies.push_back(one.X_JB), at_.centres.push_back(one.X_JB * one.centre), at_.placed.push_back(1);
    }
    for (; watched_ < static_cast<int>(world_.pairs().size()); ++watched_) watch(watched_);
}

// When a law comes to s, from a time on at which it is not there yet; infinite where it stands still before.
static double arrival(const TimeLaw &law, double s, double from) {
    const double settled = std::max(law.settled(), from), there = law.at(settled).s;
    if (there < s) return law.target() > 0.0 ? settled + (s - there) / law.target() : HUGE_VAL;
    double low = from, high = settled;
    for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (low + high);
        (law.at(middle).s < s ? low : high) = middle;
    }
    return high;
}

void PathWatch::put(const Seen &seen, double t) {
    Pose X = seen.X_WB;
    X.p = X.p + (t - seen.time) * seen.velocity;
    at_.bodies[seen.body] = X;
    at_.centres[seen.body] = X * world_.bodies()[seen.body].centre;
}

// When the robot stands still on a path that ends at s = `end`; infinite where the law leads beyond that.
static double rests(const TimeLaw &law, double end, double now) {
    const double settled = std::max(law.settled(), now);
    return law.target() == 0.0 && law.at(settled).s < end ? settled : arrival(law, end, now);
}

// The pair in which an obstacle strikes a robot that stands still from a time on; -1 for none. Between two places that
// are looked at, the obstacle comes no nearer than it was far, and never more than SHORTEST_LOOK allows.
int PathWatch::struck(double here, double from, const Seen &seen, double margin, double linger) {
    const double speed = norm(seen.velocity), strayed = std::max(from - seen.time, 0.0) * seen.spread + margin;
    if (speed == 0.0) return -1;
    auto cell =
        std::lower_bound(cells_.begin(), cells_.end(), here, [](const Cell &one, double s) { return one.end < s; });
    if (cell == cells_.end()) --cell;
    for (std::size_t k = 0; k < moving_.size(); ++k) {
        at_.bodies[moving_[k]] = cell->bodies[k];
        at_.centres[moving_[k]] = cell->centres[k];
    }
    for (double t = from; t < from + linger;) {
        put(seen, t);
        double free = speed * (from + linger - t);  // m, that the obstacle may go on before it is looked at again
        for (const Watched &one : of_body_[seen.body]) {
            const double gap = cell->travel[one.mover] + strayed;
            if (world_.balls_apart(at_, one.pair, gap + free)) continue;
            const double apart = std::max(world_.lower_bound(at_, one.pair), 0.0) - gap;
            if (apart > speed * 10.0 * SHORTEST_LOOK) {
                free = std::min(free, apart);
                continue;
            }
            const double exact = world_.gap(at_, one.pair, gap + free) - gap;
            if (exact < speed * SHORTEST_LOOK) return one.pair;
            free = std::min(free, exact);
        }
        t += std::max(free / speed, SHORTEST_LOOK);
    }
    return -1;
}

Blocked PathWatch::search(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin,
                          double most, bool first) {
    take_up();
    const double here = law.at(now).s, rest = std::max(law.settled(), now);
    double enters = now;
    bool begins = true;
    Blocked found{0.0, -1, most};
    for (const Cell &cell : cells_) {
        if (cell.end <= here) continue;
        if (begins && cell.begin > here) enters = arrival(law, cell.begin, now);
        begins = false;
        if (std::isinf(enters)) break;  // it stands still before that
        const double leaves = arrival(law, cell.end, enters),
                     last = std::isinf(leaves) ? std::max(rest, enters) : leaves;
        for (std::size_t k = 0; k < moving_.size(); ++k) {
            at_.bodies[moving_[k]] = cell.bodies[k];
            at_.centres[moving_[k]] = cell.centres[k];
        }
        for (const Seen &seen : obstacles) {
            if (of_body_[seen.body].empty()) continue;  // the robot holds it: it is where the path has it
            const double middle = 0.5 * (enters + last), speed = norm(seen.velocity);
            const double strays = 0.5 * (last - enters) * speed + std::max(last - seen.time, 0.0) * seen.spread;
            put(seen, middle);
            for (const Watched &one : of_body_[seen.body]) {
                const double needed = cell.travel[one.mover] + strays + margin, gap = needed + found.slack;
                if (world_.balls_apart(at_, one.pair, gap) || world_.lower_bound(at_, one.pair) > gap) continue;
                const double distance = world_.gap(at_, one.pair, gap);
                if (distance > gap) continue;
                found = {std::max(cell.begin, here), one.pair, distance - needed};
                if (first) return found;
            }
        }
        enters = leaves;
    }
    return found;
}

Blocked PathWatch::blocked(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin,
                           double linger) {
    const Blocked found = search(law, now, obstacles, margin, 0.0, true);
    if (found.pair >= 0 || linger == 0.0 || cells_.empty()) return found;
    const double end = cells_.back().end, stops = rests(law, end, now);
    if (std::isinf(stops)) return found;
    const double there = std::min(law.at(stops).s, end);
    for (const Seen &seen : obstacles)
        if (const int pair = struck(there, stops, seen, margin, linger); pair >= 0) return {there, pair, 0.0};
    return found;
}

}  // namespace optiplan
