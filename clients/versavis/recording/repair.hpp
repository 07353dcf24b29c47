// SPDX-License-Identifier: BSD-3-Clause
// Makes a recording whole that was cut off: up to its last whole chunk, with the summary that it
// would have if it had been closed there. After a loss of power chunks in its middle may be
// damaged, too, for a disk writes in an order of its own.
#pragma once

#include <cstdint>
#include <string>

#include "versavis/error.hpp"

namespace versavis::client {

struct RepairReport {
    std::string file;        ///< that is whole now
    bool was_whole = false;  ///< nothing was done
    std::string defect;      ///< what it was
    std::uint64_t chunks = 0;
    std::uint64_t messages = 0;
    std::uint64_t cut_bytes = 0;  ///< behind the last chunk that is kept
    std::string cut_file;         ///< where they are now; empty: there were none, or `output`
};

/// Repairs `path` in place, and keeps what it cuts off in `path`.cut; or, with `output`, writes a
/// new file and leaves the old one alone. Errors: another process writes the file, the disk is
/// full, `path`.cut or `output` is there already, not even one record is whole, a chunk is damaged
/// though others follow it. With `cut` the file ends before such a chunk.
Expected<RepairReport> repair(const std::string& path, const std::string& output, bool cut = false);

std::string to_text(const RepairReport& report, bool json);

}  // namespace versavis::client
