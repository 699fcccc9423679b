#include "program/step.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

namespace {

// Cost of the squared change of each control point, in the program's own variables: it makes it strictly convex.
constexpr double REGULARISATION = 5e-3;
constexpr double OTHERS = 1e-6;  // likewise of T and of the slacks

constexpr double SHORTEST = -0.5, LONGEST = 1.0;  // change of T, as a share of it

}  // namespace

double Inequalities::violation() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < sample.size();) {
        double worst = 0.0;
        const int here = sample[i];
        for (; i < sample.size() && sample[i] == here; ++i) worst = std::max(worst, -value[i]);
        sum += worst;
    }
    return sum;
}

Step StepSolver::solve(const double *control, double duration, const std::vector<const Inequalities *> &soft,
                       double radius, double span, double gap, const SmoothCosts &costs) {
    const Spline &spline = *spline_;
    const std::size_t n = spline.joints;
    program_.points = spline.free(), program_.joints = padded(n);
    scale_.assign(program_.joints, 0.0);
    for (std::size_t j = 0; j < n; ++j) scale_[j] = spline.rates[j] * span;
    bound(control, duration, radius);
    shape(control, duration);
    add_costs(costs, duration);
    soften(soft, duration, radius);

    const ArrowSolution found = qp_.solve(program_, {gap});
    Step step;
    step.solved = found.solved, step.iterations = found.iterations;
    if (!found.solved) return step;
    step.control.assign(control, control + spline.points * n);
    double *moving = step.control.data() + spline.fixed * n;
    for (std::size_t i = 0; i < program_.points; ++i)
        for (std::size_t copy = 0; copy < spline.count(i); ++copy)
            for (std::size_t j = 0; j < n; ++j)
                moving[(i + copy) * n + j] += found.x[i * program_.joints + j] * scale_[j];
    step.duration = duration * (1.0 + found.t);
    double now = 0.0;
    for (const Inequalities *part : soft) now += part->cost();
    step.promise = now - duration * predicted(found);
    return step;
}

// Trust region, joint limits, and the bounds on derivative control points, each divided by its limit.
void StepSolver::bound(const double *control, double duration, double radius) {
    const Spline &spline = *spline_;
    const std::size_t n = spline.joints, wide = program_.joints;
    const double *moving = control + spline.fixed * n;
    program_.low.assign(program_.size(), -radius), program_.high.assign(program_.size(), radius);
    for (std::size_t i = 0; i < program_.points; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            const double here = moving[i * n + j];
            program_.low[i * wide + j] = std::clamp((spline.lower[j] - here) / scale_[j], -radius, 0.0);
            program_.high[i * wide + j] = std::clamp((spline.upper[j] - here) / scale_[j], 0.0, radius);
        }
    program_.low_t = SHORTEST, program_.high_t = LONGEST;
    DerivativeRows &rows = program_.derivatives;
    const std::size_t count = spline.derivatives.size();
    rows.stencils.resize(count), rows.order.resize(count);
    rows.weight.assign(count * wide, 0.0), rows.share.assign(count * wide, 0.0);
    const double power[4] = {1.0, duration, duration * duration, duration * duration * duration};
    for (std::size_t r = 0; r < count; ++r) {
        rows.stencils[r] = free_part(spline.derivatives[r], spline.fixed, spline.free(), spline.open_end);
        rows.order[r] = spline.order[r];
        spline.derivative(r, control, rows.share.data() + r * wide);
        const double *limit = spline.limit(r);
        for (std::size_t j = 0; j < n; ++j) {
            const double most = limit[j] * power[spline.order[r]];
            rows.share[r * wide + j] /= most;
            rows.weight[r * wide + j] = scale_[j] / most;
        }
    }
}

