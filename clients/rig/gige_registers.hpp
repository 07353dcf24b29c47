// SPDX-License-Identifier: BSD-3-Clause
// What GigE Vision adds to the features of an emulated camera: bootstrap registers and nodes of the
// description.
#pragma once

#include <cstdint>
#include <string>

#include "camera_registers.hpp"

namespace versavis::rig {

/// Addresses of bootstrap registers (GigE Vision specification 1.2, chapter 28). Numbers are
/// big-endian.
enum GigeRegister : std::uint32_t {
    reg_version = 0x0000,
    reg_device_mode = 0x0004,
    reg_mac_high = 0x0008,
    reg_mac_low = 0x000C,
    reg_current_ip = 0x0024,
    reg_current_mask = 0x0034,
    reg_vendor = 0x0048,
    reg_model_name = 0x0068,
    reg_device_version = 0x0088,
    reg_serial = 0x00D8,
    reg_user_name = 0x00E8,  ///< the first one that can be written
    reg_xml_url = 0x0200,
    reg_interface_count = 0x0600,
    reg_message_count = 0x0900,
    reg_stream_count = 0x0904,
    reg_action_device_key = 0x090C,
    reg_capabilities = 0x0934,
    reg_heartbeat_ms = 0x0938,
    reg_tick_low = 0x0940,
    reg_clock_latched = 0x0948,  ///< 64 bits
    reg_action_queue_size = 0x0970,
    reg_control_privilege = 0x0A00,
    reg_message_port = 0x0B00,
    reg_message_address = 0x0B10,
    reg_stream_port = 0x0D00,
    reg_stream_packet_size = 0x0D04,
    reg_stream_packet_delay = 0x0D08,
    reg_stream_address = 0x0D18,
    reg_stream_source_port = 0x0D1C,
    reg_action_group_key = 0x9800,
    reg_action_group_mask = 0x9804,
};

TransportMemory gige_memory(const CameraScenario& settings, const CameraFamily& family);

/// The GenICam description.
std::string gige_xml(std::uint32_t width, std::uint32_t height,
                     const CameraFamily& family = rig_family());

}  // namespace versavis::rig
