#include "program/arrow_qp.hpp"

namespace optiplan {

namespace {

// The first point: change of T, slack beyond what rows lack, least distance from a row, complementarity of each row.
constexpr double START_T = 0.1, START_SLACK = 0.1, START_ROOM = 0.3, START_PRODUCT = 0.1;

constexpr double NEAR_PATH = 1.5;  // times the gap aimed at, below which it is reached

constexpr double TO_BOUNDARY = 0.99;  // share of the way to the nearest bound that a step may take

double most(const Octet &values) {
    const double *first = reinterpret_cast<const double *>(&values);
    return *std::max_element(first, first + OCTET);
}

}  // namespace

ArrowSolution ArrowQp::solve(const ArrowProgram &program, const ArrowSettings &settings) {
    p_ = &program;
    prepare();
    start();
    residuals();
    const auto near = [&] {
        return gap_ <= NEAR_PATH * settings.gap && primal_ <= settings.residual && dual_ <= settings.stationarity;
    };
    ArrowSolution found;
    for (int k = 0;; ++k) {
        if (near()) residuals();  // without the rounding of all steps
        found.iterations = k, found.gap = gap_, found.residual = primal_, found.stationarity = dual_;
        found.solved = near();
        if (found.solved || !std::isfinite(gap_ + primal_ + dual_)) break;
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
    const std::size_t counts[KINDS] = {
        size_, size_, 1, 1, derivative, derivative, p.soft.right.size(), p.soft.groups.size()};
    begin_[0] = 0;
    for (int kind = 0; kind < KINDS; ++kind) begin_[kind + 1] = begin_[kind] + counts[kind];
    total_ = begin_[KINDS];
    matrix_.resize(size_, band_ / OCTET);
    for (Vec *rows : {&z_, &y_, &inverse_, &weight_, &shift_, &row_residual_, &moved_, &dz_, &dy_, &affine_})
        rows->assign(padded(total_), 0.0);
    for (Vec *each : {&x_, &dx_, &grad_, &bent_}) each->assign(size_ + band_, 0.0);
    const std::size_t groups = p.soft.groups.size();
    for (Vec *each : {&s_, &ds_, &grad_s_, &damping_, &mean_weight_}) each->assign(groups, 0.0);
    mean_.assign(groups * padded(band_ + 1), 0.0);
    local_.assign(padded(band_ + 1), 0.0);
    cross_.assign(p.joints, 0.0);
    std::size_t most = 0;
    for (const Group &group : p.soft.groups) most = std::max(most, (group.end - group.begin + 1) * p.stride(group));
    centred_.assign(most, 0.0), weighted_.assign(most, 0.0);
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
        const Stencil &stencil = rows.stencils[r];
        sum_vectors(above, n, stencil.count,
                    [&](std::size_t k) { return std::pair{stencil.weights[k], x.data() + (stencil.first + k) * n}; });
        const double relief = rows.order[r] * t;
        for (std::size_t j = 0; j < n; j += OCTET) {
            const Octet value = octet(above + j) * octet(rows.weight.data() + r * n + j);
            octet(above + j) = value - relief, octet(below + j) = -value - relief;
        }
    }
    for (std::size_t g = 0; g < p.soft.groups.size(); ++g) {
        const Group &group = p.soft.groups[g];
        const std::size_t stride = p.stride(group);
        gather(group, x, t);
        for (std::size_t i = group.begin; i < group.end; ++i)
            out[begin_[SOFT] + i] =
                dot(p.soft.entries.data() + group.offset + (i - group.begin) * stride, local_.data(), stride) - s[g];
        out[begin_[SLACK] + g] = -s[g];
    }
}

void ArrowQp::gather(const Group &group, const Vec &x, double t) {
    const std::size_t n = p_->joints, width = p_->width(group);
    const double *first = x.data() + group.over.first * n;
    if (group.compact) {
        sum_vectors(local_.data(), n, REACH,
                    [&](std::size_t k) { return std::pair{group.over.weights[k], first + k * n}; });
        return;
    }
    std::copy_n(first, width - 1, local_.data());
    std::fill(local_.begin() + static_cast<std::ptrdiff_t>(width), local_.end(), 0.0);
    local_[width - 1] = t;
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
        const double *factors = m.data() + begin_[SOFT] + group.begin;
        const double *entries = p.soft.entries.data() + group.offset;
        double sum = 0.0;
        for (std::size_t i = 0; i < group.end - group.begin; ++i) sum += factors[i];
        sum_vectors(local_.data(), stride, group.end - group.begin,
                    [&](std::size_t i) { return std::pair{factors[i], entries + i * stride}; });
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
    for (std::size_t i = total_; i < z_.size(); ++i) z_[i] = y_[i] = 1.0;  // no row: nothing is divided by zero
    for (std::size_t g = 0; g < s_.size(); ++g) {
        const Group &group = p.soft.groups[g];
        const double count = static_cast<double>(group.end - group.begin);
        y_[begin_[SLACK] + g] = 0.5 * group.price;
        for (std::size_t i = group.begin; i < group.end; ++i)
            y_[begin_[SOFT] + i] = std::min(0.5 * group.price / count, START_PRODUCT / z_[begin_[SOFT] + i]);
    }
}

void ArrowQp::residuals() {
    const ArrowProgram &p = *p_;
    rows(x_, t_, s_, moved_);
    room(moved_, row_residual_);
    primal_ = 0.0;
    for (std::size_t i = 0; i < total_; ++i) {
        row_residual_[i] = z_[i] - row_residual_[i];
        primal_ = std::max(primal_, std::abs(row_residual_[i]));
    }
    gap_ = dot(z_.data(), y_.data(), total_);
    curved(x_, grad_);
    for (std::size_t i = 0; i < size_; ++i) grad_[i] += p.gradient[i];
    grad_t_ = p.gradient_t + p.regularisation_t * t_;
    for (std::size_t g = 0; g < s_.size(); ++g) grad_s_[g] = p.soft.groups[g].price + p.regularisation_slack * s_[g];
    transposed(y_, grad_, grad_t_, grad_s_);
    dual_ = largest_gradient();
}

double ArrowQp::largest_gradient() const {
    double most = std::abs(grad_t_);
    for (std::size_t i = 0; i < size_; ++i) most = std::max(most, std::abs(grad_[i]));
    for (double value : grad_s_) most = std::max(most, std::abs(value));
    return most;
}

void ArrowQp::curved(const Vec &x, Vec &out) const {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    std::fill(out.begin(), out.end(), 0.0);
    add_vectors(out.data(), p.regularisation, x.data(), size_);
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t d = 0; d < REACH && i + d < p.points; ++d)
            for (std::size_t j = 0; j < n; j += OCTET) {
                const Octet h = octet(p.hessian.data() + (i * REACH + d) * n + j);
                const std::size_t one = i * n + j, other = one + d * n;
                octet(out.data() + one) += h * octet(x.data() + other);
                if (d) octet(out.data() + other) += h * octet(x.data() + one);
            }
}