// The objective: time and jerk over T, with a small regularisation.
void StepSolver::shape(const double *control, double duration) {
    const Spline &spline = *spline_;
    const std::size_t n = spline.joints, wide = program_.joints, free = spline.free(), points = spline.points;
    program_.hessian.assign(free * REACH * wide, 0.0);
    program_.gradient.assign(free * wide, 0.0);
    program_.gradient_t = spline.time;
    program_.regularisation = REGULARISATION;
    program_.regularisation_t = program_.regularisation_slack = OTHERS;
    if (spline.jerk == 0.0) return;
    const double factor = 2.0 * spline.jerk * std::pow(duration, -5) / duration;
    program_.gradient_t -= 5.0 * spline.jerk_cost(control, duration) / duration;
    for (std::size_t i = 0; i < free; ++i) {
        double *gradient = program_.gradient.data() + i * wide;
        for (std::size_t row = i + spline.fixed; row < i + spline.fixed + spline.count(i); ++row) {
            const double *gram = spline.gram.data() + row * points;
            for (std::size_t k = 0; k < points; ++k)
                if (gram[k] != 0.0) add_scaled(gradient, factor * gram[k], control + k * n, n);
            for (std::size_t d = 0; d < REACH && i + d < free; ++d)
                for (std::size_t k = i + spline.fixed + d; k < i + spline.fixed + d + spline.count(i + d); ++k)
                    for (std::size_t j = 0; j < n; ++j)
                        program_.hessian[(i * REACH + d) * wide + j] += factor * gram[k] * scale_[j] * scale_[j];
        }
        for (std::size_t j = 0; j < n; ++j) gradient[j] *= scale_[j];
    }
}

// Other costs over T, in the program's variables.
void StepSolver::add_costs(const SmoothCosts &costs, double duration) {
    if (costs.gradient.empty()) return;
    const std::size_t n = spline_->joints, wide = program_.joints, free = spline_->free();
    for (std::size_t i = 0; i < free; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            program_.gradient[i * wide + j] += costs.gradient[i * n + j] * scale_[j] / duration;
            for (std::size_t d = 0; d < REACH && i + d < free; ++d)
                program_.hessian[(i * REACH + d) * wide + j] +=
                    costs.hessian[(i * REACH + d) * n + j] * scale_[j] * scale_[j] / duration;
        }
    program_.gradient_t += costs.gradient_t;
    program_.regularisation_t += costs.hessian_t * duration;
}

// The soft rows that a step of this radius can violate, with a slack for each sample and kind.
void StepSolver::soften(const std::vector<const Inequalities *> &soft, double duration, double radius) {
    const std::size_t n = spline_->joints, wide = program_.joints;
    SoftRows &rows = program_.soft;
    rows.groups.clear(), rows.entries.clear(), rows.right.clear();
    for (const Inequalities *part : soft) {
        const std::size_t width = part->width(n);
        for (std::size_t i = 0; i < part->sample.size();) {
            const int here = part->sample[i];
            Group group;
            group.over = part->over[here];
            group.compact = part->compact;
            group.price = part->price / duration;
            group.begin = rows.right.size(), group.offset = rows.entries.size();
            double total = 1.0;  // of the basis, where rows are by the configuration
            if (group.compact) {
                total = 0.0;
                for (double weight : group.over.weights) total += std::fabs(weight);
            }
            for (; i < part->sample.size() && part->sample[i] == here; ++i) {
                const double *entries = part->entries.data() + i * width;
                double reach = std::fabs(part->by_duration[i]) * duration;
                for (std::size_t k = 0; k < width; ++k) reach += total * radius * std::fabs(entries[k]) * scale_[k % n];
                if (part->value[i] >= reach) continue;
                const std::size_t at = rows.entries.size();
                rows.entries.resize(at + program_.stride(group), 0.0);
                for (std::size_t k = 0; k < width; ++k)
                    rows.entries[at + k / n * wide + k % n] = entries[k] * scale_[k % n] / -part->unit;
                if (!part->compact) rows.entries[at + REACH * wide] = part->by_duration[i] * duration / -part->unit;
                rows.right.push_back(part->value[i] / part->unit);
            }
            group.end = rows.right.size();
            if (group.end > group.begin) rows.groups.push_back(group);
        }
    }
}

// The model's change of the merit over T at the solution, without the regularisation.
double StepSolver::predicted(const ArrowSolution &found) const {
    const ArrowProgram &p = program_;
    const std::size_t n = p.joints;
    double sum = dot(p.gradient.data(), found.x.data(), p.size()) + p.gradient_t * found.t;
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t d = 0; d < REACH && i + d < p.points; ++d)
            for (std::size_t j = 0; j < n; ++j) {
                const double h = p.hessian[(i * REACH + d) * n + j];
                sum += (d ? 1.0 : 0.5) * h * found.x[i * n + j] * found.x[(i + d) * n + j];
            }
    sum += 0.5 * (p.regularisation_t - OTHERS) * found.t * found.t;
    for (std::size_t g = 0; g < p.soft.groups.size(); ++g) sum += p.soft.groups[g].price * found.slack[g];
    return sum;
}

}  // namespace optiplan
