// Runs the tests of all files whose name holds the argument; exit code 1 where a check fails, or none is made.
#include "check.hpp"

#include <cstring>
#include <exception>

namespace {

int checks = 0, failures = 0;

}  // namespace

std::vector<Test> &tests() {
    static std::vector<Test> all;
    return all;
}

void count_check(bool holds, const char *what, const char *file, int line) {
    ++checks;
    if (!holds && ++failures <= 20) std::printf("%s:%d: does not hold: %s\n", file, line, what);
}

int main(int count, char **arguments) {
    int ran = 0;
    for (const Test &test : tests()) {
        if (count > 1 && !std::strstr(test.file, arguments[1])) continue;
        const int before = failures;
        try {
            test.run();
        } catch (const std::exception &error) { count_check(false, error.what(), test.file, 0); }
        if (failures > before) std::printf("FAILED %s\n", test.name);
        ++ran;
    }
    std::printf("%d tests, %d checks, %d failed\n", ran, checks, failures);
    return ran == 0 || checks == 0 || failures > 0;
}
