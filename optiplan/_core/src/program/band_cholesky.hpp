// Cholesky factor of a symmetric banded matrix with one dense border row and column (an arrow).
#pragma once

#include <algorithm>
#include <cmath>

#include "program/sums.hpp"

namespace optiplan {

// [ K  k ]
// [ k' d ]  with K (size, size), kept as tiles of OCTET x OCTET: tile(c, d) holds columns c OCTET, … of K from row
// (c + d) OCTET on, for d < `reach`, one column after another. What lies beyond is zero. Tiles on the diagonal are
// whole.
class BandArrow {
  public:
    Vec border;
    double corner = 0.0;

    // `size`: a multiple of OCTET.
    void resize(std::size_t size, std::size_t reach) {
        count_ = size / OCTET, reach_ = reach;
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
    static constexpr std::size_t TILE = OCTET * OCTET;

    const double *tile(std::size_t c, std::size_t d) const { return tiles_.data() + (c * reach_ + d) * TILE; }

    // Columns of the factor in the tiles at and below a diagonal one, of which only what is below the diagonal stays.
    bool divide(std::size_t c, std::size_t below) {
        for (std::size_t a = 0; a < OCTET; ++a) {
            double *column = tile(c, 0) + a * OCTET;
            if (!(column[a] > 0.0)) return false;
            const double inverse = inverse_[c * OCTET + a] = 1.0 / std::sqrt(column[a]);
            for (std::size_t d = 0; d < below; ++d) octet(column + d * TILE) *= inverse;
            for (std::size_t b = a + 1; b < OCTET; ++b)
                for (std::size_t d = 0; d < below; ++d)
                    octet(column + d * TILE + (b - a) * OCTET) -= column[b] * octet(column + d * TILE);
            std::fill_n(column, a + 1, 0.0);
        }
        return true;
    }

    // target -= left right', where all three are kept column by column.
    static void subtract(const double *left, const double *right, double *target) {
        for (std::size_t from = 0; from < OCTET; from += NATIVE) {  // as many columns as there are registers for
            Octet sum[NATIVE];
            for (std::size_t b = 0; b < NATIVE; ++b) sum[b] = octet(target + (from + b) * OCTET);
            for (std::size_t a = 0; a < OCTET; ++a)
                for (std::size_t b = 0; b < NATIVE; ++b)
                    sum[b] -= left[a * OCTET + from + b] * octet(right + a * OCTET);
            for (std::size_t b = 0; b < NATIVE; ++b) octet(target + (from + b) * OCTET) = sum[b];
        }
    }

    void forward(double *x) const {
        for (std::size_t c = 0; c < count_; ++c) {
            double *here = x + c * OCTET;
            for (std::size_t a = 0; a < OCTET; ++a) {
                here[a] *= inverse_[c * OCTET + a];
                octet(here) -= here[a] * octet(tile(c, 0) + a * OCTET);
            }
            for (std::size_t d = 1; d < std::min(reach_, count_ - c); ++d) {
                Octet sum = octet(here + d * OCTET);
                for (std::size_t a = 0; a < OCTET; ++a) sum -= here[a] * octet(tile(c, d) + a * OCTET);
                octet(here + d * OCTET) = sum;
            }
        }
    }

    void backward(double *x) const {
        for (std::size_t c = count_; c-- > 0;) {
            double *here = x + c * OCTET;
            for (std::size_t a = OCTET; a-- > 0;) {
                Octet sum = {};
                for (std::size_t d = 1; d < std::min(reach_, count_ - c); ++d)
                    sum += octet(tile(c, d) + a * OCTET) * octet(here + d * OCTET);
                sum += octet(tile(c, 0) + a * OCTET) * octet(here);  // last: what it waits for was just found
                here[a] = (here[a] - total(sum)) * inverse_[c * OCTET + a];
            }
        }
    }

    std::size_t count_ = 0, reach_ = 0;  // tiles on the diagonal, and in a column
    Vec tiles_, solved_, inverse_;
    double pivot_ = 0.0;
};

}  // namespace optiplan
