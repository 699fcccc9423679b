#include "program/arrow_qp.hpp"

namespace optiplan {

namespace {

// The first point: change of T, slack beyond what rows lack, least distance from a row, complementarity of each row.
constexpr double START_T = 0.1, START_SLACK = 0.1, START_ROOM = 0.3, START_PRODUCT = 0.1;

constexpr double NEAR_PATH = 1.5;  // times the gap aimed at, below which it is reached

constexpr double TO_BOUNDARY = 0.99;  // share of the way to the nearest bound that a step may take

}  // namespace

ArrowSolution ArrowQp::solve(const ArrowProgram &program, const ArrowSettings &settings) {
    p_ = &program;
    prepare();
    start();
    ArrowSolution found;
    for (int k = 0;; ++k) {
        residuals();
        found.iterations = k, found.gap = gap_, found.residual = primal_, found.stationarity = dual_;
        if (!std::isfinite(gap_ + primal_ + dual_)) break;
        if (gap_ <= NEAR_PATH * settings.gap && primal_ <= settings.residual && dual_ <= settings.stationarity) {
            found.solved = true;
            break;
        }
        if (k == settings.iterations || !step(settings.gap)) break;
    }
    found.x.assign(x_.begin(), x_.begin() + static_cast<std::ptrdiff_t>(size_));
    found.t = t_;
    found.slack.assign(s_.size(), 0.0);
    for (std::size_t g = 0; g < s_.size(); ++g)
        for (std::size_t i = program.soft.groups[g].begin; i < program.soft.groups[g].end; ++i)
            found.slack[g] = std::max(found.slack[g], moved_[begin_[SOFT] + i] + s_[g] - program.soft.right[i]);
    found.prices.assign(dual(SOFT), dual(SOFT) + rows_of(SOFT));
    return found;
}

void ArrowQp::prepare() {
    const ArrowProgram &p = *p_;
    size_ = p.size(), band_ = REACH * p.joints;
    const std::size_t derivative = p.derivatives.order.size() * p.joints;
    const std::size_t counts[KINDS] = {size_, size_, 1, 1, derivative, derivative, p.soft.right.size(), p.soft.groups.size()};
    begin_[0] = 0;
    for (int kind = 0; kind < KINDS; ++kind) begin_[kind + 1] = begin_[kind] + counts[kind];
    total_ = begin_[KINDS];
    matrix_.resize(size_, band_);
    for (Vec* rows : {&z_, &y_, &inverse_, &weight_, &shift_, &row_residual_, &moved_, &dz_, &dy_, &affine_})
        rows->assign(total_ + LANES, 0.0);
    x_.assign(size_ + band_ + LANES, 0.0);
    dx_.assign(size_ + band_ + LANES, 0.0);
    grad_.assign(size_ + band_ + LANES, 0.0);
    const std::size_t groups = p.soft.groups.size();
    for (Vec* each : {&s_, &ds_, &grad_s_, &damping_, &mean_weight_}) each->assign(groups, 0.0);
    mean_.assign(groups * padded(band_ + 1), 0.0);
    local_.assign(padded(band_ + 1), 0.0);
    block_.assign(padded(band_ + 1) * padded(band_ + 1), 0.0);
}

void ArrowQp::rows(const Vec &x, double t, const Vec &s, Vec &out) {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    for (std::size_t i = 0; i < size_; ++i) out[begin_[LOW] + i] = -x[i], out[begin_[HIGH] + i] = x[i];
    out[begin_[LOW_T]] = -t, out[begin_[HIGH_T]] = t;
    const DerivativeRows &rows = p.derivatives;
    for (std::size_t r = 0; r < rows.order.size(); ++r) {
        double *__restrict above = out.data() + begin_[ABOVE] + r * n;
        double *__restrict below = out.data() + begin_[BELOW] + r * n;
        std::fill_n(above, n, 0.0);
        for (std::size_t k = 0; k < rows.stencils[r].count; ++k)
            add_vectors(above, rows.stencils[r].weights[k], x.data() + (rows.stencils[r].first + k) * n, n);
        const double relief = rows.order[r] * t;
        for (std::size_t j = 0; j < n; ++j) {
            const double value = above[j] * rows.weight[r * n + j];
            above[j] = value - relief, below[j] = -value - relief;
        }
    }
    for (std::size_t g = 0; g < p.soft.groups.size(); ++g) {
        const Group &group = p.soft.groups[g];
        const std::size_t stride = p.stride(group);
        gather(group, x, t);
        for (std::size_t i = group.begin; i < group.end; ++i)
            out[begin_[SOFT] + i] = dot(p.soft.entries.data() + group.offset + (i - group.begin) * stride, local_.data(), stride) - s[g];
        out[begin_[SLACK] + g] = -s[g];
    }
}

void ArrowQp::gather(const Group &group, const Vec &x, double t) {
    const std::size_t n = p_->joints, width = p_->width(group);
    std::fill(local_.begin(), local_.end(), 0.0);
    if (group.compact)
        for (std::size_t k = 0; k < REACH; ++k) add_vectors(local_.data(), group.over.weights[k], x.data() + (group.over.first + k) * n, n);
    else
        std::copy_n(x.data() + group.over.first * n, width - 1, local_.data()), local_[width - 1] = t;
}

void ArrowQp::scatter(const Group &group, const double *local, double factor, Vec &x, double &t) const {
    const std::size_t n = p_->joints, width = p_->width(group);
    if (group.compact)
        for (std::size_t k = 0; k < REACH; ++k)
            add_vectors(x.data() + (group.over.first + k) * n, factor * group.over.weights[k], local, n);
    else
        add_scaled(x.data() + group.over.first * n, factor, local, width - 1), t += factor * local[width - 1];
}

void ArrowQp::transposed(const Vec &m, Vec &x, double &t, Vec &s) {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    for (std::size_t i = 0; i < size_; ++i) x[i] += m[begin_[HIGH] + i] - m[begin_[LOW] + i];
    t += m[begin_[HIGH_T]] - m[begin_[LOW_T]];
    const DerivativeRows &rows = p.derivatives;
    for (std::size_t r = 0; r < rows.order.size(); ++r) {
        const double *above = m.data() + begin_[ABOVE] + r * n;
        const double *below = m.data() + begin_[BELOW] + r * n;
        double sum = 0.0;
        for (std::size_t j = 0; j < n; ++j) {
            sum += above[j] + below[j];
            local_[j] = (above[j] - below[j]) * rows.weight[r * n + j];
        }
        t -= rows.order[r] * sum;
        for (std::size_t k = 0; k < rows.stencils[r].count; ++k)
            add_vectors(x.data() + (rows.stencils[r].first + k) * n, rows.stencils[r].weights[k], local_.data(), n);
    }
    for (std::size_t g = 0; g < p.soft.groups.size(); ++g) {
        const Group &group = p.soft.groups[g];
        const std::size_t stride = p.stride(group);
        std::fill_n(local_.begin(), stride, 0.0);
        double sum = 0.0;
        for (std::size_t i = group.begin; i < group.end; ++i) {
            const double factor = m[begin_[SOFT] + i];
            sum += factor;
            add_vectors(local_.data(), factor, p.soft.entries.data() + group.offset + (i - group.begin) * stride, stride);
        }
        scatter(group, local_.data(), 1.0, x, t);
        s[g] -= sum + m[begin_[SLACK] + g];
    }
}

void ArrowQp::room(const Vec &values, Vec &out) const {
    const ArrowProgram &p = *p_;
    for (std::size_t i = 0; i < size_; ++i) {
        out[begin_[LOW] + i] = -p.low[i] - values[begin_[LOW] + i];
        out[begin_[HIGH] + i] = p.high[i] - values[begin_[HIGH] + i];
    }
    out[begin_[LOW_T]] = -p.low_t - values[begin_[LOW_T]];
    out[begin_[HIGH_T]] = p.high_t - values[begin_[HIGH_T]];
    const Vec &share = p.derivatives.share;
    for (std::size_t i = 0; i < share.size(); ++i) {
        out[begin_[ABOVE] + i] = 1.0 - share[i] - values[begin_[ABOVE] + i];
        out[begin_[BELOW] + i] = 1.0 + share[i] - values[begin_[BELOW] + i];
    }
    for (std::size_t i = 0; i < p.soft.right.size(); ++i)
        out[begin_[SOFT] + i] = p.soft.right[i] - values[begin_[SOFT] + i];
    for (std::size_t g = 0; g < s_.size(); ++g) out[begin_[SLACK] + g] = -values[begin_[SLACK] + g];
}

void ArrowQp::start() {
    const ArrowProgram &p = *p_;
    for (std::size_t i = 0; i < size_; ++i) x_[i] = 0.5 * (p.low[i] + p.high[i]);
    t_ = START_T;
    for (std::size_t g = 0; g < s_.size(); ++g) {
        const Group &group = p.soft.groups[g];
        double worst = 0.0;
        for (std::size_t i = group.begin; i < group.end; ++i) worst = std::max(worst, -p.soft.right[i]);
        s_[g] = worst + START_SLACK;
    }
    rows(x_, t_, s_, moved_);
    room(moved_, z_);
    for (std::size_t i = 0; i < total_; ++i) {
        z_[i] = std::max(z_[i], START_ROOM);
        y_[i] = START_PRODUCT / z_[i];
    }
    for (std::size_t g = 0; g < s_.size(); ++g) {
        const Group &group = p.soft.groups[g];
        const double count = static_cast<double>(group.end - group.begin);
        y_[begin_[SLACK] + g] = 0.5 * group.price;
        for (std::size_t i = group.begin; i < group.end; ++i) y_[begin_[SOFT] + i] = std::min(0.5 * group.price / count, START_PRODUCT/z_[begin_[SOFT]+i]);
    }
}

void ArrowQp::residuals() {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    rows(x_, t_, s_, moved_);
    room(moved_, row_residual_);
    primal_ = 0.0;
    for (std::size_t i = 0; i < total_; ++i) {
        row_residual_[i] = z_[i] - row_residual_[i];
        primal_ = std::max(primal_, std::abs(row_residual_[i]));
    }
    gap_ = dot(z_.data(), y_.data(), total_);
    for (std::size_t i = 0; i < size_; ++i) grad_[i] = p.gradient[i] + p.regularisation * x_[i];
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t d = 0; d < REACH && i + d < p.points; ++d)
            for (std::size_t j = 0; j < n; ++j) {
                const double h = p.hessian[(i * REACH + d) * n + j];
                grad_[i * n + j] += h * x_[(i + d) * n + j];
                if (d) grad_[(i + d) * n + j] += h * x_[i * n + j];
            }
    grad_t_ = p.gradient_t + p.regularisation_t * t_;
    for (std::size_t g = 0; g < s_.size(); ++g) grad_s_[g] = p.soft.groups[g].price + p.regularisation_slack * s_[g];
    transposed(y_, grad_, grad_t_, grad_s_);
    dual_ = std::abs(grad_t_);
    for (std::size_t i = 0; i < size_; ++i) dual_ = std::max(dual_, std::abs(grad_[i]));
    for (double value : grad_s_) dual_ = std::max(dual_, std::abs(value));
    std::fill(grad_.begin() + static_cast<std::ptrdiff_t>(size_), grad_.end(), 0.0);
}

