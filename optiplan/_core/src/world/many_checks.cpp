#include "world/many_checks.hpp"

#include <algorithm>

namespace optiplan {

static constexpr double HAIR = 1e-12;  // m; how much more a ball is than its radius, for rounding

ManyChecks::ManyChecks(const World &world) : world_(world), at_(world.placement()) {
    const std::vector<Body> &bodies = world.bodies();
    std::vector<char> used(bodies.size());
    const auto compare = [&](int a, int b, int asked) {
        const double reach = bodies[a].radius + bodies[b].radius + HAIR;
        balls_.push_back({a, b, reach * reach, asked});
        used[a] = used[b] = 1;
    };
    for (int pair : world.alone()) {
        const auto [a, b, by_outline] = world.pairs()[pair];
        const int plane = bodies[a].half_space ? a : b, body = plane == a ? b : a;
        if (!bodies[plane].half_space || bodies[body].half_space || bodies[plane].joint != 0) {
            compare(a, b, pair);
            continue;
        }
        const Pose &X = at_.bodies[plane];
        const Vec3 normal = X.R * bodies[plane].normal;
        planes_.push_back(
            {body, pair, normal, dot(normal, X.p) + bodies[plane].offset + bodies[body].radius + HAIR});
        used[body] = 1;
    }
    for (std::size_t k = 0; k < world.groups().size(); ++k)
        compare(world.groups()[k].hull, world.groups()[k].other, ~static_cast<int>(k));
    joints_.resize(world.tree().joints.size());
    centres_.resize(bodies.size());
    for (std::size_t k = 0; k < bodies.size(); ++k) {
        if (bodies[k].joint == 0) centres_[k] = lanes_of(at_.centres[k]);
        if (bodies[k].joint != 0 && used[k]) moving_.push_back(static_cast<int>(k));
    }
    near_.resize((balls_.size() + planes_.size() + 63) / 64);
}

void ManyChecks::touching(const double *Q, std::size_t count, std::uint8_t *out) {
    const std::size_t n = world_.tree().planned;
    std::vector<double> last(LANES * n);
    for (std::size_t row = 0; row < count; row += LANES) {
        const std::size_t lanes = std::min<std::size_t>(LANES, count - row);
        const double *q = Q + row * n;
        if (lanes < LANES) {
            for (std::size_t k = 0; k < last.size(); ++k) last[k] = q[std::min(k / n, lanes - 1) * n + k % n];
            q = last.data();
        }
        poses_in_lanes(world_.tree(), q, joints_.data());
        for (int body : moving_) {
            const Body &of = world_.bodies()[body];
            centres_[body] = moved(joints_[of.joint], of.X_JB * of.centre);
        }
        std::size_t bit = 0;
        std::fill(near_.begin(), near_.end(), LaneBits{});
        const auto mark = [&](const LaneBits &near) {
            near_[bit / 64] |= near & (LaneBits{} + static_cast<std::int64_t>(std::uint64_t{1} << (bit % 64)));
            ++bit;
        };
        for (const Balls &pair : balls_) {
            const Vec3Lanes &a = centres_[pair.a], &b = centres_[pair.b];
            const Lanes x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
            mark(!(x * x + y * y + z * z > pair.squared));
        }
        for (const Plane &plane : planes_) {
            const Vec3Lanes &c = centres_[plane.body];
            mark(!(c.x * plane.normal.x + c.y * plane.normal.y + c.z * plane.normal.z > plane.offset));
        }
        for (std::size_t lane = 0; lane < lanes; ++lane) out[row + lane] = touches(static_cast<int>(lane));
    }
}

bool ManyChecks::touches(int lane) {
    if (std::all_of(near_.begin(), near_.end(), [&](const LaneBits &bits) { return bits[lane] == 0; })) return false;
    for (std::size_t j = 0; j < joints_.size(); ++j) at_.joints[j] = lane_of(joints_[j], lane);
    world_.forget(at_);
    order_.clear();
    for (std::size_t word = 0; word < near_.size(); ++word)
        for (std::uint64_t bits = static_cast<std::uint64_t>(near_[word][lane]); bits; bits &= bits - 1) {
            const std::size_t bit = 64 * word + static_cast<std::size_t>(__builtin_ctzll(bits));
            const int asked = bit < balls_.size() ? balls_[bit].asked : planes_[bit - balls_.size()].pair;
            if (asked >= 0) {
                world_.put(at_, asked);
                const double bound = world_.lower_bound(at_, asked);
                if (!(bound > 0.0)) order_.push_back({bound, asked});
                continue;
            }
            const Together &group = world_.groups()[~asked];
            world_.put(at_, group);
            if (world_.group_apart(at_, ~asked, 0.0)) continue;
            world_.visit_near(at_, group, 0.0, [&](int pair) {
                world_.put(at_, pair);
                const double bound = world_.lower_bound(at_, pair);
                if (!(bound > 0.0)) order_.push_back({bound, pair});
            });
        }
    std::sort(order_.begin(), order_.end());
    return std::any_of(order_.begin(), order_.end(),
                       [&](const auto &asked) { return world_.within(at_, asked.second, 0.0); });
}

}  // namespace optiplan
