#include "world/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace optiplan {

static constexpr double INF = std::numeric_limits<double>::infinity();
static constexpr double ROUNDING = 2e-6;  // m; what a hull's distance may exceed that of its mesh by, rounded

World::World(Tree tree, std::vector<Body> bodies, const std::vector<std::pair<int, int>> &pairs,
             const std::vector<Cluster> &clusters, const std::vector<int> &never, TubeError tube, Floors floors)
    : tree_(std::move(tree)), bodies_(std::move(bodies)), tube_(std::move(tube)), floors_(std::move(floors)),
      plain_(tube_.error.empty() && floors_.asked.empty()), hulls_(static_cast<int>(bodies_.size())) {
    for (std::size_t j = 1; j < tree_.joints.size() && !tube_.error.empty(); ++j)
        if (tree_.joints[j].revolute)
            spread_ += 2.0 * std::fabs(tree_.joints[j].multiplier) * tube_.error[tree_.joints[j].leader];
    for (const Cluster &cluster : clusters) bodies_.push_back(cluster.hull);
    cluster_of_.assign(bodies_.size(), -1);
    for (std::size_t k = 0; k < clusters.size(); ++k)
        for (int body : clusters[k].members) cluster_of_[body] = static_cast<int>(k);
    still_.resize(bodies_.size());
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
        if (bodies_[k].joint == 0) {
            still_[k] = bodies_[k].X_JB;
            continue;
        }
        moving_.push_back(static_cast<int>(k));
        if (cluster_of_[k] < 0) outside_.push_back(static_cast<int>(k));
    }
    waiting_.resize(bodies_.size());
    for (std::size_t k = 0; k < bodies_.size(); ++k) waiting_[k] = cluster_of_[k] < 0;
    for (auto [a, b] : pairs) {
        const bool plane = bodies_[a].half_space || bodies_[b].half_space;
        pairs_.push_back({a, b, (bodies_[a].mesh() || bodies_[b].mesh()) && !plane});
        common_.push_back(common_joint(a, b));
        clustered_.push_back(cluster_of_[a] >= 0 || cluster_of_[b] >= 0);
    }
    if (!plain_) measure_floors();
    std::vector<char> left_out(pairs_.size());
    for (int pair : never) left_out[pair] = 1;
    gather(hulls_, left_out);
}

void World::measure_floors() {
    asked_ = floors_.asked.empty() ? std::vector<double>(pairs_.size()) : floors_.asked;
    most_ = asked_;
    for (std::size_t pair = 0; pair < pairs_.size() && !tube_.error.empty(); ++pair) most_[pair] += tube_.most[pair];
    near_ends_.resize(pairs_.size());
    if (!floors_.ends.empty()) rises_.resize(pairs_.size());
    for (std::size_t k = 0; k < floors_.ends.size(); ++k) {
        const EndFloor &end = floors_.ends[k];
        near_ends_[end.pair].push_back(static_cast<int>(k));
        rises_[end.pair] = std::max(rises_[end.pair], end.rise);
    }
}

double World::floor_near(const Placement &at, int pair) const {
    double least = asked_[pair];
    for (int k : near_ends_[pair]) {
        const EndFloor &end = floors_.ends[k];
        double way = 0.0;
        for (std::size_t j = 0; j < end.q.size(); ++j)
            if (!std::isnan(end.q[j])) way += std::fabs(at.q[j] - end.q[j]);
        least = std::min(least, end.base + end.rise * way);
    }
    return least;
}

// Of the joints that ends are about, what stands before those of moving bodies.
double World::way(const double *D) const {
    double sum = 0.0;
    for (std::size_t j = 0; j < floors_.ends.front().q.size(); ++j) sum += std::fabs(D[j]);
    return sum;
}