// With (dx, dy) a Newton step, H dx + A' dy = -gradient and dz + A dx = -residual.
void ArrowQp::advance(double step_z, double step_y) {
    const ArrowProgram &p = *p_;
    add_vectors(x_.data(), step_z, dx_.data(), size_);
    t_ += step_z * dt_;
    for (std::size_t g = 0; g < s_.size(); ++g) s_[g] += step_z * ds_[g];
    add_vectors(z_.data(), step_z, dz_.data(), z_.size());
    add_vectors(y_.data(), step_y, dy_.data(), y_.size());
    gap_ = dot(z_.data(), y_.data(), total_);
    for (std::size_t k = 0; k < row_residual_.size(); k += OCTET) octet(row_residual_.data() + k) *= 1.0 - step_z;
    primal_ *= 1.0 - step_z;
    const double left = 1.0 - step_y, bent = step_z - step_y;
    curved(dx_, bent_);
    for (std::size_t i = 0; i < size_; i += OCTET)
        octet(grad_.data() + i) = left * octet(grad_.data() + i) + bent * octet(bent_.data() + i);
    grad_t_ = left * grad_t_ + bent * p.regularisation_t * dt_;
    for (std::size_t g = 0; g < s_.size(); ++g) grad_s_[g] = left * grad_s_[g] + bent * p.regularisation_slack * ds_[g];
    dual_ = largest_gradient();
}

