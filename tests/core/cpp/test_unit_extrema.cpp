#include "program/unit_extrema.hpp"

#include <algorithm>
#include <vector>

#include "check.hpp"

namespace optiplan::test_unit_extrema {

namespace {

double value(const double *c, int size, double x) {
    double sum = 0.0;
    for (int k = size - 1; k >= 0; --k) sum = sum * x + c[k];
    return sum;
}

}  // namespace

TEST(extrema_of_many_pieces_bound_samples_and_are_values) {
    constexpr std::size_t pieces = 7, columns = 3;
    for (int size = 1; size <= MOST_UNIT_COEFFICIENTS; ++size)
        for (int round = 0; round < 20; ++round) {
            std::vector<double> c(pieces * columns * size);
            for (double &x : c) x = uniform(-1.0, 1.0);
            for (std::size_t j = 0; j < columns; ++j) {
                const UnitExtrema e = unit_extrema(c.data() + j * size, pieces, columns * size, size);
                double least = 1e9, most = -1e9;
                for (std::size_t i = 0; i < pieces; ++i)
                    for (int k = 0; k <= 200; ++k) {
                        const double here = value(c.data() + (i * columns + j) * size, size, k / 200.0);
                        least = std::min(least, here), most = std::max(most, here);
                    }
                CHECK(e.low <= least + 1e-12 && e.low >= least - 0.1);
                CHECK(e.high >= most - 1e-12 && e.high <= most + 0.1);
                NEAR(value(c.data() + (e.piece_low * columns + j) * size, size, e.x_low), e.low, 1e-12);
                NEAR(value(c.data() + (e.piece_high * columns + j) * size, size, e.x_high), e.high, 1e-12);
            }
        }
}

TEST(an_extremum_inside_is_found_where_it_is) {
    const double c[] = {1.0, -0.6, 0.0, 0.8};  // slope -0.6 + 2.4 x²
    const UnitExtrema e = unit_extrema(c, 1, 4, 4);
    NEAR(e.x_low, 0.5, 1e-15);
    NEAR(e.low, 0.8, 1e-15);
    CHECK(e.x_high == 1.0 && e.piece_high == 0);
}

TEST(what_is_constant_or_zero_has_its_value) {
    const double zero[5] = {}, line[] = {2.0, -1.0};
    const UnitExtrema nothing = unit_extrema(zero, 1, 5, 5), falling = unit_extrema(line, 1, 2, 2);
    CHECK(nothing.low == 0.0 && nothing.high == 0.0 && nothing.x_low == 0.0);
    CHECK(falling.low == 1.0 && falling.x_low == 1.0 && falling.high == 2.0 && falling.x_high == 0.0);
}

}  // namespace optiplan::test_unit_extrema
