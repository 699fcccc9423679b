#include "search/shortcuts.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double TWO_NORM_SHARE = 0.1, WORTH = 1e-3, ROUNDING = 1e-9;

double path_time(const Configuration &a, const Configuration &b, const Configuration &velocity) {
    double most = 0.0, squared = 0.0;
    for (std::size_t j = 0; j < a.size(); ++j) {
        const double x = std::fabs(b[j] - a[j]) / velocity[j];
        most = std::max(most, x);
        squared += x * x;
    }
    return most + TWO_NORM_SHARE * std::sqrt(squared);
}

static double path_time(const Path &path, const Configuration &velocity) {
    double total = 0.0;
    for (std::size_t k = 0; k + 1 < path.size(); ++k) total += path_time(path[k], path[k + 1], velocity);
    return total;
}

// The point at `s` along the path, of which `along` are the waypoints' places.
static Configuration point_at(const Path &path, const std::vector<double> &along, double s) {
    std::size_t k = std::upper_bound(along.begin(), along.end(), s) - along.begin();
    k = std::clamp<std::size_t>(k, 1, path.size() - 1) - 1;
    const double length = along[k + 1] - along[k];
    const double share = length > 0.0 ? std::clamp((s - along[k]) / length, 0.0, 1.0) : 0.0;
    Configuration q(path[k]);
    for (std::size_t j = 0; j < q.size(); ++j) q[j] += share * (path[k + 1][j] - q[j]);
    return q;
}

static bool polyline_free(EdgeChecker &check, const Path &path) {
    for (std::size_t k = 0; k + 1 < path.size(); ++k)
        if (!check.free(path[k].data(), path[k + 1].data())) return false;
    return true;
}

void attempt_shortcut(EdgeChecker &check, Path &path, const Configuration &velocity, const double *draw) {
    std::vector<double> along{0.0};
    for (std::size_t k = 0; k + 1 < path.size(); ++k)
        along.push_back(along.back() + path_time(path[k], path[k + 1], velocity));
    const double first = std::min(draw[0], draw[1]) * along.back(), last = std::max(draw[0], draw[1]) * along.back();
    const int joint = static_cast<int>(std::floor((2.0 * draw[2] - 1.0) * static_cast<double>(velocity.size())));
    Path before, old{point_at(path, along, first)}, after;
    std::vector<double> places{first};
    for (std::size_t k = 0; k < path.size(); ++k) {
        if (along[k] <= first)
            before.push_back(path[k]);
        else if (along[k] >= last)
            after.push_back(path[k]);
        else
            old.push_back(path[k]), places.push_back(along[k]);
    }
    if (old.size() == 1) return;
    old.push_back(point_at(path, along, last)), places.push_back(last);
    Path straight;
    if (joint < 0) {
        straight = {old.front(), old.back()};
    } else {
        straight = old;
        const double from = old.front()[joint], by = old.back()[joint] - from;
        for (std::size_t k = 1; k + 1 < old.size(); ++k)
            straight[k][joint] = from + by * ((places[k] - first) / (last - first));
    }
    if (path_time(straight, velocity) > path_time(old, velocity) * (1.0 - WORTH) || !polyline_free(check, straight))
        return;
    path = std::move(before);
    path.insert(path.end(), straight.begin(), straight.end());
    path.insert(path.end(), after.begin(), after.end());
}

void drop_corners(EdgeChecker &check, Path &path, const Configuration &velocity, const Stop &stop) {
    for (std::size_t k = 1; k + 1 < path.size() && !stop();) {
        const double old = path_time(path[k - 1], path[k], velocity) + path_time(path[k], path[k + 1], velocity);
        const double straight = path_time(path[k - 1], path[k + 1], velocity);
        if (straight <= old * (1.0 + ROUNDING) && check.free(path[k - 1].data(), path[k + 1].data())) {
            path.erase(path.begin() + static_cast<std::ptrdiff_t>(k));
            k = std::max<std::size_t>(1, k - 1);
        } else {
            ++k;
        }
    }
}

}  // namespace optiplan
