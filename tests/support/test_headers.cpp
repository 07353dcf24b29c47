// SPDX-License-Identifier: BSD-3-Clause
// CMake makes a precompiled header only together with a source.
#include "test_headers.hpp"
