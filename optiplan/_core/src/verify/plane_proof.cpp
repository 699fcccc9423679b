#include "verify/plane_proof.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

namespace {

constexpr double REACH_SPARE = 1e-13;  // rad or m, of rounding in Taylor's formula

// exp([S] q) of a unit axis through the origin.
Pose turned(const Vec3 &u, double q) {
    const double s = std::sin(q), c = std::cos(q), d = 1.0 - c;
    return {{{{c + u.x * u.x * d, u.x * u.y * d - u.z * s, u.x * u.z * d + u.y * s},
              {u.y * u.x * d + u.z * s, c + u.y * u.y * d, u.y * u.z * d - u.x * s},
              {u.z * u.x * d - u.y * s, u.z * u.y * d + u.x * s, c + u.z * u.z * d}}},
            {}};
}

}  // namespace

PlaneProof::PlaneProof(ProvedTree tree, std::vector<ProvedBody> bodies, std::vector<ProvedPair> pairs)
    : tree_(std::move(tree)), bodies_(std::move(bodies)), pairs_(std::move(pairs)), normals_(pairs_.size()),
      features_(pairs_.size()), placed_(bodies_.size()), centres_(bodies_.size()), posed_(bodies_.size()),
      laid_(bodies_.size()) {
    const std::size_t joints = tree_.parents.size();
    std::vector<char> carries(joints);
    for (const ProvedPair &pair : pairs_) {
        std::fill(carries.begin(), carries.end(), 0);
        for (int j = bodies_[pair.b].joint; j > 0; j = tree_.parents[j]) carries[j] = 1;
        carries[0] = 1;
        int common = bodies_[pair.a].joint;
        while (!carries[common]) common = tree_.parents[common];
        std::array<int, 2> last{};
        for (int side = 0; side < 2; ++side)
            for (int j = bodies_[side ? pair.b : pair.a].joint; j != common; j = tree_.parents[j]) last[side] = j;
        last_.push_back(last);
    }
    joints_.resize(joints), axis_.resize(joints);
    for (auto *each : {&reach_, &rate_, &speed_, &acceleration_, &jump_}) each->assign(joints, 0.0);
    lever_.resize(bodies_.size() * joints), travelled_.resize(bodies_.size() * joints);
    planned_.resize(6 * tree_.planned);
}

// Joints in the middle of a span, and bounds of their motion: with b_k = q^(k)(middle) / k!,
// |q - b_0| <= sum |b_k| h^k and so on.
void PlaneProof::stand(const Span &span) {
    const std::size_t n = tree_.planned, degree = static_cast<std::size_t>(motion_->degree);
    const double *c = motion_->coefficients.data() + static_cast<std::size_t>(span.piece) * (degree + 1) * n;
    const double *jump = motion_->jump.data() + static_cast<std::size_t>(span.piece) * n;
    double *own = planned_.data();
    double b[16];
    for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t k = 0; k <= degree; ++k) b[k] = c[k * n + j];
        for (std::size_t i = 0; i < degree; ++i)  // Taylor shift by repeated Horner steps
            for (std::size_t k = degree; k-- > i;) b[k] += span.middle * b[k + 1];
        double reach = 0.0, speed = 0.0, acceleration = 0.0, power = 1.0;
        for (std::size_t k = 1; k <= degree; ++k, power *= span.half) {
            const double size = std::fabs(b[k]), order = static_cast<double>(k);
            reach += size * power * span.half, speed += order * size * power;
            if (k > 1) acceleration += order * (order - 1.0) * size * (k > 2 ? power / span.half : 1.0);
        }
        own[j] = b[0], own[n + j] = degree > 0 ? b[1] : 0.0;
        own[2 * n + j] = reach + jump[j] + REACH_SPARE, own[3 * n + j] = speed, own[4 * n + j] = acceleration;
        own[5 * n + j] = jump[j];
    }
    joints_[0] = {};
    for (std::size_t j = 1; j < joints_.size(); ++j) {
        const double *row = tree_.coupling.data() + (j - 1) * n;
        double q = tree_.offset[j - 1], sums[5] = {};
        for (std::size_t i = 0; i < n; ++i) {
            if (row[i] == 0.0) continue;
            q += row[i] * own[i], sums[0] += row[i] * own[n + i];
            for (int k = 1; k < 5; ++k) sums[k] += std::fabs(row[i]) * own[static_cast<std::size_t>(k + 1) * n + i];
        }
        rate_[j] = sums[0], reach_[j] = sums[1], speed_[j] = sums[2], acceleration_[j] = sums[3], jump_[j] = sums[4];
        const Vec3 &u = tree_.axes[j - 1];
        const Pose here = tree_.turns[j - 1] ? turned(u, q) : Pose{{}, q * u};
        joints_[j] = joints_[tree_.parents[j]] * (tree_.placements[j] * here);
        axis_[j] = joints_[j].R * u;
    }
    std::fill(posed_.begin(), posed_.end(), 0), std::fill(laid_.begin(), laid_.end(), 0);
}

