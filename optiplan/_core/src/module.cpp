// The extension module `_core_base`, `_core_avx2` or `_core_avx512`.
#include "module.hpp"

NB_MODULE(CORE_MODULE, m) {
    m.doc() = "Native core of optiplan.";
    nanobind::set_leak_warnings(false);  // objects may live as long as the process
    optiplan::bind_convex(m);
    optiplan::bind_world(m);
    optiplan::bind_kinematics(m);
    optiplan::bind_search(m);
    optiplan::bind_program(m);
    optiplan::bind_control(m);
    optiplan::bind_step(m);
    optiplan::bind_execution(m);
    optiplan::bind_chunks(m);
    optiplan::bind_verify(m);
    optiplan::bind_bounds(m);
}
