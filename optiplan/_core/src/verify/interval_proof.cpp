#include "verify/interval_proof.hpp"

#include <algorithm>
#include <cmath>

namespace optiplan {

static constexpr double PI = 3.14159265358979323846;
static constexpr double SEAM = 1e-9;        // rad or m, by which kept boxes are larger: rounding of angles
static constexpr double REACH_SPARE = 1e-13;  // rad or m, of rounding in Taylor's formula

double KeptBoxes::least(const double *from, const double *to) const {
    double found = HUGE_VAL;
    double ends[2][2] = {{HUGE_VAL, -HUGE_VAL}, {HUGE_VAL, -HUGE_VAL}};
    for (std::size_t box = 0; box < clearance.size(); ++box) {
        bool meets = true;
        for (int k = 0; k < 2 && joints[k] >= 0; ++k) {
            const double a = low[2 * box + k], b = high[2 * box + k];
            ends[k][0] = std::min(ends[k][0], a), ends[k][1] = std::max(ends[k][1], b);
            double apart = std::fabs(0.5 * (from[joints[k]] + to[joints[k]]) - 0.5 * (a + b));
            if (endless[k]) apart = std::fabs(std::remainder(apart, 2.0 * PI));
            meets &= apart <= 0.5 * (to[joints[k]] - from[joints[k]]) + 0.5 * (b - a) + SEAM;
        }
        if (meets) found = std::min(found, clearance[box]);
    }
    for (int k = 0; k < 2 && joints[k] >= 0; ++k)
        if (!endless[k] && (from[joints[k]] < ends[k][0] || to[joints[k]] > ends[k][1])) return -HUGE_VAL;
    return std::isfinite(found) ? found : -HUGE_VAL;
}

IntervalProof::IntervalProof(const World &world, std::vector<int> kinds, std::vector<KeptBoxes> kept)
    : world_(world), kinds_(std::move(kinds)), kept_(std::move(kept)), kept_of_(world.pairs().size(), -1),
      at_(world.placement()), laid_(world.bodies().size()), normals_(world.pairs().size()),
      features_(world.pairs().size()) {
    for (std::size_t k = 0; k < kept_.size(); ++k) kept_of_[kept_[k].pair] = static_cast<int>(k);
    const std::vector<Joint> &joints = world_.tree().joints;
    const auto below = [&](int body, int common) {
        int j = world_.bodies()[body].joint, last = 0;
        for (; j != common; j = joints[j].parent) last = j;
        return last;
    };
    for (int pair = 0; pair < static_cast<int>(world_.pairs().size()); ++pair) {
        const Pair &both = world_.pairs()[pair];
        const Body &a = world_.bodies()[both.a], &b = world_.bodies()[both.b];
        const int common = world_.common(pair);
        sides_.push_back(
            {{below(both.a, common), below(both.b, common)}, a.half_space || b.half_space, !a.mesh() && !b.mesh()});
    }
    for (const Body &body : world_.bodies()) {
        PaddedPoints points;
        if (body.outline().kind == Kind::hull) {
            for (const Vec3 &p : body.outline().hull->points()) points.add(p);
            points.pad();
        }
        points_.push_back(std::move(points));
    }
    lever_.resize(world_.bodies().size() * joints.size()), travelled_.resize(lever_.size());
    const auto n = static_cast<std::size_t>(world_.tree().planned);
    for (auto *each : {&q_, &reach_, &v_, &speed_, &acceleration_}) each->resize(n);
}

void IntervalProof::move(int body, const Pose &X_WB) {
    at_.bodies[body] = X_WB;
    at_.centres[body] = X_WB * world_.bodies()[body].centre;
}

// The box of each piece: of its Taylor polynomial about its middle.
void IntervalProof::build(const Curve &curve) {
    curve_ = &curve;
    const std::size_t n = q_.size(), pieces = curve.breakpoints.size() - 1;
    low_.resize(pieces * n), high_.resize(pieces * n);
    for (std::size_t i = 0; i < pieces; ++i) {
        const double width = curve.breakpoints[i + 1] - curve.breakpoints[i];
        const int piece = static_cast<int>(i);
        box_of({piece, piece + 1, 0.5 * width, 0.5 * width});
        for (std::size_t j = 0; j < n; ++j) low_[i * n + j] = q_[j] - reach_[j], high_[i * n + j] = q_[j] + reach_[j];
    }
}

// Bounds of the joints' motion: with b_k = q^(k)(middle) / k!, |q - b_0| <= sum |b_k| h^k and so on.
void IntervalProof::box_of(const Span &span) {
    const std::size_t n = q_.size();
    if (span.half <= 0.0) {
        for (std::size_t j = 0; j < n; ++j) {
            double low = HUGE_VAL, high = -HUGE_VAL;
            for (int i = span.first; i < span.last; ++i)
                low = std::min(low, low_[i * n + j]), high = std::max(high, high_[i * n + j]);
            q_[j] = 0.5 * (low + high), reach_[j] = 0.5 * (high - low) + REACH_SPARE;
        }
        return;
    }
    const int degree = curve_->degree;
    const double *c = curve_->coefficients.data() + static_cast<std::size_t>(span.first) * (degree + 1) * n;
    double b[16];
    for (std::size_t j = 0; j < n; ++j) {
        for (int k = 0; k <= degree; ++k) b[k] = c[k * n + j];
        for (int i = 0; i < degree; ++i)  // Taylor shift by repeated Horner steps
            for (int k = degree; k-- > i;) b[k] += span.middle * b[k + 1];
        double reach = 0.0, speed = 0.0, acceleration = 0.0;
        for (int k = degree; k >= 1; --k) {
            const double size = std::fabs(b[k]);
            reach = (reach + size) * span.half;
            speed = k > 1 ? (speed + k * size) * span.half : speed + size;
            if (k > 1)
                acceleration = (k > 2 ? (acceleration + k * (k - 1) * size) * span.half : acceleration + 2.0 * size);
        }
        q_[j] = b[0], v_[j] = degree > 0 ? b[1] : 0.0;
        reach_[j] = reach + REACH_SPARE, speed_[j] = speed, acceleration_[j] = acceleration;
    }
}

void IntervalProof::stand() {
    world_.place(q_.data(), at_);
    std::fill(laid_.begin(), laid_.end(), 0);
}

// The farthest that a point of a body gets from each axis, and how far it travels with the joints from there to its
// tip.
void IntervalProof::lay(int body) {
    if (laid_[body]) return;
    laid_[body] = 1;
    const Tree &tree = world_.tree();
    double *lever = lever_.data() + body * tree.joints.size(),
           *travelled = travelled_.data() + body * tree.joints.size();
    double own = 0.0;
    for (int j = world_.bodies()[body].joint; j > 0; j = tree.joints[j].parent) {
        const Joint &joint = tree.joints[j];
        lever[j] = 1.0;
        if (joint.revolute) {
            const Vec3 arm = cross(tree.axis(at_.joints.data(), j), at_.centres[body] - at_.joints[j].p);
            lever[j] = norm(arm) + world_.bodies()[body].radius + own;
        }
        own += std::fabs(joint.multiplier) * reach_[joint.leader] * lever[j];
        travelled[j] = own;
    }
}

double IntervalProof::travel(int pair) {
    const int bodies[2] = {world_.pairs()[pair].a, world_.pairs()[pair].b};
    double sum = 0.0;
    for (int side = 0; side < 2; ++side) {
        const int last = sides_[pair].last[side];
        if (!last) continue;
        lay(bodies[side]);
        sum += travelled_[bodies[side] * world_.tree().joints.size() + last];
    }
    return sum;
}

// h(n) = max n . x over the points x of a body's outline.
double IntervalProof::support(int body, const Vec3 &n) const {
    const Shape &shape = world_.bodies()[body].outline();
    const Pose &X = at_.bodies[body];
    const Vec3 local = transposed(X.R, n);
    const double origin = dot(n, X.p);
    switch (shape.kind) {
    case Kind::sphere:
        return origin + shape.radius * norm(n);
    case Kind::capsule:
        return origin + shape.half_length * std::fabs(local.z) + shape.radius * norm(n);
    case Kind::box:
        return origin + shape.half.x * std::fabs(local.x) + shape.half.y * std::fabs(local.y) +
               shape.half.z * std::fabs(local.z);
    case Kind::cylinder:
        return origin + shape.half_length * std::fabs(local.z) +
               shape.radius * std::sqrt(local.x * local.x + local.y * local.y);
    case Kind::hull:
        break;
    default:
        return HUGE_VAL;
    }
    return origin + points_[body].highest(local);
}

// -h_b(-n) - h_a(n): a lower bound of the distance, whatever the unit vector n is.
double IntervalProof::gap(int pair, const Vec3 &n) const {
    const Pair &both = world_.pairs()[pair];
    if (!sides_[pair].plane) return -support(both.b, -n) - support(both.a, n);
    const bool first = world_.bodies()[both.a].half_space;
    const int plane = first ? both.a : both.b, body = first ? both.b : both.a;
    const Vec3 up = at_.bodies[plane].R * world_.bodies()[plane].normal;
    return -support(body, -up) - dot(up, at_.bodies[plane].p) - world_.bodies()[plane].offset;
}

// The gap along n within `half` of the middle, to first order in time, less what acceleration takes from it.
double IntervalProof::linear(int pair, const Vec3 &n, double half) {
    const Pair &both = world_.pairs()[pair];
    const Tree &tree = world_.tree();
    double after = 0.0, before = 0.0, loss = 0.0;
    for (int side = 0; side < 2; ++side) {
        const int body = side ? both.b : both.a, last = sides_[pair].last[side];
        const Vec3 w = side ? -n : n;
        if (!last) {
            const Body &still = world_.bodies()[body];  // of a half-space, w is the normal, inwards
            const double height = still.half_space
                                      ? dot(at_.bodies[body].R * still.normal, at_.bodies[body].p) + still.offset
                                      : support(body, w);
            after += height, before += height;
            continue;
        }
        lay(body);
        const double *lever = lever_.data() + body * tree.joints.size();
        Vec3 omega, u;
        double total = 0.0;
        const int end = tree.joints[last].parent;
        for (int j = world_.bodies()[body].joint; j != end; j = tree.joints[j].parent)
            total += std::fabs(tree.joints[j].multiplier) * speed_[tree.joints[j].leader];
        for (int j = world_.bodies()[body].joint; j != end; j = tree.joints[j].parent) {
            const Joint &joint = tree.joints[j];
            const double scale = std::fabs(joint.multiplier), speed = scale * speed_[joint.leader];
            total -= speed;  // of the joints before it
            loss +=
                0.5 * half * half * lever[j] * (scale * acceleration_[joint.leader] + speed * (speed + 2.0 * total));
            const Vec3 axis = tree.axis(at_.joints.data(), j);
            const double rate = joint.multiplier * v_[joint.leader];
            if (joint.revolute)
                omega += rate * axis, u += rate * cross(at_.joints[j].p, axis);
            else
                u += rate * axis;
        }
        const Vec3 turn = half * cross(w, omega);
        const double shift = half * dot(w, u);
        after += support(body, w + turn) + shift, before += support(body, w - turn) - shift;
    }
    return -std::max(after, before) - loss;
}

// What is kept of a pair for all configurations that the joints may have here; -infinity without.
double IntervalProof::kept(int pair) const {
    const int which = kept_of_[pair];
    if (which < 0) return -HUGE_VAL;
    double low[64], high[64];
    for (std::size_t j = 0; j < q_.size(); ++j) low[j] = q_[j] - reach_[j], high[j] = q_[j] + reach_[j];
    return kept_[which].least(low, high);
}

// A plane farther than `enough` from touching, where one is found; `bound` is the gap along the last one tried.
bool IntervalProof::separated(int pair, double enough, double &bound) {
    Vec3 &n = normals_[pair];
    bound = -HUGE_VAL;
    if (sides_[pair].plane) {
        bound = gap(pair, n);
        return bound > enough;
    }
    if (squared_norm(n) > 0.0) {
        bound = gap(pair, n);
        if (bound > enough) return true;
    }
    const Pair &both = world_.pairs()[pair];
    const Shape &a = world_.bodies()[both.a].outline(), &b = world_.bodies()[both.b].outline();
    Features &features = features_[pair];
    ++verdict_.queries;
    if (overlap_within(a, at_.bodies[both.a], b, at_.bodies[both.b], std::max(enough, 0.0), &features)) return false;
    const bool swapped = a.kind > b.kind;
    const Vec3 &d = features.direction;
    const double length = norm(d);
    if (length > 0.0) {
        n = ((swapped ? 1.0 : -1.0) / length) * (at_.bodies[swapped ? both.b : both.a].R * d);
        bound = gap(pair, n);
        if (bound > enough) return true;
    }
    // Shapes without a core are told apart by closed formulas, which leave no direction.
    const Witness w = optiplan::distance(a, at_.bodies[both.a], b, at_.bodies[both.b], HUGE_VAL, &features);
    if (w.distance > 0.0) n = w.normal, bound = gap(pair, n);
    return bound > enough;
}

// Records the margin proved.
bool IntervalProof::settled(int pair, double margin) {
    double &least = verdict_.least[kinds_[pair]];
    least = std::min(least, margin);
    return true;
}

bool IntervalProof::fail(int pair, const Span &span, double distance, bool touches) {
    const double begin = curve_->breakpoints[span.first];
    verdict_.pair = pair, verdict_.distance = distance, verdict_.touches = touches;
    verdict_.time = begin + std::max(span.middle - span.half, 0.0);
    return false;
}

// Whether a pair is proved on a span; if not, whether it failed is told by `verdict_.pair`.
bool IntervalProof::settle(int pair, const Span &span) {
    const Pair &both = world_.pairs()[pair];
    const bool part = span.half > 0.0;
    const double clearance = rules_.clearance[kinds_[pair]];
    const double moved = travel(pair), wanted = clearance + rules_.worth, enough = wanted + moved + ROUNDING;
    double bound = -HUGE_VAL;
    if (!world_.bodies()[both.a].half_space && !world_.bodies()[both.b].half_space) {
        const double far = norm(at_.centres[both.b] - at_.centres[both.a]) - world_.bodies()[both.a].radius -
                           world_.bodies()[both.b].radius;
        if (far > enough) return settled(pair, far - moved - ROUNDING);
    }
    const double boxes = world_.lower_bound(at_, pair);
    if (boxes > enough) return settled(pair, boxes - moved - ROUNDING);
    const double known = kept(pair);
    if (known > clearance + ROUNDING) return settled(pair, known);
    if (separated(pair, enough, bound)) return settled(pair, bound - moved - ROUNDING);
    if (!part) return false;
    const Shape &a = world_.bodies()[both.a].outline(), &b = world_.bodies()[both.b].outline();
    double distance = bound;
    Vec3 n = normals_[pair];
    if (!sides_[pair].plane) {
        const Witness w = optiplan::distance(a, at_.bodies[both.a], b, at_.bodies[both.b], HUGE_VAL, &features_[pair]);
        distance = w.distance;
        if (w.distance > 0.0) {
            normals_[pair] = n = w.normal;
            bound = gap(pair, n);
        }
    }
    if (!sides_[pair].convex && distance <= enough) {
        const double solid = world_.distance(at_, pair, HUGE_VAL).distance - MESH_ROUNDING;
        if (solid > bound) bound = distance = solid, n = {};
    }
    if (distance <= clearance + ROUNDING) return fail(pair, span, distance, true);
    double margin = bound - moved;
    if (sides_[pair].plane || squared_norm(n) > 0.0) {
        const bool first = world_.bodies()[both.a].half_space, second = world_.bodies()[both.b].half_space;
        if (first) n = at_.bodies[both.a].R * world_.bodies()[both.a].normal;
        if (second) n = -(at_.bodies[both.b].R * world_.bodies()[both.b].normal);
        margin = std::max(margin, linear(pair, n, span.half));
    }
    margin -= ROUNDING;
    const double over = std::min(rules_.worth, rules_.share * (bound - clearance));
    if (margin > clearance && margin >= clearance + over) return settled(pair, margin);
    if (2.0 * span.half <= rules_.narrowest) {
        if (margin > clearance) return settled(pair, margin);
        return fail(pair, span, bound, false);
    }
    return false;
}

bool IntervalProof::prove_span(const Span &span, std::size_t begin, std::size_t end) {
    if (++verdict_.intervals > rules_.most) return fail(open_[begin], span, -HUGE_VAL, false);
    box_of(span);
    stand();
    const std::size_t own = open_.size();
    for (std::size_t k = begin; k < end; ++k) {
        const int pair = open_[k];
        if (settle(pair, span)) continue;
        if (verdict_.pair >= 0) return false;
        open_.push_back(pair);
    }
    const std::size_t after = open_.size();
    bool proved = true;
    if (after > own) {
        Span halves[2];
        if (span.half > 0.0) {
            const double half = 0.5 * span.half;
            halves[0] = {span.first, span.last, span.middle - half, half};
            halves[1] = {span.first, span.last, span.middle + half, half};
        } else if (span.last - span.first == 1) {
            const double width = curve_->breakpoints[span.last] - curve_->breakpoints[span.first];
            halves[0] = {span.first, span.last, 0.5 * width, 0.5 * width};
            proved = prove_span(halves[0], own, after);
            open_.resize(own);
            return proved;
        } else {
            const int middle = (span.first + span.last) / 2;
            halves[0] = {span.first, middle, 0.0, 0.0}, halves[1] = {middle, span.last, 0.0, 0.0};
            for (Span &half : halves)
                if (half.last - half.first == 1) {
                    const double width = curve_->breakpoints[half.last] - curve_->breakpoints[half.first];
                    half.middle = half.half = 0.5 * width;
                }
        }
        proved = prove_span(halves[0], own, after) && prove_span(halves[1], own, after);
    }
    open_.resize(own);
    return proved;
}

Verdict IntervalProof::prove(const Curve &curve, const IntervalRules &rules) {
    rules_ = rules, verdict_ = {};
    std::fill(normals_.begin(), normals_.end(), Vec3{});
    std::fill(features_.begin(), features_.end(), Features{});
    build(curve);
    open_.clear();
    for (int pair = 0; pair < static_cast<int>(world_.pairs().size()); ++pair) open_.push_back(pair);
    const int pieces = static_cast<int>(curve.breakpoints.size()) - 1;
    rules_.most += rules_.most_of_piece * pieces;
    const Span whole{0, pieces, 0.0, 0.0};
    if (!open_.empty()) prove_span(whole, 0, open_.size());
    return verdict_;
}

}  // namespace optiplan