bool ArrowQp::factor() {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    for (std::size_t i = 0; i < total_; ++i) {
        inverse_[i] = 1.0 / z_[i];
        weight_[i] = y_[i] * inverse_[i];
    }
    matrix_.clear();
    matrix_.corner = p.regularisation_t + weight_[begin_[LOW_T]] + weight_[begin_[HIGH_T]];
    diagonals_ = p.hessian;
    add_derivatives();
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t d = 0; d < REACH && i + d < p.points; ++d)
            for (std::size_t j = 0; j < n; ++j) matrix_.column(i * n + j)[d * n] = diagonals_[(i * REACH + d) * n + j];
    for (std::size_t i = 0; i < size_; ++i)
        matrix_.column(i)[0] += p.regularisation + weight_[begin_[LOW] + i] + weight_[begin_[HIGH] + i];
    for (std::size_t g = 0; g < s_.size(); ++g) add_group(g);
    return matrix_.factor();
}

void ArrowQp::add_derivatives() {
    const DerivativeRows &rows = p_->derivatives;
    const std::size_t n = p_->joints;
    double *both = local_.data(), *cross = block_.data();
    for (std::size_t r = 0; r < rows.order.size(); ++r) {
        const double *above = weight_.data() + begin_[ABOVE] + r * n;
        const double *below = weight_.data() + begin_[BELOW] + r * n;
        const double *weight = rows.weight.data() + r * n;
        const Stencil &stencil = rows.stencils[r];
        double sum = 0.0;
        for (std::size_t j = 0; j < n; ++j) {
            both[j] = (above[j] + below[j]) * weight[j] * weight[j];
            cross[j] = -(above[j] - below[j]) * weight[j] * rows.order[r];
            sum += above[j] + below[j];
        }
        for (std::size_t k = 0; k < stencil.count; ++k) {
            const std::size_t point = stencil.first + k;
            add_vectors(matrix_.border.data() + point * n, stencil.weights[k], cross, n);
            for (std::size_t d = 0; k + d < stencil.count; ++d)
                add_vectors(diagonals_.data() + (point * REACH + d) * n, stencil.weights[k] * stencil.weights[k + d], both, n);
        }
        matrix_.corner += rows.order[r] * rows.order[r] * sum;
    }
}