const Pose &PlaneProof::pose(int body) {
    if (!posed_[body]) {
        placed_[body] = joints_[bodies_[body].joint] * bodies_[body].X_JB;
        centres_[body] = placed_[body] * bodies_[body].centre;
        posed_[body] = 1;
    }
    return placed_[body];
}

// Whether the balls about two bodies are farther apart than `gap`, m: the cheapest test, which most pairs pass.
bool PlaneProof::balls_apart(int pair, double gap) {
    const int a = pairs_[pair].a, b = pairs_[pair].b;
    if (bodies_[a].shape->half_space || bodies_[b].shape->half_space) return false;
    pose(a), pose(b);
    const double reach = gap + bodies_[a].radius + bodies_[b].radius;
    return reach < 0.0 || squared_norm(centres_[b] - centres_[a]) > reach * reach;
}

// The farthest that a point of a body gets from each axis, and how far it travels with the joints from there to its
// tip: joints are moved one after another, from the tip to the base.
void PlaneProof::lay(int body) {
    if (laid_[body]) return;
    laid_[body] = 1;
    double *lever = lever_.data() + body * joints_.size(), *travelled = travelled_.data() + body * joints_.size();
    pose(body);
    const Vec3 &centre = centres_[body];
    double own = 0.0;
    for (int j = bodies_[body].joint; j > 0; j = tree_.parents[j]) {
        lever[j] = 1.0;
        if (tree_.turns[j - 1]) lever[j] = norm(cross(axis_[j], centre - joints_[j].p)) + bodies_[body].radius + own;
        own += reach_[j] * lever[j];
        travelled[j] = own;
    }
}

// h(n) = max n . x over the points x of a body; of a half-space, along its normal.
double PlaneProof::support(int body, const Vec3 &n) {
    const ProvedShape &shape = *bodies_[body].shape;
    const Pose &X = pose(body);
    const Vec3 local = transposed(X.R, n);
    const double origin = dot(n, X.p);
    if (shape.half_space) return origin + shape.offset;
    if (shape.points.empty()) {
        const auto &r = shape.round;
        const double flat = local.x * local.x + local.y * local.y;
        return origin + r[0] * std::fabs(local.x) + r[1] * std::fabs(local.y) + r[2] * std::fabs(local.z) +
               r[3] * std::sqrt(flat) + r[4] * std::sqrt(flat + local.z * local.z);
    }
    return origin + shape.points.highest(local);
}

// -h_b(-n) - h_a(n): a lower bound of the distance, whatever the unit vector n is.
double PlaneProof::gap(int pair, const Vec3 &n) { return -support(pairs_[pair].b, -n) - support(pairs_[pair].a, n); }

// A lower bound of the distance from boxes and the balls about them; -infinity with a half-space.
double PlaneProof::volumes(int pair) {
    const ProvedBody *both[2] = {&bodies_[pairs_[pair].a], &bodies_[pairs_[pair].b]};
    if (both[0]->shape->half_space || both[1]->shape->half_space) return -HUGE_VAL;
    const Pose *X[2] = {&pose(pairs_[pair].a), &pose(pairs_[pair].b)};
    const Vec3 apart = centres_[pairs_[pair].b] - centres_[pairs_[pair].a];
    double found = -HUGE_VAL;
    for (int box = 0; box < 2; ++box) {
        const Vec3 local = transposed(X[box]->R, apart), &half = both[box]->half;
        const Vec3 outside{std::max(std::fabs(local.x) - half.x, 0.0), std::max(std::fabs(local.y) - half.y, 0.0),
                           std::max(std::fabs(local.z) - half.z, 0.0)};
        found = std::max(found, norm(outside) - both[1 - box]->radius);
    }
    return found;
}