int World::add(Body body) {
    const int added = static_cast<int>(bodies_.size());
    still_.push_back(body.X_JB);
    cluster_of_.push_back(-1);
    waiting_.push_back(1);
    bodies_.push_back(std::move(body));
    for (int k = 0; k < hulls_; ++k) {
        if (bodies_[k].joint == 0) continue;
        const bool plane = bodies_[k].half_space || bodies_[added].half_space;
        pairs_.push_back({k, added, (bodies_[k].mesh() || bodies_[added].mesh()) && !plane});
        common_.push_back(0);
        clustered_.push_back(cluster_of_[k] >= 0);
        group_of_.push_back(-1);
        if (plain_) continue;
        asked_.push_back(0.0), most_.push_back(0.0);
        near_ends_.emplace_back();
        if (!rises_.empty()) rises_.push_back(0.0);
        if (!tube_.error.empty()) tube_.most.push_back(0.0);
    }
    return added;
}

int World::common_joint(int a, int b) const {
    std::vector<char> carries(tree_.joints.size());
    for (int j = bodies_[a].joint; j > 0; j = tree_.joints[j].parent) carries[j] = 1;
    int j = bodies_[b].joint;
    while (j > 0 && !carries[j]) j = tree_.joints[j].parent;
    return j;
}

// The pairs of each cluster by their other body; a half-space has no distance from a hull that is cheaper than theirs.
void World::gather(int first, const std::vector<char> &never) {
    std::map<std::pair<int, int>, int> known;
    group_of_.assign(pairs_.size(), -1);
    for (std::size_t pair = 0; pair < pairs_.size(); ++pair) {
        if (never[pair]) continue;
        if (first_ < 0) first_ = static_cast<int>(pair);
        const auto [a, b, by_outline] = pairs_[pair];
        const int other = cluster_of_[a] < 0 ? a : b, cluster = cluster_of_[a] < 0 ? cluster_of_[b] : cluster_of_[a];
        if ((cluster_of_[a] < 0) == (cluster_of_[b] < 0) || bodies_[other].half_space) {
            alone_.push_back(static_cast<int>(pair));
            continue;
        }
        const auto [at, fresh] = known.try_emplace({cluster, other}, static_cast<int>(groups_.size()));
        if (fresh) groups_.push_back({first + cluster, other, common_joint(first + cluster, other), {}});
        const Body &member = bodies_[other == a ? b : a];
        groups_[at->second].members.push_back({static_cast<int>(pair), member.X_JB * member.centre, member.radius});
        group_of_[pair] = at->second;
        if (plain_) continue;
        Together &group = groups_[at->second];
        group.taken = std::max(group.taken, most_[pair]);
        group.floor = std::max(group.floor, asked_[pair]);
        group.rise = std::max(group.rise, rise(static_cast<int>(pair)));
    }
}

bool World::outlines_apart(const Placement &at, int pair, double gap, Features *features) const {
    const auto [a, b, by_outline] = pairs_[pair];
    return !overlap_within(bodies_[a].outline(), at.bodies[a], bodies_[b].outline(), at.bodies[b],
                           gap + ROUNDING + taken(at, pair), features);
}

bool World::group_apart(const Placement &at, int group, double gap, Features *features) const {
    const int hull = groups_[group].hull, other = groups_[group].other;
    if (!plain_) {
        if (balls_apart_of(at, hull, other, gap + groups_[group].taken)) return true;
        gap += groups_[group].floor;
        if (!tube_.error.empty()) gap += tube_of(at, hull, other, groups_[group].common);
    }
    if (balls_apart_of(at, hull, other, gap)) return true;
    if (std::max(ball_to_box(at, hull, other), ball_to_box(at, other, hull)) > gap) return true;
    return !overlap_within(bodies_[hull].outline(), at.bodies[hull], bodies_[other].outline(), at.bodies[other],
                           gap + ROUNDING, features);
}

Placement World::placement() const {
    Placement at;
    at.joints.resize(tree_.joints.size());
    at.bodies = still_;
    at.centres.resize(bodies_.size());
    at.placed.assign(bodies_.size(), 0);
    at.touching = std::max(first_, 0);
    if (!tube_.error.empty()) at.reaches.resize(bodies_.size() * tree_.joints.size());
    if (!floors_.ends.empty()) at.q.resize(tree_.planned);
    at.reached.assign(tube_.error.empty() ? 0 : bodies_.size(), 0);
    for (std::size_t k = 0; k < bodies_.size(); ++k)
        if (bodies_[k].joint == 0) at.centres[k] = still_[k] * bodies_[k].centre;
    return at;
}