void ArrowQp::add_group(std::size_t g) {
    const ArrowProgram &p = *p_;
    const Group &group = p.soft.groups[g];
    const std::size_t stride = p.stride(group), width = p.width(group);
    const double *entries = p.soft.entries.data() + group.offset;
    const double *weight = weight_.data() + begin_[SOFT];
    double *mean = mean_.data() + mean_at(g);
    std::fill_n(mean, stride, 0.0);
    double sum = 0.0;
    for (std::size_t i = group.begin; i < group.end; ++i) {
        sum += weight[i];
        add_vectors(mean, weight[i], entries + (i - group.begin) * stride, stride);
    }
    for (std::size_t k = 0; k < stride; ++k) mean[k] /= sum;
    const double own = weight_[begin_[SLACK] + g] + p.regularisation_slack;
    mean_weight_[g] = sum, damping_[g] = sum + own;
    double *__restrict block = block_.data();
    const double keep = sum * own / (sum + own);
    // Row a is needed from the diagonal on; compact rows are needed whole.
    const auto from = [&](std::size_t a) { return group.compact ? 0 : a / LANES * LANES; };
    for (std::size_t a = 0; a < width; ++a)
        for (std::size_t b = from(a); b < stride; ++b) block[a * stride + b] = keep * mean[a] * mean[b];
    if (group.end - group.begin > 1)
        for (std::size_t i = group.begin; i < group.end; ++i) {
            const double *row = entries + (i - group.begin) * stride;
            for (std::size_t b = 0; b < stride; ++b) local_[b] = row[b] - mean[b];
            for (std::size_t a = 0; a < width; ++a)
                add_vectors(block + a * stride + from(a), weight[i] * local_[a], local_.data() + from(a), stride - from(a));
        }
    add_block(group);
}