double PlaneProof::travel(int pair) {
    double sum = 0.0;
    for (int side = 0; side < 2; ++side) {
        const int body = side ? pairs_[pair].b : pairs_[pair].a, last = last_[pair][side];
        if (!last) continue;
        lay(body);
        sum += travelled_[body * joints_.size() + last];
    }
    return sum;
}

// The gap along n within `half` of the middle, were every point to keep its velocity, less what acceleration and steps
// at the ends of pieces can take from it: see `Motion.along_normals`.
double PlaneProof::linear(int pair, const Vec3 &n, double half) {
    double after = 0.0, before = 0.0, loss = 0.0;
    for (int side = 0; side < 2; ++side) {
        const int body = side ? pairs_[pair].b : pairs_[pair].a, last = last_[pair][side];
        const Vec3 w = side ? -n : n;
        if (!last) {
            const double height = support(body, w);
            after += height, before += height;
            continue;
        }
        lay(body);
        const double *lever = lever_.data() + body * joints_.size();
        Vec3 omega, u;
        double inner = 0.0;
        const int end = tree_.parents[last], own = bodies_[body].joint;
        for (int j = own; j != end; j = tree_.parents[j]) inner += speed_[j];
        for (int j = own; j != end; j = tree_.parents[j]) {
            inner -= speed_[j];  // of the joints before it
            loss += 0.5 * half * half * lever[j] * (acceleration_[j] + speed_[j] * (speed_[j] + 2.0 * inner));
            loss += jump_[j] * lever[j];
            if (tree_.turns[j - 1])
                omega += rate_[j] * axis_[j], u += rate_[j] * cross(joints_[j].p, axis_[j]);
            else
                u += rate_[j] * axis_[j];
        }
        const Vec3 turn = half * cross(w, omega);
        const double shift = half * dot(w, u);
        after += support(body, w + turn) + shift, before += support(body, w - turn) - shift;
    }
    return -std::max(after, before) - loss;
}

// The gap along a normal that a search for the distance proposes, kept if it is better than the last one.
double PlaneProof::propose(int pair) {
    const ProvedPair &both = pairs_[pair];
    const ProvedShape &a = *bodies_[both.a].shape, &b = *bodies_[both.b].shape;
    if (a.half_space || b.half_space) {
        normals_[pair] = a.half_space ? pose(both.a).R * a.normal : -(pose(both.b).R * b.normal);
        return gap(pair, normals_[pair]);
    }
    ++verdict_.queries;
    const Witness found = distance(a.outline, pose(both.a), b.outline, pose(both.b), HUGE_VAL, &features_[pair]);
    const double length = norm(found.normal);
    if (found.distance <= 0.0 || !(std::fabs(length - 1.0) < 1e-6)) return -HUGE_VAL;
    normals_[pair] = (1.0 / length) * found.normal;
    return gap(pair, normals_[pair]);
}

void PlaneProof::meet(NearestGap &known, int pair, double gap, const Span &span) {
    if (gap < known.gap) known = {gap, motion_->breakpoints[span.piece] + span.middle, pair};
}

// Looks whether a pair is the nearest of its kind.
void PlaneProof::probe(int pair, const Span &span) {
    const ProvedPair &both = pairs_[pair];
    const double known = verdict_.nearest[both.kind].gap;
    if (balls_apart(pair, known) || volumes(pair) >= known) return;
    const Vec3 last = normals_[pair];
    if (squared_norm(last) > 0.0 && gap(pair, last) >= known) return;
    const double found = propose(pair);
    if (both.exact) {
        meet(verdict_.nearest[both.kind], pair, found, span);
        verdict_.given_up |= found <= rules_.asked + ROUNDING;
    } else if (found < known) {
        for (int part : both.parts) probe(part, span);
        if (both.parts.empty()) meet(verdict_.hull[both.kind], pair, found, span);
    }
}

PlaneVerdict PlaneProof::scan(const ProvedMotion &motion, const ProvedIntervals &intervals, double asked) {
    motion_ = &motion, verdict_ = {}, rules_ = {}, rules_.asked = asked;
    std::fill(normals_.begin(), normals_.end(), Vec3{}), std::fill(features_.begin(), features_.end(), Features{});
    for (std::size_t i = 0; i < intervals.piece.size() && !verdict_.given_up; ++i) {
        const Span span{intervals.piece[i], intervals.middle[i], intervals.half[i]};
        stand(span);
        for (const auto *pairs : {&intervals.common, &intervals.more[i]})
            for (int pair : *pairs) probe(pair, span);
    }
    return verdict_;
}

