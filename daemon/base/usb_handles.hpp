// SPDX-License-Identifier: BSD-3-Clause
// What libusb hands out, owned.
#pragma once

#include <libusb.h>

#include <array>
#include <memory>
#include <string>

namespace versavis::daemon {

struct UsbContextDeleter {
    void operator()(libusb_context* context) const { libusb_exit(context); }
};
struct UsbHandleDeleter {
    void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
};
using UsbContext = std::unique_ptr<libusb_context, UsbContextDeleter>;
using UsbHandle = std::unique_ptr<libusb_device_handle, UsbHandleDeleter>;

/// The device's text of this index; empty: it has none.
inline std::string text_descriptor(libusb_device_handle* handle, std::uint8_t index) {
    std::array<unsigned char, 256> text{};
    const int size = libusb_get_string_descriptor_ascii(handle, index, text.data(),
                                                        static_cast<int>(text.size()));
    return size > 0 ? std::string(reinterpret_cast<const char*>(text.data()),
                                  static_cast<std::size_t>(size))
                    : "";
}

}  // namespace versavis::daemon