void World::place_body(int body, Placement &at) const {
    at.bodies[body] = at.joints[bodies_[body].joint] * bodies_[body].X_JB;
    at.centres[body] = at.bodies[body] * bodies_[body].centre;
    at.placed[body] = 1;
}

void World::place_outside(const double *q, Placement &at) const {
    keep_place(q, at);
    tree_.poses(q, at.joints.data());
    std::copy(waiting_.begin(), waiting_.end(), at.placed.begin());
    std::fill(at.reached.begin(), at.reached.end(), 0);
    for (int body : outside_) place_body(body, at);
}

void World::place(const double *q, Placement &at) const {
    keep_place(q, at);
    tree_.poses(q, at.joints.data());
    std::fill(at.reached.begin(), at.reached.end(), 0);
    for (int body : moving_) place_body(body, at);
}

double World::ball_to_box(const Placement &at, int ball, int box) const {
    const Vec3 local = transposed(at.bodies[box].R, at.centres[ball] - at.centres[box]);
    return norm(outside_box(local, bodies_[box].half)) - bodies_[ball].radius;
}

double World::lower_bound(const Placement &at, int pair, double enough) const {
    const auto [a, b, by_outline] = pairs_[pair];
    if (bodies_[a].half_space || bodies_[b].half_space) {
        const int plane = bodies_[a].half_space ? a : b, body = plane == a ? b : a;
        const Vec3 normal = at.bodies[plane].R * bodies_[plane].normal;
        return dot(normal, at.centres[body] - at.bodies[plane].p) - bodies_[plane].offset - bodies_[body].radius -
               taken(at, pair);
    }
    const double bound = ball_to_box(at, a, b), least = taken(at, pair);
    return (bound - least > enough ? bound : std::max(bound, ball_to_box(at, b, a))) - least;
}

bool World::within(const Placement &at, int pair, double margin, Features *features) const {
    const auto [a, b, by_outline] = pairs_[pair];
    const Pose &X_a = at.bodies[a], &X_b = at.bodies[b];
    const double wide = margin + taken(at, pair);
    if (by_outline) {
        if (!overlap_within(bodies_[a].outline(), X_a, bodies_[b].outline(), X_b, wide, features)) return false;
        if (margin > WIDE) return true;
        if (!parts_within(bodies_[a].parts, X_a, bodies_[b].parts, X_b, wide + ROUNDING)) return false;
        features = nullptr;
    }
    const bool near = overlap_within(bodies_[a].solid(), X_a, bodies_[b].solid(), X_b, wide, features);
    return near && (!in_tube(pair) || distance(at, pair, margin).distance <= margin);
}

const double *World::reached(const Placement &at, int body) const {
    double *own = at.reaches.data() + body * tree_.joints.size();
    if (!at.reached[body]) reach(at, body, own), at.reached[body] = 1;
    return own;
}

double World::tube_of(const Placement &at, int a, int b, int common) const {
    reached(at, a), reached(at, b);
    const double of_a = travel_of(at.reaches, tube_.error.data(), a, common);
    return of_a + travel_of(at.reaches, tube_.error.data(), b, common);
}

double World::ball_tube(const Placement &at, int body, int common) const {
    double own = 0.0;
    for (int j = bodies_[body].joint; j != common; j = tree_.joints[j].parent) {
        const Joint &joint = tree_.joints[j];
        const double step = std::fabs(joint.multiplier) * tube_.error[joint.leader];
        const double lever = norm(cross(tree_.axis(at.joints.data(), j), at.centres[body] - at.joints[j].p));
        own += joint.revolute ? step * (lever + bodies_[body].radius + own) : step;
    }
    return own;
}

double World::tube_along(const Placement &at, int pair, const Vec3 &normal) const {
    const auto [a, b, by_outline] = pairs_[pair];
    return tube_along_of(at, a, common_[pair], normal) + tube_along_of(at, b, common_[pair], normal);
}

