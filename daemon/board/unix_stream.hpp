// SPDX-License-Identifier: BSD-3-Clause
// The board behind a unix socket: the firmware as a host process.
#pragma once

#include <memory>
#include <string>

#include "board/byte_stream.hpp"

namespace versavis::daemon {

Expected<std::unique_ptr<ByteStream>> open_unix_stream(const std::string& path);

}  // namespace versavis::daemon
