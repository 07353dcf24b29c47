// SPDX-License-Identifier: BSD-3-Clause
// Whether a ring fits into what memory is free, asked before it takes any.
#pragma once

#include <cstdint>
#include <filesystem>

#include "versavis/error.hpp"

namespace versavis::ring {

/// `size` bytes more for `ring` (its path). A tmpfs gives out more than the machine has, and the
/// kernel then ends a process of its choice: so both limits count. `memory` is a file like
/// /proc/meminfo; where it does not tell, the file system alone decides. Errors: does not fit.
Expected<> check_room(const std::filesystem::path& ring, std::uint64_t size,
                      const std::filesystem::path& memory = "/proc/meminfo");

/// The same of memory that is in no file system.
Expected<> check_memory(const std::filesystem::path& ring, std::uint64_t size,
                        const std::filesystem::path& memory = "/proc/meminfo");

}  // namespace versavis::ring
