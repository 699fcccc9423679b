#include "world/many_checks.hpp"

#include <algorithm>

namespace optiplan {

static constexpr double HAIR = 1e-12;  // m; how much more a ball is than its radius, for rounding

static std::uint64_t any(const LaneBits &bits) {
    return static_cast<std::uint64_t>(bits[0] | bits[1] | bits[2] | bits[3]);
}

static LaneBits bit_of(std::size_t k) { return LaneBits{} + static_cast<std::int64_t>(std::uint64_t{1} << (k % 64)); }

ManyChecks::ManyChecks(const World &world) : world_(world), at_(world.placement()), trail_(world.trail()) {
    const std::vector<Body> &bodies = world.bodies();
    std::vector<char> used(bodies.size());
    const auto compare = [&](int a, int b, int asked) {
        const double reach = bodies[a].radius + bodies[b].radius + HAIR;
        const bool planes = bodies[a].half_space || bodies[b].half_space;  // have no boxes
        const auto ball = [&](int k) {
            return planes ? HUGE_VAL : (bodies[k].radius + HAIR) * (bodies[k].radius + HAIR);
        };
        balls_.push_back({a, b, reach * reach, ball(a), ball(b), asked});
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
        planes_.push_back({body, pair, normal, dot(normal, X.p) + bodies[plane].offset + bodies[body].radius + HAIR});
        used[body] = 1;
    }
    for (std::size_t k = 0; k < world.groups().size(); ++k)
        compare(world.groups()[k].hull, world.groups()[k].other, ~static_cast<int>(k));
    const auto stands = [&](const Balls &pair) { return bodies[pair.a].joint == 0 || bodies[pair.b].joint == 0; };
    std::stable_partition(balls_.begin(), balls_.end(), stands);
    joints_.resize(world.tree().joints.size());
    bodies_.resize(bodies.size());
    turned_.resize(bodies.size());
    centres_.resize(bodies.size());
    for (std::size_t k = 0; k < bodies.size(); ++k) {
        if (bodies[k].joint == 0) {
            centres_[k] = lanes_of(at_.centres[k]);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) bodies_[k].R[i][j] = lanes_of(at_.bodies[k].R.rows[i][j]);
            turned_[k] = 1;
        }
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
        compare_balls(q);
        for (std::size_t lane = 0; lane < lanes; ++lane) out[row + lane] = touches(static_cast<int>(lane));
    }
}

bool ManyChecks::any_touches(const double *Q) {
    compare_balls(Q);
    for (int lane = LANES; lane-- > 0;)
        if (touches(lane)) return true;
    return false;
}

void ManyChecks::joints(int lane, Pose *out) const {
    for (std::size_t j = 0; j < joints_.size(); ++j) out[j] = lane_of(joints_[j], lane);
}

// Sets `near_` at four configurations (4, n).
void ManyChecks::compare_balls(const double *q) {
    poses_in_lanes(world_.tree(), q, joints_.data());
    for (int body : moving_) {
        turned_[body] = 0;
        const Body &of = world_.bodies()[body];
        centres_[body] = moved(joints_[of.joint], of.X_JB * of.centre);
    }
    std::fill(near_.begin(), near_.end(), LaneBits{});
    for (std::size_t k = 0; k < balls_.size();) {
        LaneBits near{}, own = LaneBits{} + 1;
        const std::size_t word = k / 64, end = std::min(balls_.size(), k + 64);
        for (; k < end; ++k, own += own) {
            const Balls &pair = balls_[k];
            const Vec3Lanes &a = centres_[pair.a], &b = centres_[pair.b];
            const Lanes x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
            near |= own & ~(x * x + y * y + z * z > pair.squared);
        }
        near_[word] = near;
    }
    for (std::size_t word = 0; word < near_.size(); ++word) {
        LaneBits &near = near_[word];
        for (std::uint64_t bits = any(near); bits; bits &= bits - 1) {
            const Balls &pair = balls_[64 * word + static_cast<std::size_t>(__builtin_ctzll(bits))];
            const LaneBits own = bit_of(static_cast<std::size_t>(__builtin_ctzll(bits)));
            near &= ~(own & apart_from_box(pair.a, pair.ball_a, pair.b));
            if (any(near & own)) near &= ~(own & apart_from_box(pair.b, pair.ball_b, pair.a));
        }
    }
    for (std::size_t k = 0; k < planes_.size(); ++k) {
        const Plane &plane = planes_[k];
        const Vec3Lanes &c = centres_[plane.body];
        const LaneBits apart = c.x * plane.normal.x + c.y * plane.normal.y + c.z * plane.normal.z > plane.offset;
        const std::size_t bit = balls_.size() + k;
        near_[bit / 64] |= ~apart & bit_of(bit);
    }
}

// The turn of a body's frame, which its box is along.
const PoseLanes &ManyChecks::turned(int body) {
    if (!turned_[body]) {
        const Body &of = world_.bodies()[body];
        bodies_[body] = moved(joints_[of.joint], of.X_JB);
        turned_[body] = 1;
    }
    return bodies_[body];
}

LaneBits ManyChecks::apart_from_box(int ball, double squared, int box) {
    const PoseLanes &X = turned(box);
    const Vec3 &half = world_.bodies()[box].half;
    const Vec3Lanes &c = centres_[ball], &o = centres_[box];
    const Lanes x = c.x - o.x, y = c.y - o.y, z = c.z - o.z;
    const auto outside = [&](int axis, double reach) {
        const Lanes along = X.R[0][axis] * x + X.R[1][axis] * y + X.R[2][axis] * z;
        const Lanes beyond = (along < 0.0 ? -along : along) - reach;
        return beyond > 0.0 ? beyond : lanes_of(0.0);
    };
    const Lanes u = outside(0, half.x), v = outside(1, half.y), w = outside(2, half.z);
    return u * u + v * v + w * w > squared;
}

bool ManyChecks::touches(int lane) {
    if (std::all_of(near_.begin(), near_.end(), [&](const LaneBits &bits) { return bits[lane] == 0; })) return false;
    joints(lane, at_.joints.data());
    world_.forget(at_);
    for (std::size_t word = 0; word < near_.size(); ++word)
        for (std::uint64_t bits = static_cast<std::uint64_t>(near_[word][lane]); bits; bits &= bits - 1) {
            const std::size_t bit = 64 * word + static_cast<std::size_t>(__builtin_ctzll(bits));
            if (!asked_apart(bit < balls_.size() ? balls_[bit].asked : planes_[bit - balls_.size()].pair)) return true;
        }
    return false;
}

// Whether a pair is apart, or all pairs of a group, asked as ~group.
bool ManyChecks::asked_apart(int asked) {
    if (asked >= 0) {
        world_.put(at_, asked);
        return !world_.within(at_, asked, 0.0, &trail_.pairs[asked]);
    }
    const Together &group = world_.groups()[~asked];
    world_.put(at_, group);
    if (world_.group_apart(at_, ~asked, 0.0, &trail_.groups[~asked])) return true;
    bool apart = true;
    world_.visit_near(at_, group, 0.0, [&](int pair) {
        if (!apart) return;
        world_.put(at_, pair);
        apart = world_.lower_bound(at_, pair) > 0.0 || !world_.within(at_, pair, 0.0, &trail_.pairs[pair]);
    });
    return apart;
}

}  // namespace optiplan
