// SPDX-License-Identifier: BSD-3-Clause
// The status of a service: which devices it has, how they are, and what to do.
#pragma once

#include <string>

#include "versavis/stream.hpp"

namespace versavis {

/// The newest status document, as JSON (docs/contracts/status.md); it waits for one up to 3 s.
/// Errors: absent, forbidden and others of Stream::open; other: the service has died or hangs, or
/// has published none yet.
VERSAVIS_API Expected<std::string> read_status(const StreamOptions& options = {});

}  // namespace versavis