// The clearance to prove of pairs of a kind: most of the smallest distance that is known of it.
double PlaneProof::target(int kind) const {
    const double nearest = std::min(measured_[kind], verdict_.nearest[kind].gap) - rules_.asked;
    return std::min(rules_.asked + std::min(rules_.share * nearest, rules_.far), rules_.cap[kind]);
}

bool PlaneProof::proved(int pair, double margin) {
    double &least = verdict_.least[pairs_[pair].kind];
    least = std::min(least, margin);
    return true;
}

PlaneProof::Answer PlaneProof::settle(int pair, const Span &span) {
    const ProvedPair &both = pairs_[pair];
    double wanted = std::max(target(both.kind), rules_.asked);
    const double moved = travel(pair) + ROUNDING;
    if (balls_apart(pair, std::max(wanted, verdict_.least[both.kind]) + moved)) return Answer::proved;
    const double boxes = volumes(pair) - moved;
    if (boxes > wanted && proved(pair, boxes)) return Answer::proved;
    double bound = -HUGE_VAL;
    if (squared_norm(normals_[pair]) > 0.0) {
        bound = gap(pair, normals_[pair]);
        if (bound - moved > wanted && proved(pair, bound - moved)) return Answer::proved;
    }
    bound = propose(pair);
    if (both.exact) {
        meet(verdict_.nearest[both.kind], pair, bound, span);
        wanted = std::max(target(both.kind), rules_.asked);
        verdict_.given_up |= bound <= rules_.asked + ROUNDING;
        if (verdict_.given_up) return Answer::left;
    }
    double margin = bound - moved;
    if (std::isfinite(bound)) margin = std::max(margin, linear(pair, normals_[pair], span.half) - ROUNDING);
    if (margin > wanted && proved(pair, margin)) return Answer::proved;
    if (!both.parts.empty()) return Answer::expand;
    return span.half < rules_.narrowest || bound <= wanted ? Answer::left : Answer::halve;
}

void PlaneProof::prove_span(const Span &span, int interval, std::size_t begin, std::size_t end) {
    verdict_.given_up |= ++verdict_.intervals > rules_.most_intervals || verdict_.queries > rules_.most_queries;
    if (verdict_.given_up) return;
    stand(span);
    const std::size_t own = open_.size();
    for (std::size_t k = begin; k < end; ++k) {
        std::vector<int> parts{open_[k].pair};
        const int top = open_[k].top;
        for (std::size_t i = 0; i < parts.size(); ++i) {
            const Answer answer = settle(parts[i], span);
            if (verdict_.given_up) return;
            if (answer == Answer::halve) open_.push_back({parts[i], top});
            if (answer == Answer::left && left_on_[top] != interval) {
                left_on_[top] = interval;
                verdict_.left_interval.push_back(interval), verdict_.left_pair.push_back(top);
            }
            if (answer == Answer::expand) {
                const std::vector<int> &more = pairs_[parts[i]].parts;
                parts.insert(parts.end(), more.begin(), more.end());
            }
        }
    }
    const std::size_t after = open_.size();
    if (after == own) return;
    const double half = 0.5 * span.half;
    for (double middle : {span.middle - half, span.middle + half})
        prove_span({span.piece, middle, half}, interval, own, after);
    open_.resize(own);
}

PlaneVerdict PlaneProof::prove(const ProvedMotion &motion, const ProvedIntervals &intervals, const PlaneRules &rules,
                               const double measured[2]) {
    motion_ = &motion, rules_ = rules, verdict_ = {};
    measured_[0] = measured[0], measured_[1] = measured[1];
    std::fill(normals_.begin(), normals_.end(), Vec3{}), std::fill(features_.begin(), features_.end(), Features{});
    left_on_.assign(pairs_.size(), -1);
    for (std::size_t i = 0; i < intervals.piece.size() && !verdict_.given_up; ++i) {
        open_.clear();
        for (const auto *pairs : {&intervals.common, &intervals.more[i]})
            for (int pair : *pairs) open_.push_back({pair, pair});
        prove_span({intervals.piece[i], intervals.middle[i], intervals.half[i]}, static_cast<int>(i), 0, open_.size());
    }
    return verdict_;
}

}  // namespace optiplan