void ArrowQp::add_block(const Group &group) {
    const std::size_t n = p_->joints, stride = p_->stride(group), width = p_->width(group);
    const double *block = block_.data();
    if (!group.compact) {
        const std::size_t t = width - 1;
        matrix_.corner += block[t * stride + t];
        for (std::size_t a = 0; a + 1 < width; ++a) {
            add_scaled(matrix_.column(group.over.first * n + a), 1.0, block + a * stride + a, width - 1 - a);
            matrix_.border[group.over.first * n + a] += block[a * stride + t];
        }
        return;
    }
    for (std::size_t k = 0; k < REACH; ++k) {
        if (group.over.weights[k] == 0.0) continue;
        const std::size_t c = (group.over.first + k) * n;
        for (std::size_t a = 0; a < n; ++a) {
            double *column = matrix_.column(c + a);
            add_scaled(column, group.over.weights[k] * group.over.weights[k], block + a * stride + a, n - a);
            for (std::size_t d = 1; k + d < REACH; ++d)
                add_vectors(column + d * n - a, group.over.weights[k] * group.over.weights[k + d], block + a * stride, n);
        }
    }
}

void ArrowQp::newton(double target, bool second) {
    const ArrowProgram &p = *p_;
    for (std::size_t i = 0; i < total_; ++i) {
        const double wanted = target - (second ? affine_[i] : 0.0);
        shift_[i] = (wanted - y_[i] * z_[i] + y_[i] * row_residual_[i]) * inverse_[i];
    }
    for (std::size_t i = 0; i < dx_.size(); ++i) dx_[i] = grad_[i];
    dt_ = grad_t_;
    for (std::size_t g = 0; g < ds_.size(); ++g) ds_[g] = grad_s_[g];
    transposed(shift_, dx_, dt_, ds_);
    for (std::size_t i = 0; i < size_; ++i) dx_[i] = -dx_[i];
    for (std::size_t i = size_; i < dx_.size(); ++i) dx_[i] = 0.0;
    dt_ = -dt_;
    for (std::size_t g = 0; g < ds_.size(); ++g) {
        ds_[g] = -ds_[g];
        scatter(p.soft.groups[g], mean_.data() + mean_at(g), mean_weight_[g] * ds_[g] / damping_[g], dx_, dt_);
    }
    matrix_.solve(dx_.data(), dt_);
    for (std::size_t i = size_; i < dx_.size(); ++i) dx_[i] = 0.0;
    for (std::size_t g = 0; g < ds_.size(); ++g) {
        const Group &group = p.soft.groups[g];
        gather(group, dx_, dt_);
        ds_[g] = (ds_[g] + mean_weight_[g] * dot(mean_.data() + mean_at(g), local_.data(), p.stride(group))) / damping_[g];
    }
    rows(dx_, dt_, ds_, moved_);
    for (std::size_t i = 0; i < total_; ++i) {
        dz_[i] = -row_residual_[i] - moved_[i];
        dy_[i] = shift_[i] + weight_[i] * moved_[i];
    }
}

