// SPDX-License-Identifier: BSD-3-Clause
#include "board/byte_stream.hpp"

#include "board/unix_stream.hpp"
#include "board/usb_stream.hpp"

namespace versavis::daemon {

Expected<std::unique_ptr<ByteStream>> open_byte_stream(const BoardConfiguration& configuration) {
    constexpr std::string_view unix_prefix = "unix:";
    if (configuration.link.rfind(unix_prefix, 0) == 0)
        return open_unix_stream(configuration.link.substr(unix_prefix.size()));
    return open_usb_stream(configuration);
}

}  // namespace versavis::daemon
