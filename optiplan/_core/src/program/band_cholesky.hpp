// Cholesky factor of a symmetric banded matrix with one dense border row and column (an arrow).
#pragma once

#include <algorithm>
#include <cmath>

#include "program/sums.hpp"

namespace optiplan {

// [ K  k ]
// [ k' d ]  with K (size, size), kept as tiles of LANES x LANES: tile(c, d) holds columns c LANES, … of K from row
// (c + d) LANES on, for d < `reach`, one column after another. What lies beyond is zero. Tiles on the diagonal are
// whole.
class BandArrow {
  public:
    Vec border;
    double corner = 0.0;

    // `size`: a multiple of LANES.
    void resize(std::size_t size, std::size_t reach) {
        count_ = size / LANES, reach_ = reach;
        tiles_.assign(count_ * reach * TILE, 0.0);
        border.assign(size, 0.0);
        solved_.assign(size, 0.0);
        inverse_.assign(size, 0.0);
        corner = 0.0;
    }

    void clear() {
        std::fill(tiles_.begin(), tiles_.end(), 0.0);
        std::fill(border.begin(), border.end(), 0.0);
        corner = 0.0;
    }

    double *tile(std::size_t c, std::size_t d) { return tiles_.data() + (c * reach_ + d) * TILE; }

    // Factor in place; false where the matrix is not positive definite.
    bool factor() {
        for (std::size_t c = 0; c < count_; ++c) {
            const std::size_t below = std::min(reach_, count_ - c);
            if (!divide(c, below)) return false;
            for (std::size_t i = 1; i < below; ++i)
                for (std::size_t j = i; j < below; ++j) subtract(tile(c, i), tile(c, j), tile(c + i, j - i));
        }
        std::copy(border.begin(), border.end(), solved_.begin());
        forward(solved_.data());
        pivot_ = corner - dot(solved_.data(), solved_.data(), solved_.size());
        return pivot_ > 0.0;
    }

    // Solve with the right side (x (size,), last) in place.
    void solve(double *x, double &last) const {
        forward(x);
        last = (last - dot(solved_.data(), x, solved_.size())) / pivot_;
        add_vectors(x, -last, solved_.data(), solved_.size());
        backward(x);
    }

  private:
    static constexpr std::size_t TILE = LANES * LANES;

    const double *tile(std::size_t c, std::size_t d) const { return tiles_.data() + (c * reach_ + d) * TILE; }

    // Columns of the factor in the tiles at and below a diagonal one, of which only what is below the diagonal stays.
    bool divide(std::size_t c, std::size_t below) {
        for (std::size_t a = 0; a < LANES; ++a) {
            double *column = tile(c, 0) + a * LANES;
            if (!(column[a] > 0.0)) return false;
            const double inverse = inverse_[c * LANES + a] = 1.0 / std::sqrt(column[a]);
            for (std::size_t d = 0; d < below; ++d) lanes(column + d * TILE) *= inverse;
            for (std::size_t b = a + 1; b < LANES; ++b)
                for (std::size_t d = 0; d < below; ++d)
                    lanes(column + d * TILE + (b - a) * LANES) -= column[b] * lanes(column + d * TILE);
            std::fill_n(column, a + 1, 0.0);
        }
        return true;
    }

    // target -= left right', where all three are kept column by column.
    static void subtract(const double *left, const double *right, double *target) {
        for (std::size_t from = 0; from < LANES; from += NATIVE) {  // as many columns as there are registers for
            Lanes sum[NATIVE];
            for (std::size_t b = 0; b < NATIVE; ++b) sum[b] = lanes(target + (from + b) * LANES);
            for (std::size_t a = 0; a < LANES; ++a)
                for (std::size_t b = 0; b < NATIVE; ++b)
                    sum[b] -= left[a * LANES + from + b] * lanes(right + a * LANES);
            for (std::size_t b = 0; b < NATIVE; ++b) lanes(target + (from + b) * LANES) = sum[b];
        }
    }

    void forward(double *x) const {
        for (std::size_t c = 0; c < count_; ++c) {
            double *here = x + c * LANES;
            for (std::size_t a = 0; a < LANES; ++a) {
                here[a] *= inverse_[c * LANES + a];
                lanes(here) -= here[a] * lanes(tile(c, 0) + a * LANES);
            }
            for (std::size_t d = 1; d < std::min(reach_, count_ - c); ++d) {
                Lanes sum = lanes(here + d * LANES);
                for (std::size_t a = 0; a < LANES; ++a) sum -= here[a] * lanes(tile(c, d) + a * LANES);
                lanes(here + d * LANES) = sum;
            }
        }
    }

    void backward(double *x) const {
        for (std::size_t c = count_; c-- > 0;) {
            double *here = x + c * LANES;
            for (std::size_t a = LANES; a-- > 0;) {
                Lanes sum = {};
                for (std::size_t d = 1; d < std::min(reach_, count_ - c); ++d)
                    sum += lanes(tile(c, d) + a * LANES) * lanes(here + d * LANES);
                sum += lanes(tile(c, 0) + a * LANES) * lanes(here);  // last: what it waits for was just found
                here[a] = (here[a] - total(sum)) * inverse_[c * LANES + a];
            }
        }
    }

    std::size_t count_ = 0, reach_ = 0;  // tiles on the diagonal, and in a column
    Vec tiles_, solved_, inverse_;
    double pivot_ = 0.0;
};

}  // namespace optiplan
