// SPDX-License-Identifier: BSD-3-Clause
// A sealed segment: anonymous memory that nobody can truncate under its readers. The socket with
// the stream's name passes it to every client that may connect.
#pragma once

#include <cstdint>
#include <filesystem>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// True when nobody, its creator included, can change the file's size or map it for writing again.
bool is_sealed(int file);

/// From the socket, open with O_PATH, of the user who must be its peer. Waits for a second at most.
/// Errors: nobody is listening, the peer is another user, or the received file is not sealed.
/// `path` is for messages.
Expected<FileDescriptor> fetch_sealed(int socket, const std::filesystem::path& path,
                                      std::uint32_t owner);

}  // namespace versavis::ring
