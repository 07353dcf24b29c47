// SPDX-License-Identifier: BSD-3-Clause
// Makes a recording whole. One that was cut off gets the summary that it would have if it had been
// closed there; of one that is damaged elsewhere, all that can be read goes into a new file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

struct RepairReport {
    std::string file;        ///< that is whole now
    bool was_whole = false;  ///< nothing was done
    std::string defect;      ///< what it was
    std::uint64_t chunks = 0;
    std::uint64_t messages = 0;
    std::uint64_t cut_bytes = 0;        ///< behind the last chunk that is kept
    std::string cut_file;               ///< where they are now; empty: there were none, or `output`
    std::vector<std::string> left_out;  ///< what is damaged elsewhere, each with its place
    std::string old_file;  ///< where the damaged file is now; empty: where it was, or it is no more
};

/// Repairs `path` in place, and keeps what it cuts off in `path`.cut; or, with `output`, writes a
/// new file and leaves the old one alone. Of a file with damage before its end, or with messages
/// outside of chunks, a new file has all that can be read, and the old one becomes `path`.damaged.
/// With `cut` such a file ends before the first damaged chunk instead. Errors: another process
/// writes the file, the disk is full, one of these files is there already, not even one record is
/// whole.
Expected<RepairReport> repair(const std::string& path, const std::string& output, bool cut = false);

std::string to_text(const RepairReport& report, bool json);

}  // namespace versavis::client
