#include "program/arrow_qp.hpp"

#include "check.hpp"

namespace optiplan::test_arrow_qp {

static ArrowProgram program() {
    ArrowProgram p;
    p.points = 6, p.joints = OCTET;
    const std::size_t size = p.size();
    p.hessian.assign(size * REACH, 0.0), p.gradient.resize(size), p.low.assign(size, -0.5), p.high.assign(size, 0.7);
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t j = 0; j < p.joints; ++j) {
            p.hessian[i * REACH * p.joints + j] = uniform(1.0, 3.0);
            p.gradient[i * p.joints + j] = uniform(-2.0, 2.0);
        }
    return p;
}

TEST(without_rows_it_is_the_clipped_minimum) {
    const ArrowProgram p = program();
    const ArrowSolution found = ArrowQp().solve(p, {1e-9, 1e-9, 1e-7, 60});
    CHECK(found.solved);
    NEAR(found.t, p.low_t, 1e-6);
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t j = 0; j < p.joints; ++j) {
            const std::size_t k = i * p.joints + j;
            const double least = -p.gradient[k] / p.hessian[i * REACH * p.joints + j];
            NEAR(found.x[k], std::fmax(p.low[k], std::fmin(p.high[k], least)), 1e-4);
        }
}

static double cost(const ArrowProgram &p, const Vec &x, double t) {
    double sum = p.gradient_t * t;
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t j = 0; j < p.joints; ++j) {
            const std::size_t k = i * p.joints + j;
            sum += 0.5 * p.hessian[i * REACH * p.joints + j] * x[k] * x[k] + p.gradient[k] * x[k];
        }
    return sum;
}

// Differences of neighbours, with those of the ends: at most 0.3 (1 + t).
static double worst(const ArrowProgram &p, const Vec &x, double t) {
    double most = 0.0;
    for (std::size_t r = 0; r + 1 < p.points; ++r)
        for (std::size_t j = 0; j < p.joints; ++j)
            most = std::fmax(most, std::fabs(x[(r + 1) * p.joints + j] - x[r * p.joints + j]) / 0.3 - 1.0 - t);
    return most;
}

TEST(with_rows_it_keeps_them_and_no_feasible_point_is_better) {
    ArrowProgram p = program();
    for (std::size_t r = 0; r + 1 < p.points; ++r) {
        p.derivatives.stencils.push_back({r, 2, {-1.0, 1.0}});
        p.derivatives.order.push_back(1.0);
    }
    p.derivatives.weight.assign((p.points - 1) * p.joints, 1.0 / 0.3);
    p.derivatives.share.assign((p.points - 1) * p.joints, 0.0);
    const ArrowSolution found = ArrowQp().solve(p, {1e-8, 1e-8, 1e-6, 80});
    CHECK(found.solved);
    CHECK(worst(p, found.x, found.t) < 1e-6);
    const double best = cost(p, found.x, found.t);
    int feasible = 0;
    for (int trial = 0; trial < 2000; ++trial) {  // towards points of the box, as far as the rows let it
        Vec x(found.x);
        double t = found.t, goal = uniform(p.low_t, p.high_t), share = 1.0;
        Vec to(p.size());
        for (double &one : to) one = uniform(-0.5, 0.7);
        for (int halved = 0; halved < 12; ++halved, share *= 0.5) {
            for (std::size_t k = 0; k < p.size(); ++k) x[k] = found.x[k] + share * (to[k] - found.x[k]);
            t = found.t + share * (goal - found.t);
            if (worst(p, x, t) <= 0.0) break;
        }
        if (worst(p, x, t) > 0.0) continue;
        ++feasible;
        CHECK(cost(p, x, t) > best - 1e-6);
    }
    CHECK(feasible > 20);
}

}  // namespace optiplan::test_arrow_qp
