// Primal-dual interior point method (Mehrotra's predictor and corrector) for `ArrowProgram`.
#pragma once

#include "program/arrow_program.hpp"

namespace optiplan {

struct ArrowSettings {
    double gap = 1e-6;  // complementarity summed over all rows, in the objective's unit, at the point looked for
    double residual = 1e-5;  // largest violation of a row
    double stationarity = 1e-3;
    int iterations = 60;
};

struct ArrowSolution {
    bool solved = false;
    int iterations = 0;
    double t = 0.0, gap = 0.0, residual = 0.0, stationarity = 0.0;
    Vec x, slack;  // (M n,), (groups,) what the rows of each group lack at (x, t)
    Vec prices;  // (K,) multipliers of the soft rows
};

class ArrowQp {
  public:
    ArrowSolution solve(const ArrowProgram &program, const ArrowSettings &settings = {});

  private:
    // Kinds of rows, in the order in which their slacks z and multipliers lie in memory.
    enum Kind { LOW, HIGH, LOW_T, HIGH_T, ABOVE, BELOW, SOFT, SLACK, KINDS };

    const ArrowProgram *p_ = nullptr;
    std::size_t size_ = 0, band_ = 0, total_ = 0;
    std::size_t begin_[KINDS + 1] = {};
    BandArrow matrix_;
    Vec x_, s_;  // variables; x_ padded
    double t_ = 0.0;
    Vec z_, y_;  // slack and multiplier of every row
    Vec inverse_, weight_, shift_;  // 1 / z; y / z; what the step adds to the right side, row by row
    Vec row_residual_, moved_;
    double worst_z_ = 0.0, worst_y_ = 0.0;  // most of -dz / z and of -dy / y
    Vec dx_, ds_, dz_, dy_, affine_;
    double dt_ = 0.0;
    Vec grad_, grad_s_;  // stationarity residual
    Vec bent_;  // H dx
    double grad_t_ = 0.0;
    Vec mean_, mean_weight_, damping_;  // group by group: mean row, total weight of the rows, and with the slack's
    Vec local_, cross_, diagonals_;
    Vec centred_, weighted_;  // of a group: its mean row and its rows about that, and each times its weight
    double gap_ = 0.0, primal_ = 0.0, dual_ = 0.0;

    std::size_t rows_of(Kind kind) const { return begin_[kind + 1] - begin_[kind]; }
    double *dual(Kind kind) { return y_.data() + begin_[kind]; }
    std::size_t mean_at(std::size_t group) const { return group * padded(REACH * p_->joints + 1); }

    void prepare();

    // Values of all rows, A v, into `out`.
    void rows(const Vec &x, double t, const Vec &s, Vec &out);

    // z of a group and t, padded with zeros, into `local_`.
    void gather(const Group &group, const Vec &x, double t);

    // Add `factor` times a group's local vector to (x, t).
    void scatter(const Group &group, const double *local, double factor, Vec &x, double &t) const;

    // Add A' m to (x, t, s).
    void transposed(const Vec &m, Vec &x, double &t, Vec &s);

    // Right side of every row, minus A v.
    void room(const Vec &values, Vec &out) const;

    void start();

    void residuals();

    double largest_gradient() const;

    // H x, with the regularisation.
    void curved(const Vec &x, Vec &out) const;

    // Take the step, and the residuals with it.
    void advance(double step_z, double step_y);

    // H + A' W A with the slacks eliminated; false where it cannot be factored.
    bool factor();

    void add_derivatives();

    // With total weight w of its rows and w_s of its slack, mean row m and rows a:
    // sum w_i a_i a_i' - (w m)(w m)' / (w + w_s) = sum w_i (a_i - m)(a_i - m)' + w w_s / (w + w_s) m m', without
    // cancellation.
    void add_group(std::size_t g);

    // Tile of the sum of `weighted` `centred`' over `count` rows: its columns and its rows, in whole vectors.
    void product(std::size_t count, std::size_t stride, std::size_t column, std::size_t row, double *tile) const;

    // Add that of rows of a configuration, spread over its control points, or of rows of control points and t.
    void add_compact(const Group &group, std::size_t count);
    void add_wide(const Group &group, std::size_t count);

    // Newton step for complementarity z y = `target` (per row), into dx_, dt_, ds_, dz_, dy_.
    // `second`: whether to subtract the products of the affine step, kept in `affine_`.
    void newton(double target, bool second);

    // Predictor and corrector towards the point of the central path with this gap, at least.
    bool step(double least_gap);
};

}  // namespace optiplan
