#include "convex/hull.hpp"

#include <thread>

#include "check.hpp"

namespace optiplan::test_hull {

TEST(supports_are_the_farthest_of_all_points_which_lie_within) {
    std::vector<Vec3> points;
    for (int k = 0; k < 200; ++k) points.push_back({uniform(-1, 1), uniform(-0.5, 0.5), uniform(0.0, 0.3)});
    const Hull hull(points);
    for (int k = 0; k < 500; ++k) {
        const Vec3 d{uniform(-1, 1), uniform(-1, 1), k % 3 ? uniform(-1, 1) : 0.0};
        const double found = dot(hull.support(d), d);
        double most = -HUGE_VAL;
        for (const Vec3 &p : points) most = std::fmax(most, dot(p, d));
        CHECK(found == most);
    }
    for (const Vec3 &p : points) {
        const Vec3 off = p - hull.centre();
        CHECK(norm(off) <= hull.radius() + 1e-12);
        for (int axis = 0; axis < 3; ++axis) CHECK(std::fabs(off[axis]) <= hull.half()[axis] + 1e-12);
    }
}

TEST(threads_that_ask_at_once_get_the_same_answers) {
    std::vector<Vec3> points;
    for (int k = 0; k < 150; ++k) points.push_back({uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)});
    std::vector<Vec3> directions;
    for (int k = 0; k < 4000; ++k) directions.push_back({uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)});
    const Hull shared(points), own(points);
    std::vector<std::vector<double>> found(3, std::vector<double>(directions.size()));
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < found.size(); ++t)
        threads.emplace_back([&, t] {
            for (std::size_t k = 0; k < directions.size(); ++k) {
                const std::size_t at = t % 2 ? directions.size() - 1 - k : k;
                found[t][at] = dot(shared.support(directions[at]), directions[at]);
            }
        });
    for (std::thread &thread : threads) thread.join();
    for (std::size_t k = 0; k < directions.size(); ++k)
        for (const std::vector<double> &of : found) CHECK(of[k] == dot(own.support(directions[k]), directions[k]));
}

}  // namespace optiplan::test_hull
