// SPDX-License-Identifier: BSD-3-Clause
// Whether a ring fits into the free memory; checked before it allocates any.
#pragma once

#include <cstdint>
#include <filesystem>

#include "versavis/error.hpp"

namespace versavis::ring {

/// `size` bytes more for `ring` (its path). A tmpfs may promise more than the machine has, and the
/// kernel then kills a process of its choice: so both limits count. `memory` is a file like
/// /proc/meminfo; if it has no such entry, the file system alone decides. Errors: does not fit.
Expected<> check_tmpfs_space(const std::filesystem::path& ring, std::uint64_t size,
                             const std::filesystem::path& memory = "/proc/meminfo");

/// The same of memory that is in no file system.
Expected<> check_memory(const std::filesystem::path& ring, std::uint64_t size,
                        const std::filesystem::path& memory = "/proc/meminfo");

}  // namespace versavis::ring
