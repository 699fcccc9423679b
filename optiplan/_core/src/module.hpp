// Each part of the core registers its classes and functions with the module here.
#pragma once

#include <nanobind/nanobind.h>

namespace optiplan {

void bind_convex(nanobind::module_ &m);
void bind_world(nanobind::module_ &m);
void bind_kinematics(nanobind::module_ &m);
void bind_search(nanobind::module_ &m);
void bind_program(nanobind::module_ &m);
void bind_control(nanobind::module_ &m);
void bind_step(nanobind::module_ &m);
void bind_execution(nanobind::module_ &m);
void bind_chunks(nanobind::module_ &m);
void bind_verify(nanobind::module_ &m);
void bind_bounds(nanobind::module_ &m);

}  // namespace optiplan