bool ArrowQp::factor() {
    const ArrowProgram &p = *p_;
    const std::size_t n = p.joints;
    for (std::size_t k = 0; k < z_.size(); k += OCTET) {
        octet(inverse_.data() + k) = 1.0 / octet(z_.data() + k);
        octet(weight_.data() + k) = octet(y_.data() + k) * octet(inverse_.data() + k);
    }
    matrix_.clear();
    matrix_.corner = p.regularisation_t + weight_[begin_[LOW_T]] + weight_[begin_[HIGH_T]];
    diagonals_ = p.hessian;
    add_derivatives();
    const std::size_t tiles = n / OCTET, diagonal = OCTET + 1;
    for (std::size_t i = 0; i < p.points; ++i)
        for (std::size_t d = 0; d < REACH && i + d < p.points; ++d)
            for (std::size_t j = 0; j < n; ++j)
                matrix_.tile(i * tiles + j / OCTET, d * tiles)[j % OCTET * diagonal] =
                    diagonals_[(i * REACH + d) * n + j];
    for (std::size_t i = 0; i < size_; ++i)
        matrix_.tile(i / OCTET, 0)[i % OCTET * diagonal] +=
            p.regularisation + weight_[begin_[LOW] + i] + weight_[begin_[HIGH] + i];
    for (std::size_t g = 0; g < s_.size(); ++g) add_group(g);
    return matrix_.factor();
}

void ArrowQp::add_derivatives() {
    const DerivativeRows &rows = p_->derivatives;
    const std::size_t n = p_->joints;
    double *both = local_.data(), *cross = cross_.data();
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
                add_vectors(diagonals_.data() + (point * REACH + d) * n, stencil.weights[k] * stencil.weights[k + d],
                            both, n);
        }
        matrix_.corner += rows.order[r] * rows.order[r] * sum;
    }
}

void ArrowQp::add_group(std::size_t g) {
    const ArrowProgram &p = *p_;
    const Group &group = p.soft.groups[g];
    const std::size_t stride = p.stride(group);
    const double *entries = p.soft.entries.data() + group.offset;
    const double *weight = weight_.data() + begin_[SOFT];
    double *mean = mean_.data() + mean_at(g);
    double sum = 0.0;
    for (std::size_t i = group.begin; i < group.end; ++i) sum += weight[i];
    sum_vectors(mean, stride, group.end - group.begin,
                [&](std::size_t i) { return std::pair{weight[group.begin + i], entries + i * stride}; });
    for (std::size_t k = 0; k < stride; ++k) mean[k] /= sum;
    const double own = weight_[begin_[SLACK] + g] + p.regularisation_slack;
    mean_weight_[g] = sum, damping_[g] = sum + own;
    const std::size_t count = group.end - group.begin;
    std::size_t used = 0;
    const auto take = [&](double factor, const double *row, bool about_mean) {
        for (std::size_t k = 0; k < stride; k += OCTET) {
            const Octet centred = about_mean ? octet(row + k) - octet(mean + k) : octet(row + k);
            octet(centred_.data() + used * stride + k) = centred;
            octet(weighted_.data() + used * stride + k) = factor * centred;
        }
        ++used;
    };
    take(sum * own / (sum + own), mean, false);
    if (count > 1)
        for (std::size_t i = 0; i < count; ++i) take(weight[group.begin + i], entries + i * stride, true);
    if (group.compact)
        add_compact(group, used);
    else
        add_wide(group, used);
}

void ArrowQp::product(std::size_t count, std::size_t stride, std::size_t column, std::size_t row, double *tile) const {
    const double *left = weighted_.data() + column * OCTET, *right = centred_.data() + row * OCTET;
    for (std::size_t from = 0; from < OCTET; from += NATIVE) {  // as many columns as there are registers for
        Octet sum[NATIVE] = {};
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t a = 0; a < NATIVE; ++a) sum[a] += left[i * stride + from + a] * octet(right + i * stride);
        for (std::size_t a = 0; a < NATIVE; ++a) octet(tile + (from + a) * OCTET) = sum[a];
    }
}

