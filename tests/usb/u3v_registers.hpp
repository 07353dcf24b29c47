// SPDX-License-Identifier: BSD-3-Clause
// What USB3 Vision adds to the features of an emulated camera: bootstrap registers and nodes of the
// description.
#pragma once

#include "camera_registers.hpp"

namespace versavis::test {

/// Addresses of GenCP's ABRM, and of USB3 Vision's SBRM, SIRM and manifest table. Numbers are
/// little-endian.
enum U3vRegister : std::uint32_t {
    abrm_gencp_version = 0x0000,
    abrm_vendor = 0x0004,
    abrm_model = 0x0044,
    abrm_device_version = 0x00C4,
    abrm_serial = 0x0144,
    abrm_capability = 0x01C4,
    abrm_response_ms = 0x01CC,
    abrm_manifest = 0x01D0,
    abrm_sbrm = 0x01D8,
    abrm_timestamp = 0x01F0,
    abrm_timestamp_latch = 0x01F8,
    abrm_timestamp_increment = 0x01FC,

    sbrm_version = 0x1000,
    sbrm_capability = 0x1004,
    sbrm_max_command = 0x1014,
    sbrm_max_acknowledge = 0x1018,
    sbrm_stream_channels = 0x101C,
    sbrm_sirm = 0x1020,
    sbrm_sirm_length = 0x1028,
    sbrm_speed = 0x1040,

    sirm_info = 0x2000,
    sirm_control = 0x2004,
    sirm_required_payload = 0x2008,
    sirm_required_leader = 0x2010,
    sirm_required_trailer = 0x2014,
    sirm_max_leader = 0x2018,
    sirm_payload_size = 0x201C,

    manifest = 0x3000,
};

constexpr std::uint16_t u3v_leader_size = 52;
constexpr std::uint16_t u3v_trailer_size = 36;      ///< with chunks
constexpr std::uint32_t u3v_control_packet = 1024;  ///< the largest, either way

rig::TransportMemory u3v_memory(const rig::CameraScenario& settings,
                                const rig::CameraFamily& family);

}  // namespace versavis::test
