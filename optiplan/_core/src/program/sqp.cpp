#include "program/sqp.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

namespace {

// Violations that are negligible: of clearance, m, over all samples; of torque, shares of the limit.
constexpr double NEGLIGIBLE = 1e-4, NEGLIGIBLE_TORQUE = 0.01;

}  // namespace

void Sqp::set_samples(Samples samples) {
    samples_ = std::move(samples);
    over_.clear();
    for (std::size_t i = 0; i < samples_.count(); ++i)
        over_.push_back(free_part(samples_.stencil(i, 0, spline_->points), spline_->fixed, spline_->free()));
    watched_.assign(samples_.count() * torques_.limited(), 0);
}

CurvePoint Sqp::begin(const double *control) {
    span_ = 0.0;
    return evaluate(Vec(control, control + spline_->points * spline_->joints), 0.0, span_);
}

CurvePoint Sqp::evaluate(Vec control, double duration, double &span) {
    CurvePoint point;
    point.duration = std::max(duration, spline_->shortest_duration(control.data()));
    point.control = std::move(control), point.joints = spline_->joints;
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
    return solver_.solve(point.control.data(), point.duration, {&point.contacts, &point.torques}, radius, span_,
                         settings_.gap);
}

// Where no torque binds, the control points alone determine T: the least one or, if that is longer, the minimum of
// time T + jerk J / T^5.
CurvePoint Sqp::follow(const CurvePoint &from, const Step &step) {
    const double time = spline_->time, jerk = spline_->jerk_cost(step.control.data(), 1.0);
    double duration = from.torques.value.empty() ? 0.0 : step.duration;
    if (jerk > 0.0) duration = std::max(duration, time > 0.0 ? std::pow(5.0 * jerk / time, 1.0 / 6.0) : step.duration);
    return evaluate(step.control, duration, span_);
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

void Sqp::watch(CurvePoint &point, const CurvePoint &trial) {
    bool fresh = false;
    for (std::size_t k = 0; k < watched_.size(); ++k) {
        fresh |= trial.exceeded[k] && !watched_[k];
        watched_[k] |= trial.exceeded[k];
    }
    if (fresh)
        torques_.of(*spline_, samples_, point.control.data(), point.duration, watched_, point.torques, point.exceeded);
}

double CurvePoint::nearest() const {
    double least = std::numeric_limits<double>::infinity();
    for (double value : contacts.value) least = std::min(least, value);
    return least;
}

bool CurvePoint::feasible() const {
    return contacts.violation() < NEGLIGIBLE && torques.violation() < NEGLIGIBLE_TORQUE;
}

}  // namespace optiplan
