// SPDX-License-Identifier: BSD-3-Clause
// Opens a segment only if it belongs to whom it should, and nobody else could have put it there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// Who may own streams: `named`; or the user whose name or number is in $VERSAVIS_OWNER; without it
/// root, this process's user, or `versavis`.
bool may_own(std::uint32_t user, std::optional<std::uint32_t> named);

/// A sealed segment is fetched from the socket that has its name. Errors: not there, no permission,
/// of another owner, in a directory that others can write, or not handed over.
Expected<NamedFile> open_trusted(const std::filesystem::path& path,
                                 std::optional<std::uint32_t> owner);

}  // namespace versavis::ring
