// The extension module `_core_base`, `_core_avx2` or `_core_avx512`: one function a part, in the part's own file.
#include <nanobind/nanobind.h>

#include "module.hpp"

namespace nb = nanobind;

NB_MODULE(CORE_MODULE, m) {
    m.doc() = "Native core of optiplan.";
    (void)m;
}
