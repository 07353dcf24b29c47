// SPDX-License-Identifier: BSD-3-Clause
// Marks a segment as superseded or closed, and wakes its readers.
#pragma once

#include "versavis/ring_layout.hpp"

namespace versavis::ring {

/// Marks it as one that has a successor, or soon will have. Its readers sleep on.
void supersede(Header& header);

/// It has none after all.
void reinstate(Header& header);

void wake_readers(Header& header);

/// Marks it as closed, and wakes its readers.
void end(Header& header);

}  // namespace versavis::ring
