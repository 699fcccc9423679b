// Cholesky factor of a symmetric banded matrix with one dense border row and column (an arrow).
#pragma once

#include <algorithm>
#include <cmath>

#include "program/sums.hpp"

namespace optiplan {

// [ K  k ]
// [ k' d ]  with K (size, size) of half bandwidth `band` - 1.
// Column c of the lower half of K is entry(c, 0), entry(c, 1), …: the diagonal and what is below it.
class BandArrow {
public:
    Vec border;
    double corner = 0.0;

    void resize(std::size_t size, std::size_t band) {
        size_ = size, band_ = band, lead_ = padded(band) + LANES;
        columns_.assign((size + band + LANES) * lead_, 0.0);
        border.assign(size + band, 0.0);  // rows near the end may reach beyond it, with zeros
        solved_.assign(size, 0.0);
        inverse_.assign(size, 0.0);
        corner = 0.0;
    }

    void clear() {
        std::fill(columns_.begin(), columns_.end(), 0.0);
        std::fill(border.begin(), border.end(), 0.0);
        corner = 0.0;
    }

    double *column(std::size_t c) { return columns_.data() + c * lead_; }

    // Factor in place; false where the matrix is not positive definite.
    bool factor() {
        for (std::size_t c = 0; c < size_; ++c) {
            double *here = column(c);
            if (!(here[0] > 0.0)) return false;
            const std::size_t count = std::min(band_, size_ - c);
            const double inverse = 1.0 / std::sqrt(here[0]);
            inverse_[c] = inverse;
            for (std::size_t k = 0; k < count; ++k) here[k] *= inverse;
            for (std::size_t k = 1; k < count; ++k) {
                const double factor = here[k];
                if (factor == 0.0) continue;
                double *__restrict below = column(c + k);
                const double *__restrict from = here + k;
                // Columns are zero beyond the band: whole vectors may be taken.
                for (std::size_t i = 0; i < count - k; i += LANES)
                    for (std::size_t lane = 0; lane < LANES; ++lane) below[i + lane] -= factor * from[i + lane];
            }
        }
        std::copy_n(border.begin(), size_, solved_.begin());
        forward(solved_.data());
        pivot_ = corner - dot(solved_.data(), solved_.data(), size_);
        return pivot_ > 0.0;
    }

    // Solve with the right side (x (size,), last) in place.
    void solve(double *x, double &last) const {
        forward(x);
        last = (last - dot(solved_.data(), x, size_)) / pivot_;
        for (std::size_t c = 0; c < size_; ++c) x[c] -= solved_[c] * last;
        for (std::size_t c = size_; c-- > 0;) {
            const double *here = columns_.data() + c * lead_;
            const std::size_t count = std::min(band_, size_ - c);
            x[c] = (x[c] - dot(here + 1, x + c + 1, count - 1)) * inverse_[c];
        }
    }

private:
    void forward(double *x) const {
        for (std::size_t c = 0; c < size_; ++c) {
            const double *here = columns_.data() + c * lead_;
            x[c] *= inverse_[c];
            add_scaled(x + c + 1, -x[c], here + 1, std::min(band_, size_ - c) - 1);
        }
    }

    std::size_t size_ = 0, band_ = 0, lead_ = 0;
    Vec columns_, solved_, inverse_;
    double pivot_ = 0.0;
};

}  // namespace optiplan
