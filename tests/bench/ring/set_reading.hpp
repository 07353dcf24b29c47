// SPDX-License-Identifier: BSD-3-Clause
// What it costs to have the frames of two cameras matched, and given the samples between them.
#pragma once

namespace versavis::bench {

struct SetReading {
    double bare_cpu_ns = 0;  ///< of reading three rings in one thread, and no more
    double set_cpu_ns = 0;   ///< of SetReader
};

/// Adds a run of either consumer to `cost`. Throws when one of them received too little.
void read_sets(SetReading& cost);

}  // namespace versavis::bench