double ArrowQp::longest(const Vec &value, const Vec &change, double share) const {
    double part[LANES];
    std::fill_n(part, LANES, share);
    std::size_t k = 0;
    for (; k + LANES <= total_; k += LANES)
        for (std::size_t i = 0; i < LANES; ++i) {
            const double ratio = -change[k + i] / value[k + i];
            part[i] = ratio > part[i] ? ratio : part[i];
        }
    for (; k < total_; ++k) part[0] = std::max(part[0], -change[k] / value[k]);
    return share / *std::max_element(part, part + LANES);
}

bool ArrowQp::step(double least_gap) {
    if (!factor()) return false;
    const double count = static_cast<double>(total_), now = gap_ / count;
    newton(0.0, false);
    const double primal = longest(z_, dz_, 1.0), dual = longest(y_, dy_, 1.0);
    for (std::size_t i = 0; i < total_; ++i) affine_[i] = dz_[i] * dy_[i];
    const double after = gap_ + primal * dot(dz_.data(), y_.data(), total_) + dual * dot(z_.data(), dy_.data(), total_) +
                         primal * dual * dot(dz_.data(), dy_.data(), total_);
    const double ratio = std::max(after, 0.0) / gap_, target = std::max(now * ratio * ratio * ratio, least_gap / count);
    newton(target, true);
    const double step_z = longest(z_, dz_, TO_BOUNDARY), step_y = longest(y_, dy_, TO_BOUNDARY);
    for (std::size_t i = 0; i < size_; ++i) x_[i] += step_z * dx_[i];
    t_ += step_z * dt_;
    for (std::size_t g = 0; g < s_.size(); ++g) s_[g] += step_z * ds_[g];
    for (std::size_t i = 0; i < total_; ++i) z_[i] += step_z * dz_[i], y_[i] += step_y * dy_[i];
    return true;
}
}  // namespace optiplan
