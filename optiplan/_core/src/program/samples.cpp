#include "program/samples.hpp"

#include <algorithm>
#include <stdexcept>

namespace optiplan {

Samples Samples::of(const double *u, std::size_t count, const double *const matrices[3], std::size_t points) {
    Samples samples;
    samples.u.assign(u, u + count);
    samples.first.resize(count), samples.weights.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        std::size_t first = points, last = 0;
        for (int order = 0; order < 3; ++order)
            for (std::size_t k = 0; k < points; ++k)
                if (matrices[order][i * points + k] != 0.0) first = std::min(first, k), last = std::max(last, k);
        first = std::min(first, points - std::min(points, REACH));
        if (last >= first + REACH) throw std::invalid_argument("a sample depends on too many control points");
        samples.first[i] = first;
        for (int order = 0; order < 3; ++order)
            for (std::size_t k = 0; k < REACH; ++k)
                samples.weights[i][order][k] = first + k < points ? matrices[order][i * points + first + k] : 0.0;
    }
    return samples;
}

Stencil Samples::stencil(std::size_t sample, int order, std::size_t points) const {
    return {first[sample], std::min(REACH, points - first[sample]), weights[sample][order]};
}

void Samples::at(std::size_t sample, int order, const double *control, const Spline &spline, double *out) const {
    std::fill_n(out, spline.joints, 0.0);
    const Stencil here = stencil(sample, order, spline.points);
    for (std::size_t k = 0; k < here.count; ++k)
        add_scaled(out, here.weights[k], control + (here.first + k) * spline.joints, spline.joints);
}

}  // namespace optiplan
