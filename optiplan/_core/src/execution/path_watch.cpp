#include "execution/path_watch.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

PathWatch::PathWatch(const World &world, const Curve &path, double width, double begin,
                     const std::vector<double> &error)
    : world_(world), of_body_(world.bodies().size()), at_(world.placement()) {
    for (int body = 0; body < static_cast<int>(world.bodies().size()); ++body)
        if (world.bodies()[body].joint > 0) moving_.push_back(body);
    for (int pair = 0; pair < static_cast<int>(world.pairs().size()); ++pair) {
        const Pair &both = world.pairs()[pair];
        const bool first = world.bodies()[both.a].joint > 0, second = world.bodies()[both.b].joint > 0;
        if (first == second) continue;
        of_body_[first ? both.b : both.a].push_back(static_cast<int>(pairs_.size()));
        pairs_.push_back(pair);
    }
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
            }
            for (int pair : pairs_) cell.travel.push_back(world.travel(reaches, reach.data(), pair));
            cells_.push_back(std::move(cell));
        }
    }
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

Blocked PathWatch::blocked(const TimeLaw &law, double now, const std::vector<Seen> &obstacles, double margin) {
    const double here = law.at(now).s, rest = std::max(law.settled(), now);
    double enters = now;
    bool first = true;
    for (const Cell &cell : cells_) {
        if (cell.end <= here) continue;
        if (first && cell.begin > here) enters = arrival(law, cell.begin, now);
        first = false;
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
            Pose X = seen.X_WB;
            X.p = X.p + (middle - seen.time) * seen.velocity;
            at_.bodies[seen.body] = X;
            at_.centres[seen.body] = X * world_.bodies()[seen.body].centre;
            for (int place : of_body_[seen.body]) {
                const int pair = pairs_[place];
                const double gap = cell.travel[place] + strays + margin;
                if (world_.balls_apart(at_, pair, gap) || world_.lower_bound(at_, pair) > gap) continue;
                if (world_.gap(at_, pair, gap) > gap) continue;
                return {std::max(cell.begin, here), pair};
            }
        }
        enters = leaves;
    }
    return {0.0, -1};
}

}  // namespace optiplan
