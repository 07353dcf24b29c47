// SPDX-License-Identifier: BSD-3-Clause
// Opens a segment only if it belongs to whom it should, and nobody else could have put it there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// Errors: not there, no permission, of another owner, or in a directory that others can write.
Expected<File> open_trusted(const std::filesystem::path& path, std::optional<std::uint32_t> owner);

}  // namespace versavis::ring
