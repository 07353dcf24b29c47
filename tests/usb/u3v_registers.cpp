// SPDX-License-Identifier: BSD-3-Clause
#include "u3v_registers.hpp"

#include <algorithm>
#include <cstring>

#include "bytes.hpp"
#include "camera_xml.hpp"

namespace versavis::test {

namespace {

constexpr std::size_t bootstrap_size = 0x4000;
constexpr std::size_t text_size = 64;
constexpr std::uint32_t response_ms = 100;

std::string u3v_xml(const rig::CameraScenario& settings, const rig::CameraFamily& family) {
    rig::XmlWriter xml;
    xml.text("DeviceVendorName", abrm_vendor, text_size);
    xml.text("DeviceModelName", abrm_model, text_size);
    xml.text("DeviceVersion", abrm_device_version, text_size);
    xml.text("DeviceSerialNumber", abrm_serial, text_size);
    xml.features(settings.width, settings.height, family);
    return xml.document("U3V", family);
}

}  // namespace

rig::TransportMemory u3v_memory(const rig::CameraScenario& settings,
                                const rig::CameraFamily& family) {
    rig::TransportMemory memory{std::vector<std::uint8_t>(bootstrap_size),
                                u3v_xml(settings, family), std::endian::little};
    const auto set = [&](std::uint32_t address, std::uint64_t value, std::size_t size) {
        rig::store_number(std::span(memory.registers).subspan(address, size), value,
                          std::endian::little);
    };
    const auto set_text = [&](U3vRegister address, const std::string& text) {
        std::memcpy(memory.registers.data() + address, text.data(),
                    std::min(text.size(), text_size - 1));
    };
    set(abrm_gencp_version, 0x00010001, 4);
    set_text(abrm_vendor, family.vendor);
    set_text(abrm_model, family.model);
    set_text(abrm_device_version, "1.0");
    set_text(abrm_serial, settings.serial);
    set(abrm_capability, 1U << 8U, 8);  // timestamp
    set(abrm_response_ms, response_ms, 4);
    set(abrm_manifest, manifest, 8);
    set(abrm_sbrm, sbrm_version, 8);
    set(abrm_timestamp_increment, 1, 4);
    set(sbrm_version, 0x00010000, 4);
    set(sbrm_capability, 1, 8);  // SIRM available
    set(sbrm_max_command, u3v_control_packet, 4);
    set(sbrm_max_acknowledge, u3v_control_packet, 4);
    set(sbrm_stream_channels, 1, 4);
    set(sbrm_sirm, sirm_info, 8);
    set(sbrm_sirm_length, 0x30, 4);
    set(sbrm_speed, 8, 4);  // SuperSpeed
    set(sirm_required_leader, u3v_leader_size, 4);
    set(sirm_required_trailer, u3v_trailer_size, 4);
    set(manifest, 1, 8);  // entries
    constexpr std::uint32_t entry = manifest + 8;
    set(entry, 0x01000000, 4);      // version
    set(entry + 4, 0x01010000, 4);  // schema 1.1, device XML, not compressed
    set(entry + 8, rig::reg_xml, 8);
    set(entry + 16, memory.description.size(), 8);
    return memory;
}

}  // namespace versavis::test
