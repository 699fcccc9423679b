// Tests of the core: `TEST(name) { CHECK(…); }` in a file of its own; main.cpp runs those of the file that is named.
#pragma once

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

struct Test {
    const char *file, *name;
    void (*run)();
};

std::vector<Test> &tests();
void count_check(bool holds, const char *what, const char *file, int line);

struct Registered {
    Registered(const char *file, const char *name, void (*run)()) { tests().push_back({file, name, run}); }
};

// Numbers in [low, high], the same in every run.
inline double uniform(double low, double high) {
    static std::mt19937_64 generator(1);
    return low + (high - low) * (static_cast<double>(generator() >> 11) * 0x1.0p-53);
}

#define TEST(name)                                                                                                     \
    static void name();                                                                                                \
    static const Registered registered_##name(__FILE__, #name, name);                                                  \
    static void name()
#define CHECK(holds) count_check(holds, #holds, __FILE__, __LINE__)
#define NEAR(a, b, tolerance) count_check(std::fabs((a) - (b)) <= (tolerance), #a " = " #b, __FILE__, __LINE__)
