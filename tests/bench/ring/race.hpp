// SPDX-License-Identifier: BSD-3-Clause
// Sends a load over a transport, with a process for the writer and one for each reader.
#pragma once

#include <vector>

#include "transport.hpp"
#include "versavis/time.hpp"

namespace versavis::bench {

enum class Reading {
    ends,      ///< header, first and last bytes
    all_bytes  ///< everything
};

struct Load {
    std::size_t size = imu_size;
    unsigned readers = 1;
    bool polling = false;
    unsigned items = 400;
    Duration interval = milliseconds(1);  ///< 0: as fast as it goes
    Reading reading = Reading::ends;
};

/// Of several runs. Delays are from the writer's call to the end of reading, by stamps in the
/// items; the first items of each run do not count.
struct Outcome {
    std::vector<double> delays_ns;
    std::vector<double> publish_ns;  ///< how long the writer's calls took
    double sent = 0;
    double cpu_ns = 0;  ///< of the writer and its readers, for all items sent
    double page_faults = 0;
    double bytes = 0;  ///< read in `seconds`
    double seconds = 0;

    double cpu_ns_per_item() const { return cpu_ns / sent; }
    double bytes_per_second() const { return bytes / seconds; }
};

/// Adds a run to `outcome`. Throws when a process fails.
void race(const Transport& transport, const Load& load, Outcome& outcome);

/// `part` 0.5: the median. Throws when there are no values.
double quantile(std::vector<double> values, double part);

}  // namespace versavis::bench
