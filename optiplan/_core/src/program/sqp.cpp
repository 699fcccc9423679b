#include "program/sqp.hpp"

#include <algorithm>
#include <optional>

namespace optiplan {

namespace {

// Violations that are negligible: of clearance, m, over all samples; of torque, shares of the limit.
constexpr double NEGLIGIBLE = 1e-4, NEGLIGIBLE_TORQUE = 0.01;

// Shares of a motion's duration: a promise and a gain that end the descent.
constexpr double LEAST_PROMISE = 2e-4, LEAST_GAIN = 0.002;
constexpr int SETTLED = 2;

// Shares of the promise: a gain that is accepted, and one that widens the trust region twofold.
constexpr double ACCEPTED = 0.1, GOOD = 0.7;

// In the log: a step, one with a second one from its end, one that was undone.
constexpr double AT_ONCE = 1.0, REPAIRED = 0.5, REFUSED = 0.0;

}  // namespace

void Sqp::set_samples(Samples samples) {
    samples_ = std::move(samples);
    over_.clear();
    for (std::size_t i = 0; i < samples_.count(); ++i)
        over_.push_back(free_part(samples_.stencil(i, 0, spline_->points), spline_->fixed, spline_->free()));
    watched_.assign(samples_.count() * torques_.limited(), 0);
}

Descent Sqp::optimise(const double *control, int iterations, const std::function<bool()> &stop, double best,
                      double longest, const std::function<bool(const CurvePoint &)> &go_on) {
    span_ = 0.0;
    const std::size_t size = spline_->points * spline_->joints;
    CurvePoint point = evaluate(Vec(control, control + size), 0.0, span_);
    int taken = 0;
    double radius = settings_.first_radius;
    bool asked = !go_on || feasible(point);
    int settled = 0;
    Vec missing;
    std::vector<Iteration> log;
    std::optional<Ending> ended;
    while (taken < iterations && !stop() && radius >= settings_.least_radius && !stalled(missing)) {
        if (taken >= settings_.slow && (point.merit > settings_.worse * best || point.duration > longest)) {
            ended = Ending::too_slow;
            break;
        }
        missing.push_back(point.contacts.violation());
        Iteration now{point.duration, point.merit, missing.back(), radius, REFUSED};
        const Step step = solve(point, radius);
        ++taken;
        if (!step.solved) {
            log.push_back(now);
            radius *= settings_.shrink;
            continue;
        }
        if (step.promise < LEAST_PROMISE * point.duration) {
            ended = Ending::converged;
            break;
        }
        CurvePoint trial = follow(step, point);
        double how = AT_ONCE;
        if (point.merit - trial.merit <= ACCEPTED * step.promise && !stop()) {
            const Step second = solve(trial, radius);
            ++taken, how = REPAIRED;
            if (second.solved) {
                CurvePoint again = follow(second, trial);
                if (again.merit < trial.merit) trial = std::move(again);
            }
        }
        const double gain = point.merit - trial.merit;
        const bool accepted = gain > ACCEPTED * step.promise;
        if (accepted) now.accepted = how;
        log.push_back(now);
        if (!accepted) {
            radius *= settings_.shrink;
            if (watch(trial.exceeded))
                torques_.of(*spline_, samples_, point.control.data(), point.duration, watched_, point.torques,
                            point.exceeded);
            continue;
        }
        const bool good = gain > GOOD * step.promise, held_back = good && radius < settings_.first_radius;
        const bool little = gain < LEAST_GAIN * point.duration && feasible(trial) && !held_back;
        settled = little ? settled + 1 : 0;
        point = std::move(trial);
        if (good) radius *= 2.0;
        if (settled == SETTLED) {
            ended = Ending::converged;
            break;
        }
        if (!asked && feasible(point)) {
            asked = true;
            if (!go_on(point)) {
                ended = Ending::contact_between_samples;
                break;
            }
        }
    }
    if (!ended)
        ended = taken >= iterations                ? Ending::step_limit
                : radius < settings_.least_radius ? Ending::trust_region
                : stalled(missing)                ? Ending::penetration
                                                  : Ending::stopped;
    return {std::move(point), taken, std::move(log), *ended};
}

CurvePoint Sqp::evaluate(Vec control, double duration, double &span) {
    CurvePoint point;
    point.duration = std::max(duration, spline_->shortest_duration(control.data()));
    point.control = std::move(control);
    if (span <= 0.0) span = point.duration;
    point.contacts.price = settings_.contact_penalty * span, point.contacts.unit = settings_.centimetre;
    point.torques.price = settings_.torque_penalty * span, point.torques.unit = 1.0;
    find_contacts(point);
    torques_.of(*spline_, samples_, point.control.data(), point.duration, watched_, point.torques, point.exceeded);
    point.merit = spline_->time * point.duration + spline_->jerk_cost(point.control.data(), point.duration) +
                  point.contacts.cost() + point.torques.cost();
    return point;
}

Step Sqp::solve(const CurvePoint &point, double radius) {
    return solver_.solve(point.control.data(), point.duration, {&point.contacts, &point.torques}, radius, span_, settings_.gap);
}

// Where no torque binds, the derivative control points alone determine the least T.
CurvePoint Sqp::follow(const Step &step, const CurvePoint &from) {
    return evaluate(step.control, from.torques.value.empty() ? 0.0 : step.duration, span_);
}

void Sqp::find_contacts(CurvePoint &point) {
    const std::size_t n = spline_->joints;
    Vec Q(samples_.count() * n);
    for (std::size_t i = 0; i < samples_.count(); ++i)
        samples_.at(i, 0, point.control.data(), *spline_, Q.data() + i * n);
    NearRows rows = near_(samples_.u, Q);
    point.contacts.compact = true;
    point.contacts.over = over_;
    point.contacts.by_duration.assign(rows.value.size(), 0.0);
    point.contacts.sample = std::move(rows.sample);
    point.contacts.value = std::move(rows.value);
    point.contacts.entries = std::move(rows.gradient);
}

// Torques that are too large at the end of a refused step get rows from now on; whether any is new.
bool Sqp::watch(const Mask &exceeded) {
    bool fresh = false;
    for (std::size_t k = 0; k < watched_.size(); ++k) {
        fresh |= exceeded[k] && !watched_[k];
        watched_[k] |= exceeded[k];
    }
    return fresh;
}

bool Sqp::stalled(const Vec &missing) const {
    const std::size_t span = static_cast<std::size_t>(settings_.stalled);
    if (missing.size() <= span) return false;
    return missing.back() > std::max(settings_.stuck, settings_.halved * missing[missing.size() - 1 - span]);
}

bool Sqp::feasible(const CurvePoint &point) const {
    return point.contacts.violation() < NEGLIGIBLE && point.torques.violation() < NEGLIGIBLE_TORQUE;
}

}  // namespace optiplan