// From the tip to the base: a joint that turns by e moves a point x, moved by up to `own` already, along the normal by
// no more than e |(n x axis) . (x - p)| + e |n x axis| own + e^2 / 2 lever, see `verify.continuous.motion_bounds`.
double World::tube_along_of(const Placement &at, int body, int common, const Vec3 &normal) const {
    const double *reach = reached(at, body);
    const Vec3 &half = bodies_[body].half;
    double along = 0.0, own = 0.0;
    for (int j = bodies_[body].joint; j != common; j = tree_.joints[j].parent) {
        const Joint &joint = tree_.joints[j];
        const double step = std::fabs(joint.multiplier) * tube_.error[joint.leader];
        const Vec3 axis = tree_.axis(at.joints.data(), j);
        if (!joint.revolute) {
            along += step * std::fabs(dot(normal, axis));
            own += step;
            continue;
        }
        const double lever = reach[j] + own;
        const Vec3 d = cross(normal, axis), local = transposed(at.bodies[body].R, d);
        const double spread = half.x * std::fabs(local.x) + half.y * std::fabs(local.y) + half.z * std::fabs(local.z);
        const double straight = std::fabs(dot(d, at.centres[body] - at.joints[j].p)) + spread;
        along += step * std::min(straight + norm(d) * own + 0.5 * step * lever, lever);
        own += step * lever;
    }
    return along;
}

// A witness of a pair whose distance was asked up to `cutoff` and what is taken beyond, less its floor and what the
// tube takes of it.
Witness World::above(const Placement &at, int pair, Witness witness, double cutoff, bool convex) const {
    if (plain_) return witness;
    witness.distance -= floor(at, pair);
    if (!in_tube(pair)) return witness;
    const double most = tube(at, pair);
    const bool whatever = !convex || witness.distance > cutoff + most;
    witness.distance -= whatever ? most : std::min(most, tube_along(at, pair, witness.normal));
    return witness;
}

bool World::collides(Placement &at, Trail *trail) const {
    if (first_ < 0) return false;
    open(at, at.touching);
    if (touches(at, at.touching, trail)) return true;
    int touching = -1;
    const auto ask = [&](int pair) {
        if (touching < 0 && pair != at.touching && touches(at, pair, trail)) touching = pair;
    };
    for (std::size_t k = 0; k < alone_.size() && touching < 0; ++k) {
        open(at, alone_[k]);
        if (!balls_apart(at, alone_[k], 0.0)) ask(alone_[k]);
    }
    for (std::size_t k = 0; k < groups_.size() && touching < 0; ++k)
        if (!group_apart(at, static_cast<int>(k), 0.0, trail ? &trail->groups[k] : nullptr))
            visit_near(at, groups_[k], 0.0, ask);
    if (touching >= 0) at.touching = touching;
    return touching >= 0;
}

bool World::collides(Placement &at, const std::vector<int> &pairs, Trail &trail) const {
    std::vector<char> known(groups_.size());
    for (int pair : pairs) {
        if (settled(at, pair, known, [](int) { return 0.0; }, trail.groups.data()) || boxes_apart(at, pair, 0.0))
            continue;
        if (within(at, pair, 0.0, &trail.pairs[pair])) return true;
    }
    return false;
}

Witness World::distance(const Placement &at, int pair, double cutoff) const {
    const auto [a, b, by_outline] = pairs_[pair];
    const double wide = cutoff + taken(at, pair);
    return above(at, pair, optiplan::distance(bodies_[a].solid(), at.bodies[a], bodies_[b].solid(), at.bodies[b], wide),
                 cutoff, !by_outline);
}

Witness World::nearest_points(const Placement &at, int pair, double cutoff, Features *features, double gap) const {
    const auto [a, b, by_outline] = pairs_[pair];
    const double most = taken(at, pair);
    const Witness outer = optiplan::distance(bodies_[a].outline(), at.bodies[a], bodies_[b].outline(), at.bodies[b],
                                             cutoff + most, features, gap);
    if (!by_outline || outer.distance > SETTLED + most) return above(at, pair, outer, cutoff);
    const Witness nearer =
        optiplan::distance(bodies_[a].solid(), at.bodies[a], bodies_[b].solid(), at.bodies[b], cutoff + most);
    return above(at, pair, nearer.distance > 0.0 ? nearer : outer, cutoff, !(nearer.distance > 0.0));
}

