// Random numbers that are the same on every machine.
#pragma once

#include <cstddef>
#include <cstdint>

namespace optiplan {

// xoshiro256**, seeded by splitmix64. Source: Blackman and Vigna, "Scrambled linear pseudorandom number generators",
// ACM Transactions on Mathematical Software 47, 2021.
class Random {
  public:
    explicit Random(std::uint64_t seed) {
        for (std::uint64_t &word : state_) {
            std::uint64_t z = (seed += 0x9e3779b97f4a7c15u);
            z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
            z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
            word = z ^ (z >> 31);
        }
    }

    // Uniform in [0, 1).
    double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

    // Uniform in [0, count).
    std::size_t below(std::size_t count) { return static_cast<std::size_t>(uniform() * static_cast<double>(count)); }

  private:
    static std::uint64_t turned(std::uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }

    std::uint64_t next() {
        const std::uint64_t result = turned(state_[1] * 5, 7) * 9, shifted = state_[1] << 17;
        state_[2] ^= state_[0], state_[3] ^= state_[1], state_[1] ^= state_[2], state_[0] ^= state_[3];
        state_[2] ^= shifted;
        state_[3] = turned(state_[3], 45);
        return result;
    }

    std::uint64_t state_[4];
};

}  // namespace optiplan