void ArrowQp::add_compact(const Group &group, std::size_t count) {
    const std::size_t stride = p_->stride(group), tiles = p_->joints / OCTET;
    const auto &weights = group.over.weights;
    double tile[OCTET * OCTET];
    for (std::size_t a = 0; a < tiles; ++a)
        for (std::size_t b = 0; b < tiles; ++b) {
            product(count, stride, a, b, tile);
            for (std::size_t k = 0; k < REACH; ++k)
                for (std::size_t d = b < a; k + d < REACH; ++d) {
                    const double weight = weights[k] * weights[k + d];
                    if (weight == 0.0) continue;
                    add_vectors(matrix_.tile((group.over.first + k) * tiles + a, d * tiles + b - a), weight, tile,
                                OCTET * OCTET);
                }
        }
}

void ArrowQp::add_wide(const Group &group, std::size_t count) {
    const std::size_t stride = p_->stride(group), tiles = p_->joints / OCTET, t = p_->width(group) - 1;
    const std::size_t first = group.over.first * tiles, within = std::min(REACH * tiles, p_->points * tiles - first);
    double tile[OCTET * OCTET];
    for (std::size_t a = 0; a < within; ++a)
        for (std::size_t b = a; b < within; ++b) {
            product(count, stride, a, b, tile);
            add_vectors(matrix_.tile(first + a, b - a), 1.0, tile, OCTET * OCTET);
        }
    for (std::size_t i = 0; i < count; ++i) {
        const double *row = centred_.data() + i * stride, weighted = weighted_[i * stride + t];
        add_vectors(matrix_.border.data() + first * OCTET, weighted, row, within * OCTET);
        matrix_.corner += weighted * row[t];
    }
}

void ArrowQp::newton(double target, bool second) {
    const ArrowProgram &p = *p_;
    for (std::size_t k = 0; k < z_.size(); k += OCTET) {
        const Octet y = octet(y_.data() + k), missed = octet(row_residual_.data() + k) - octet(z_.data() + k);
        const Octet wanted = target - (second ? octet(affine_.data() + k) : Octet{});
        octet(shift_.data() + k) = (wanted + y * missed) * octet(inverse_.data() + k);
    }
    dx_ = grad_;
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
        ds_[g] =
            (ds_[g] + mean_weight_[g] * dot(mean_.data() + mean_at(g), local_.data(), p.stride(group))) / damping_[g];
    }
    rows(dx_, dt_, ds_, moved_);
    Octet most_z = {}, most_y = {};
    for (std::size_t k = 0; k < z_.size(); k += OCTET) {
        const Octet moved = octet(moved_.data() + k);
        const Octet dz = -octet(row_residual_.data() + k) - moved,
                    dy = octet(shift_.data() + k) + octet(weight_.data() + k) * moved;
        octet(dz_.data() + k) = dz, octet(dy_.data() + k) = dy;
        const Octet ratio_z = -dz * octet(inverse_.data() + k), ratio_y = -dy / octet(y_.data() + k);
        most_z = larger(most_z, ratio_z);
        most_y = larger(most_y, ratio_y);
    }
    for (std::size_t i = total_; i < z_.size(); ++i) dz_[i] = dy_[i] = 0.0;
    worst_z_ = most(most_z), worst_y_ = most(most_y);
}

bool ArrowQp::step(double least_gap) {
    if (!factor()) return false;
    const double count = static_cast<double>(total_), now = gap_ / count;
    newton(0.0, false);
    const double primal = 1.0 / std::max(worst_z_, 1.0), dual = 1.0 / std::max(worst_y_, 1.0);
    Octet by_z = {}, by_y = {}, by_both = {};
    for (std::size_t k = 0; k < z_.size(); k += OCTET) {
        const Octet dz = octet(dz_.data() + k), dy = octet(dy_.data() + k), both = dz * dy;
        octet(affine_.data() + k) = both;
        by_z += dz * octet(y_.data() + k), by_y += octet(z_.data() + k) * dy, by_both += both;
    }
    const double after = gap_ + primal * total(by_z) + dual * total(by_y) + primal * dual * total(by_both);
    const double ratio = std::max(after, 0.0) / gap_, target = std::max(now * ratio * ratio * ratio, least_gap / count);
    newton(target, true);
    advance(TO_BOUNDARY / std::max(worst_z_, TO_BOUNDARY), TO_BOUNDARY / std::max(worst_y_, TO_BOUNDARY));
    return true;
}

}  // namespace optiplan
