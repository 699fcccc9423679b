#include "program/spline.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace optiplan {

Stencil stencil_of(const double *row, std::size_t count) {
    std::size_t begin = 0, end = count;
    while (begin < end && row[begin] == 0.0) ++begin;
    while (end > begin && row[end - 1] == 0.0) --end;
    if (end - begin > REACH) throw std::invalid_argument("a row of the spline reaches over too many control points");
    Stencil found;
    found.first = begin == count ? 0 : begin;
    found.count = end - begin;
    std::copy(row + begin, row + end, found.weights.begin());
    return found;
}

Stencil free_part(const Stencil &stencil, std::size_t fixed, std::size_t free, bool open_end) {
    if (open_end) {  // those beyond the last variable move with it
        const std::size_t last = fixed + free - 1;
        Stencil joined;
        joined.first = std::min(stencil.first, last);
        for (std::size_t k = 0; k < stencil.count; ++k) {
            const std::size_t at = std::min(stencil.first + k, last) - joined.first;
            joined.weights[at] += stencil.weights[k];
            joined.count = std::max(joined.count, at + 1);
        }
        return free_part(joined, fixed, free);
    }
    const std::size_t begin = std::clamp(stencil.first, fixed, fixed + free);
    const std::size_t end = std::clamp(stencil.first + stencil.count, fixed, fixed + free);
    Stencil found;
    if (end <= begin) return found;
    found.first = begin - fixed, found.count = end - begin;
    for (std::size_t k = begin; k < end; ++k) found.weights[k - begin] = stencil.weights[k - stencil.first];
    return found;
}

void Spline::derivative(std::size_t row, const double *control, double *out) const {
    const Stencil &stencil = derivatives[row];
    std::fill_n(out, joints, 0.0);
    for (std::size_t k = 0; k < stencil.count; ++k)
        add_scaled(out, stencil.weights[k], control + (stencil.first + k) * joints, joints);
}

double Spline::shortest_duration(const double *control) const {
    double worst[3] = {0.0, 0.0, 0.0};
    Vec here(joints);
    for (std::size_t row = 0; row < derivatives.size(); ++row) {
        derivative(row, control, here.data());
        const double *most = limit(row);
        double &of_order = worst[order[row] - 1];
        for (std::size_t j = 0; j < joints; ++j) of_order = std::max(of_order, std::fabs(here[j]) / most[j]);
    }
    return std::max({worst[0], std::sqrt(worst[1]), std::cbrt(worst[2])});
}

double Spline::jerk_cost(const double *control, double duration) const {
    if (jerk == 0.0) return 0.0;
    double sum = 0.0;
    for (std::size_t i = 0; i < points; ++i)
        for (std::size_t k = 0; k < points; ++k)
            if (gram[i * points + k] != 0.0)
                sum += gram[i * points + k] * dot(control + i * joints, control + k * joints, joints);
    return jerk * std::pow(duration, -5) * sum;
}

}  // namespace optiplan
