#include "world/parts.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

ConvexPart ConvexPart::hull(const Shape &hull) {
    const std::vector<Vec3> &points = hull.hull->points();
    Vec3 low = points.front(), high = low;
    for (const Vec3 &p : points) {
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3 centre = 0.5 * (low + high);
    double squared = 0.0;
    for (const Vec3 &p : points) squared = std::max(squared, squared_norm(p - centre));
    return {hull, centre, std::sqrt(squared)};
}

bool parts_within(const std::vector<ConvexPart> &a, const Pose &X_WA, const std::vector<ConvexPart> &b,
                  const Pose &X_WB, double margin) {
    for (const ConvexPart &one : a) {
        const Vec3 centre = X_WA * one.centre;
        for (const ConvexPart &two : b) {
            const double reach = one.radius + two.radius + margin;
            if (squared_norm(X_WB * two.centre - centre) > reach * reach) continue;
            if (overlap_within(one.shape, X_WA, two.shape, X_WB, margin)) return true;
        }
    }
    return a.empty() || b.empty();
}

}  // namespace optiplan
