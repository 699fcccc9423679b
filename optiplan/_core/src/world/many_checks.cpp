#include "world/many_checks.hpp"

#include <algorithm>

namespace optiplan {

static constexpr double HAIR = 1e-12;  // m; how much more a ball is than its radius, for rounding
static constexpr std::size_t BLOCK = 16;  // pairs compared before those of them that are near are queried; at most 64

static std::uint64_t any(const LaneBits &bits) {
    return static_cast<std::uint64_t>(bits[0] | bits[1] | bits[2] | bits[3]);
}

static int first_of(std::uint64_t bits) { return __builtin_ctzll(bits); }

ManyChecks::ManyChecks(const World &world) : world_(world), at_(LANES, world.placement()), trail_(world.trail()) {
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
        const Pose &X = at_[0].bodies[plane];
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
            centres_[k] = lanes_of(at_[0].centres[k]);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) bodies_[k].R[i][j] = lanes_of(at_[0].bodies[k].R.rows[i][j]);
            turned_[k] = 1;
        }
        if (bodies[k].joint != 0 && used[k]) moving_.push_back(static_cast<int>(k));
    }
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
        const unsigned found = look(q, false);
        for (std::size_t lane = 0; lane < lanes; ++lane) out[row + lane] = found >> lane & 1;
    }
}

void ManyChecks::joints(int lane, Pose *out) const {
    for (std::size_t j = 0; j < joints_.size(); ++j) out[j] = lane_of(joints_[j], lane);
}

unsigned ManyChecks::look(const double *q, bool any_of_them) {
    place(q);
    unsigned found = 0;
    const auto enough = [&] { return any_of_them && found; };
    const auto ask = [&](const LaneBits &near, const auto &touches) {
        for (int lane = LANES; lane-- > 0 && !enough();)
            for (std::uint64_t bits = near[lane]; bits && !(found >> lane & 1); bits &= bits - 1)
                if (touches(lane, first_of(bits))) found |= 1u << lane;
    };
    for (std::size_t first = 0; first < balls_.size() && !enough(); first += BLOCK)
        ask(near_balls(first), [&](int lane, int bit) {
            if (asked_apart(lane, balls_[first + bit].asked)) return false;
            // Pairs that touch often move to the front: most searches need only the first block.
            if (any_of_them) std::swap(balls_[first + bit], balls_[(first + bit) / 4]);
            return true;
        });
    for (std::size_t k = 0; k < planes_.size() && !enough(); ++k)
        ask(near_plane(planes_[k]), [&](int lane, int) { return !asked_apart(lane, planes_[k].pair); });
    return found;
}

void ManyChecks::place(const double *q) {
    poses_in_lanes(world_.tree(), q, joints_.data());
    std::fill(placed_, placed_ + LANES, false);
    for (int body : moving_) {
        turned_[body] = 0;
        const Body &of = world_.bodies()[body];
        centres_[body] = moved(joints_[of.joint], of.X_JB * of.centre);
    }
}

// Find which pairs of the block from `first` on may touch, by balls and boxes; a bit each.
LaneBits ManyChecks::near_balls(std::size_t first) {
    LaneBits near{}, own = LaneBits{} + 1;
    for (std::size_t k = first; k < std::min(balls_.size(), first + BLOCK); ++k, own += own) {
        const Balls &pair = balls_[k];
        const Vec3Lanes &a = centres_[pair.a], &b = centres_[pair.b];
        const Lanes x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
        near |= own & ~(x * x + y * y + z * z > pair.squared);
    }
    for (std::uint64_t bits = any(near); bits; bits &= bits - 1) {
        const Balls &pair = balls_[first + first_of(bits)];
        const LaneBits one = LaneBits{} + static_cast<std::int64_t>(bits & -bits);
        near &= ~(one & apart_from_box(pair.a, pair.ball_a, pair.b));
        if (any(near & one)) near &= ~(one & apart_from_box(pair.b, pair.ball_b, pair.a));
    }
    return near;
}

LaneBits ManyChecks::near_plane(const Plane &plane) const {
    const Vec3Lanes &c = centres_[plane.body];
    return ~(c.x * plane.normal.x + c.y * plane.normal.y + c.z * plane.normal.z > plane.offset) & 1;
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

// Whether a pair is apart at one of the four configurations, or all pairs of a group, asked as ~group.
bool ManyChecks::asked_apart(int lane, int asked) {
    Placement &at = at_[lane];
    if (!placed_[lane]) {
        joints(lane, at.joints.data());
        world_.forget(at);
        placed_[lane] = true;
    }
    if (asked >= 0) {
        world_.put(at, asked);
        return !world_.within(at, asked, 0.0, &trail_.pairs[asked]);
    }
    const Together &group = world_.groups()[~asked];
    world_.put(at, group);
    if (world_.group_apart(at, ~asked, 0.0, &trail_.groups[~asked])) return true;
    bool apart = true;
    world_.visit_near(at, group, 0.0, [&](int pair) {
        if (!apart) return;
        world_.put(at, pair);
        apart = world_.lower_bound(at, pair, 0.0) > 0.0 || !world_.within(at, pair, 0.0, &trail_.pairs[pair]);
    });
    return apart;
}

}  // namespace optiplan
