// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <sysexits.h>

#include <cstdio>

#include "versavis/error.hpp"

namespace versavis::client {

/// Says what is wrong, and returns the exit code.
inline int fail(const Error& error, int code = EX_UNAVAILABLE) {
    fmt::print(stderr, "versavis: {}\n", error.message());
    return code;
}

}  // namespace versavis::client
