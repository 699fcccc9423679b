#include "hull.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <stdexcept>

namespace optiplan {

namespace {

constexpr std::uint32_t kBlock = 4;  // cells along an edge of a block
constexpr std::uint32_t kNone = 0;   // others of a cell of two
constexpr std::size_t kMany = 2000;  // candidates of a cell that are not compared with each other, one by one
constexpr double kRounding =
    1e-13;  // of a dot product, as a part of the extent: a vertex is left out by more than that

// Cells along an edge of the cube, a power of two.
std::uint32_t cells_for(std::size_t points) { return points <= 8 ? 1 : points <= 32 ? 4 : points <= 400 ? 16 : 32; }

}  // namespace

// Cells of one face of the cube: `size` of them along each edge, from cell (i, j) on.
struct Hull::Square {
    std::uint32_t face;  // twice the axis, and 1 for the negative side
    std::uint32_t i, j, size;

    Vec3 direction(double u, double v) const {
        const double major = face % 2 ? -1.0 : 1.0;
        return face / 2 == 0 ? Vec3{major, u, v} : face / 2 == 1 ? Vec3{v, major, u} : Vec3{u, v, major};
    }
};

Hull::Hull(std::vector<Vec3> points) : points_(std::move(points)), edge_cells_(cells_for(points_.size())) {
    if (points_.empty()) throw std::invalid_argument("a hull takes one point or more");
    Vec3 low = points_[0], high = points_[0];
    for (const Vec3 &p : points_) {
        if (!std::isfinite(p.x + p.y + p.z)) throw std::invalid_argument("a hull of points that are not finite");
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    centre_ = 0.5 * (low + high), half_ = 0.5 * (high - low), radius_ = 0.0;
    for (const Vec3 &p : points_) radius_ = std::max(radius_, norm(p - centre_));
}

// Lists the cell asked for.
const Hull::Cell *Hull::list(std::uint32_t asked) const {
    const std::lock_guard<std::mutex> one(listing_);
    const std::uint32_t in_face = edge_cells_ * edge_cells_, size = std::min(edge_cells_, kBlock);
    if (!all_) all_ = std::make_unique<Cell[]>(6 * in_face), cells_.store(all_.get(), std::memory_order_release);
    Cell &listed = all_[asked];
    if (listed.others.load(std::memory_order_relaxed)) return all_.get();
    const std::uint32_t face = asked / in_face, i = asked % in_face / edge_cells_, j = asked % edge_cells_;
    const Square block = {face, i - i % size, j - j % size, size};
    Candidates &of_block = blocks_[(face * edge_cells_ + block.i) * edge_cells_ + block.j];
    if (of_block.empty()) {
        of_block.resize(points_.size());
        std::iota(of_block.begin(), of_block.end(), 0u);
        of_block = kept_in(block, of_block);
    }
    const Candidates cell = size > 1 ? kept_in({face, i, j, 1}, of_block) : of_block;
    listed.first[0] = cell[0], listed.first[1] = cell[cell.size() > 1];
    if (cell.size() <= 2) {
        listed.others.store(&kNone, std::memory_order_release);
        return all_.get();
    }
    Candidates &more = more_.emplace_back();
    more.push_back(std::uint32_t(cell.size() - 2));
    more.insert(more.end(), cell.begin() + 2, cell.end());
    listed.others.store(more.data(), std::memory_order_release);
    return all_.get();
}

// The candidates that no other one beats along all four corners of a square. Directions within it are positive sums of
// its corners, so a vertex that another one beats along all four is never the farthest.
Hull::Candidates Hull::kept_in(const Square &square, const Candidates &candidates) const {
    const double step = 2.0 / edge_cells_, slack = kRounding * (norm(centre_) + radius_);
    const double u = -1.0 + step * square.i, v = -1.0 + step * square.j, side = step * square.size;
    const Vec3 corners[4] = {square.direction(u, v), square.direction(u + side, v), square.direction(u, v + side),
                             square.direction(u + side, v + side)};
    Candidates kept = candidates;
    const auto drop_beaten_by = [&](std::uint32_t best) {
        const auto beaten = [&](std::uint32_t other) {
            const Vec3 ahead = points_[best] - points_[other];
            return std::all_of(corners, corners + 4, [&](const Vec3 &corner) { return dot(ahead, corner) > slack; });
        };
        kept.erase(std::remove_if(kept.begin(), kept.end(), beaten), kept.end());
    };
    const Vec3 middle = square.direction(u + 0.5 * side, v + 0.5 * side);
    for (const Vec3 &d : {middle, corners[0], corners[1], corners[2], corners[3]})
        drop_beaten_by(*std::max_element(kept.begin(), kept.end(), [&](std::uint32_t a, std::uint32_t b) {
            return dot(points_[a], d) < dot(points_[b], d);
        }));
    if (square.size == 1 && kept.size() <= kMany)
        for (std::uint32_t one : Candidates(kept)) drop_beaten_by(one);
    return kept;
}

}  // namespace optiplan
