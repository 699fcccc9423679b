// Each part of the core registers its classes and functions with the module here.
#pragma once

#include <nanobind/nanobind.h>