void World::near(Placement &at, int row, double cutoff, std::vector<Contact> &found, Trail &trail,
                 const Sketch &sketch) const {
    const std::size_t begin = found.size();
    const auto ask = [&](int pair, double limit) {
        const Witness witness = nearest_points(at, pair, limit, &trail.pairs[pair], sketch.gap);
        if (witness.distance < limit) found.push_back({row, pair, witness});
        return witness.distance;
    };
    for (int pair : alone_) {
        open(at, pair);
        if (!balls_apart(at, pair, cutoff) && lower_bound(at, pair, cutoff) < cutoff) ask(pair, cutoff);
    }
    for (std::size_t k = 0; k < groups_.size(); ++k) {
        if (group_apart(at, static_cast<int>(k), cutoff, &trail.groups[k])) continue;
        trail.asked.clear();
        visit_near(at, groups_[k], cutoff, [&](int pair) {
            const double bound = lower_bound(at, pair, cutoff);
            if (bound < cutoff) trail.asked.push_back({bound, pair});
        });
        std::sort(trail.asked.begin(), trail.asked.end());
        double least = cutoff;
        const std::size_t first = found.size();
        for (const auto &[bound, pair] : trail.asked) {
            const double limit = std::min(cutoff, least + sketch.window);
            if (!(bound < limit)) break;
            least = std::min(least, ask(pair, limit));
        }
        const auto far = [&](const Contact &contact) { return contact.witness.distance > least + sketch.window; };
        found.erase(std::remove_if(found.begin() + static_cast<std::ptrdiff_t>(first), found.end(), far), found.end());
    }
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(begin), found.end(),
              [](const Contact &a, const Contact &b) { return a.pair < b.pair; });
}

// Distance of a pair's outlines, whatever the triangles of meshes say; no more than theirs.
double World::outline_bound(const Placement &at, int pair) const {
    const double bound = lower_bound(at, pair);
    const auto [a, b, by_outline] = pairs_[pair];
    if (!by_outline) return bound;
    const Shape &one = bodies_[a].outline(), &other = bodies_[b].outline();
    const double outer = optiplan::distance(one, at.bodies[a], other, at.bodies[b], INF).distance;
    return std::max(bound, outer - ROUNDING - taken(at, pair));
}

Contact World::nearest(const Placement &at) const {
    std::vector<std::pair<double, int>> order;
    order.reserve(pairs_.size());
    for (int pair = 0; pair < static_cast<int>(pairs_.size()); ++pair) order.push_back({lower_bound(at, pair), pair});
    std::sort(order.begin(), order.end());
    Contact best{0, -1, {}};
    double least = INF, bound_of_best = INF;
    for (const auto &[cheap, pair] : order) {
        if (best.pair >= 0 && cheap > least) break;
        const auto [a, b, by_outline] = pairs_[pair];
        if (by_outline && !overlap_within(bodies_[a].outline(), at.bodies[a], bodies_[b].outline(), at.bodies[b],
                                          std::max(least + ROUNDING + taken(at, pair), 0.0)))
            continue;
        const Witness witness = distance(at, pair, least);
        if (best.pair >= 0 && witness.distance > least) continue;
        const double bound = outline_bound(at, pair);  // where several are equally near, it decides, then the number
        const bool before = bound < bound_of_best || (bound == bound_of_best && pair < best.pair);
        if (best.pair >= 0 && !(witness.distance < least || before)) continue;
        best = {0, pair, witness}, least = witness.distance, bound_of_best = bound;
    }
    return best;
}

void World::push(const Pose *joints, int joint, const Vec3 &point, const Vec3 &direction, double *out) const {
    const Joint &moved = tree_.joints[joint];
    const Vec3 axis = tree_.axis(joints, joint);
    const Vec3 column = moved.revolute ? cross(axis, point - joints[joint].p) : axis;
    out[moved.leader] += moved.multiplier * dot(column, direction);
}

