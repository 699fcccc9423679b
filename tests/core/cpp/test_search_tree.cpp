#include "search/search_tree.hpp"

#include "check.hpp"

namespace optiplan::test_search_tree {

TEST(the_nearest_node_is_that_of_a_comparison_with_all) {
    SearchTree tree(3);
    for (int k = 0; k < 2000; ++k) {
        const double x[3] = {uniform(-1, 1), uniform(-1, 1), k % 5 ? uniform(-1, 1) : 0.0};
        CHECK(tree.add(x, k - 1) == k);
        CHECK(tree.parent(k) == k - 1);
        const double y[3] = {uniform(-1.2, 1.2), uniform(-1.2, 1.2), uniform(-1.2, 1.2)};
        const auto squared = [&](int node) {
            double sum = 0.0;
            for (int j = 0; j < 3; ++j) sum += (tree.at(node)[j] - y[j]) * (tree.at(node)[j] - y[j]);
            return sum;
        };
        double least = HUGE_VAL;
        for (int node = 0; node <= k; ++node) least = std::fmin(least, squared(node));
        CHECK(squared(tree.nearest(y)) == least);
    }
}

TEST(a_point_many_times_is_kept) {
    SearchTree tree(2);
    const double x[2] = {0.5, 0.5};
    for (int k = 0; k < 100; ++k) tree.add(x, -1);
    CHECK(tree.size() == 100);
    CHECK(tree.nearest(x) >= 0);
}

}  // namespace optiplan::test_search_tree
