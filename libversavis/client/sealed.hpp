// SPDX-License-Identifier: BSD-3-Clause
// A sealed segment: memory without a name, which nobody can cut short under its readers. The socket
// that has the stream's name hands it to whoever may connect.
#pragma once

#include <cstdint>
#include <filesystem>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// True when nobody, its maker included, can change the file's size, or map it for writing anew.
bool is_sealed(int file);

/// From the socket, open with O_PATH, of the user who must be its peer. Waits for a second at most.
/// Errors: nobody there, another user, or what came is not sealed. `path` is for messages.
Expected<FileDescriptor> fetch_sealed(int socket, const std::filesystem::path& path,
                                      std::uint32_t owner);

}  // namespace versavis::ring
