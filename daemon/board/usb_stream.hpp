// SPDX-License-Identifier: BSD-3-Clause
// The board on USB: bulk endpoints of its CDC-ACM function, through libusb, without the kernel's
// tty in between.
#pragma once

#include <memory>

#include "board/byte_stream.hpp"

namespace versavis::daemon {

/// Finds the board by vendor, product and, if given, serial number; endpoints by its descriptors.
Expected<std::unique_ptr<ByteStream>> open_usb_stream(const BoardConfiguration& configuration);

}  // namespace versavis::daemon