void World::gradient(const Pose *joints, const Contact &contact, double *out) const {
    const Witness &w = contact.witness;
    const Pair &pair = pairs_[contact.pair];
    const int common = common_[contact.pair];
    std::fill(out, out + tree_.planned, 0.0);
    for (int j = bodies_[pair.a].joint; j != common; j = tree_.joints[j].parent) push(joints, j, w.a, -w.normal, out);
    for (int j = bodies_[pair.b].joint; j != common; j = tree_.joints[j].parent) push(joints, j, w.b, w.normal, out);
}

void World::reach(const Placement &at, int body, double *out) const {
    std::fill_n(out, tree_.joints.size(), 0.0);
    if (bodies_[body].joint == 0) return;
    const Vec3 &half = bodies_[body].half;
    const bool bounded = std::isfinite(half.x);
    Vec3 corners[8];
    for (int k = 0; k < 8; ++k) {
        Vec3 local = bodies_[body].centre;
        if (bounded) local += Vec3{k & 4 ? half.x : -half.x, k & 2 ? half.y : -half.y, k & 1 ? half.z : -half.z};
        corners[k] = at.bodies[body] * local;
    }
    for (int j = bodies_[body].joint; j > 0; j = tree_.joints[j].parent) {
        if (!tree_.joints[j].revolute) continue;
        const Vec3 axis = tree_.axis(at.joints.data(), j);
        double squared = 0.0;
        for (const Vec3 &corner : corners)
            squared = std::max(squared, squared_norm(cross(axis, corner - at.joints[j].p)));
        out[j] = std::sqrt(squared) + 1e-9;
    }
}

void World::reaches(const Placement &at, std::vector<double> &out) const {
    const std::size_t joints = tree_.joints.size();
    out.assign(bodies_.size() * joints, 0.0);
    for (int body : moving_) reach(at, body, out.data() + body * joints);
}

// From the tip to the base: t <- t + D_j (R_j + t) for a joint that turns, t + D_j for one that slides.
double World::travel_of(const std::vector<double> &reaches, const double *D, int body, int common) const {
    const double *reach = reaches.data() + body * tree_.joints.size();
    double own = 0.0;
    for (int j = bodies_[body].joint; j != common; j = tree_.joints[j].parent) {
        const Joint &joint = tree_.joints[j];
        const double step = std::fabs(joint.multiplier) * D[joint.leader];
        own += joint.revolute ? step * (reach[j] + own) : step;
    }
    return own;
}

double World::travel(const std::vector<double> &reaches, const double *D, int pair) const {
    const double of_a = travel_of(reaches, D, pairs_[pair].a, common_[pair]);
    const double own = spread_ * (of_a + travel_of(reaches, D, pairs_[pair].b, common_[pair]));
    return rise(pair) > 0.0 ? own + rise(pair) * way(D) : own;
}

double World::group_travel(const std::vector<double> &reaches, const double *D, int group) const {
    const Together &of = groups_[group];
    const double own = travel_of(reaches, D, of.hull, of.common) + travel_of(reaches, D, of.other, of.common);
    return of.rise > 0.0 ? spread_ * own + of.rise * way(D) : spread_ * own;
}

double World::gap(const Placement &at, int pair, double cutoff, Features *features) const {
    const auto [a, b, by_outline] = pairs_[pair];
    const double most = taken(at, pair), wide = cutoff + most;
    if (by_outline) {
        Witness outer = optiplan::distance(bodies_[a].outline(), at.bodies[a], bodies_[b].outline(), at.bodies[b],
                                           wide + ROUNDING, features);
        outer.distance -= ROUNDING;
        if (outer.distance > SETTLED + most || outer.distance > wide) return above(at, pair, outer, cutoff).distance;
        return distance(at, pair, cutoff).distance;
    }
    const Witness witness =
        optiplan::distance(bodies_[a].solid(), at.bodies[a], bodies_[b].solid(), at.bodies[b], wide, features);
    return above(at, pair, witness, cutoff).distance;
}

}  // namespace optiplan
