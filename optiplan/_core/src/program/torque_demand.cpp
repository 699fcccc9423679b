#include "program/torque_demand.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace optiplan {

namespace {

constexpr double INF = std::numeric_limits<double>::infinity();

// Position, velocity and acceleration (3, n) of a piece at `local` s after its beginning.
void state(const Curve &curve, std::size_t piece, double local, double *out) {
    const std::size_t n = static_cast<std::size_t>(curve.joints), degree = static_cast<std::size_t>(curve.degree);
    const double *c = curve.coefficients.data() + piece * (degree + 1) * n;
    std::fill_n(out, 3 * n, 0.0);
    for (std::size_t k = degree + 1; k-- > 0;)
        for (std::size_t j = 0; j < n; ++j) {
            out[2 * n + j] = out[2 * n + j] * local + 2.0 * out[n + j];
            out[n + j] = out[n + j] * local + out[j];
            out[j] = out[j] * local + c[k * n + j];
        }
}

}  // namespace

std::vector<double> torque_demand(InverseDynamics &dynamics, const Curve &curve, const std::vector<double> &allowed,
                                  const double *times, std::size_t count) {
    const std::size_t n = dynamics.joints();
    std::vector<double> found(count, 0.0), motion(3 * n), tau(n), gravity(n);
    std::size_t piece = 0;
    for (std::size_t i = 0; i < count; ++i) {
        while (piece + 2 < curve.breakpoints.size() && curve.breakpoints[piece + 1] <= times[i]) ++piece;
        state(curve, piece, times[i] - curve.breakpoints[piece], motion.data());
        dynamics.torques(motion.data(), motion.data() + n, motion.data() + 2 * n, tau.data());
        dynamics.at_rest(gravity.data());
        for (std::size_t j = 0; j < n; ++j) {
            if (std::fabs(gravity[j]) > allowed[j]) return std::vector<double>(count, INF);
            const double moving = tau[j] - gravity[j];
            if (moving == 0.0 || !std::isfinite(allowed[j])) continue;
            found[i] = std::max(found[i],
                                std::fabs(moving) / (moving > 0.0 ? allowed[j] - gravity[j] : allowed[j] + gravity[j]));
        }
    }
    return found;
}

}  // namespace optiplan
