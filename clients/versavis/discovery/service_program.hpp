// SPDX-License-Identifier: BSD-3-Clause
// Runs the service's program for what it knows beside serving: it is linked with what a camera
// takes, and has the table of keys.
#pragma once

#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

struct ProgramResult {
    int exit_code = 0;
    std::string output;  ///< standard output
};

/// The versavisd that is installed beside this program. Its standard error is this program's.
Expected<ProgramResult> run_versavisd(std::vector<std::string> arguments);

}  // namespace versavis::client
