// SPDX-License-Identifier: BSD-3-Clause
// Changes what is safe to change while everything runs: values of the kernel that the next boot
// sets back.
#pragma once

#include "doctor/finding.hpp"
#include "doctor/host_files.hpp"

namespace versavis::client {

/// Those that were changed are marked; those that could not be say why.
void apply_fixes(const HostFiles& files, Findings& findings);

}  // namespace versavis::client
