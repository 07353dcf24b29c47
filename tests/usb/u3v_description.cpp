// SPDX-License-Identifier: BSD-3-Clause
#include "u3v_description.hpp"

#include <cstdint>
#include <cstdio>

namespace versavis::test {

UsbDescription u3v_description(const std::string& vendor, const std::string& model,
                               const std::string& serial) {
    UsbDescription usb;
    usb.speed_mbit = 5000;
    // clang-format off
    usb.device = {
        18, 1, 0x00, 0x03,  // USB 3.0
        0xef, 2, 1,         // class by interface association: required
        9, 0x09, 0x12, 0x54, 0x56, 0x00, 0x01,
        1, 2, 3,            // manufacturer, product, serial
        1};
    usb.configuration = {
        9, 2, 0, 0, 2, 1, 0, 0x80, 112,
        8, 11, 0, 2, 0xef, 5, 0, 0,     // association: interfaces 0 and 1 are one camera
        9, 4, 0, 0, 2, 0xef, 5, 0, 0,   // interface 0: control
        20, 0x24, 1, 1, 0, 1, 0, 0, 0, 1, 0,  // GenCP 1.1, USB3 Vision 1.0
            4, 1, 2, 0, 0, 0, 3, 0, 8,  // strings: GUID, vendor, model, family, version,
                                        // information, serial, user name; SuperSpeed
        7, 5, u3v_control_in, 2, 0x00, 0x04, 0,
        6, 0x30, 0, 0, 0, 0,
        7, 5, u3v_control_out, 2, 0x00, 0x04, 0,
        6, 0x30, 0, 0, 0, 0,
        9, 4, 1, 0, 1, 0xef, 5, 2, 0,   // interface 1: data
        7, 5, u3v_data_in, 2, 0x00, 0x04, 0,
        6, 0x30, 15, 0, 0, 0};
    // clang-format on
    usb.configuration[2] = static_cast<std::uint8_t>(usb.configuration.size());
    // A GUID is 4 digits of the vendor and 8 of the device.
    std::uint32_t hash = 2166136261U;
    for (char c : serial) hash = (hash ^ static_cast<std::uint8_t>(c)) * 16777619U;
    char guid[16];
    std::snprintf(guid, sizeof guid, "5656%08X", hash);
    usb.strings = {vendor, model, serial, guid};
    return usb;
}

}  // namespace versavis::test
