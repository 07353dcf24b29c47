// SPDX-License-Identifier: BSD-3-Clause
#include "gige_registers.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace versavis::rig {

namespace {

constexpr std::size_t least_description = 0x20000;
constexpr std::uint32_t tick_frequency = 1'000'000'000;
constexpr std::uint32_t capability_write_memory = 1U << 1U;
constexpr std::uint32_t capability_resend = 1U << 2U;

}  // namespace

GigeRegisters::GigeRegisters(const Identity& identity)
    : identity_(identity),
      description_(
          describe_camera(identity.hostility, gige_xml(identity.width, identity.height), reg_xml)),
      memory_(reg_xml + std::max(description_.bytes.size(), least_description)) {
    reset();
}

void GigeRegisters::reset() {
    const std::lock_guard lock(mutex_);
    std::fill(memory_.begin(), memory_.end(), std::uint8_t{0});
    line_modes_ = {};
    const std::uint32_t ip = ntohl(inet_addr(identity_.address.c_str()));
    set(reg_version, 0x00010002);
    set(reg_device_mode, 0x80000001);  // big-endian, UTF-8
    set(reg_mac_high, 0x0200);         // locally administered
    set(reg_mac_low, ip);
    set(reg_current_ip, ip);
    set(reg_current_mask, 0xFF000000);
    set_text(reg_vendor, "VersaVIS", 32);
    set_text(reg_model, "RigCamera", 32);
    set_text(reg_device_version, "1.0", 32);
    set_text(reg_serial, identity_.serial, 16);
    set_text(reg_user_name, identity_.name, 16);
    set_text(reg_xml_url, description_.url, 512);
    std::memcpy(memory_.data() + reg_xml, description_.bytes.data(), description_.bytes.size());
    set(reg_interface_count, 1);
    set(reg_message_count, identity_.events ? 1 : 0);
    set(reg_stream_count, 1);
    set(reg_capabilities, capability_write_memory | capability_resend);
    set(reg_heartbeat_ms, gige_default_heartbeat_ms);
    set(reg_tick_low, tick_frequency);
    set(reg_stream_packet_size, 1500);
    set(reg_width, identity_.width);
    set(reg_height, identity_.height);
    set(reg_pixel_format, 0x01080001);
    set(reg_payload_size, identity_.width * identity_.height);
    set(reg_acquisition_mode, 2);
    set(reg_frame_rate, std::bit_cast<std::uint32_t>(20.0F));
    set(reg_exposure_time, std::bit_cast<std::uint32_t>(static_cast<float>(identity_.exposure_us)));
    set(reg_temperature, std::bit_cast<std::uint32_t>(static_cast<float>(identity_.temperature_c)));
    set(reg_exposure_limit, std::bit_cast<std::uint32_t>(1e7F));
    set(reg_exposure_auto, identity_.exposure_auto ? 2 : 0);
    set(reg_gain_auto, identity_.gain_auto ? 2 : 0);
}

void GigeRegisters::set(Register address, std::uint32_t value) {
    const std::uint32_t wire = htonl(value);
    std::memcpy(memory_.data() + address, &wire, sizeof wire);
}

std::uint32_t GigeRegisters::peek(Register address) const {
    std::uint32_t wire = 0;
    std::memcpy(&wire, memory_.data() + address, sizeof wire);
    return ntohl(wire);
}

void GigeRegisters::set_text(Register address, const std::string& text, std::size_t capacity) {
    std::memcpy(memory_.data() + address, text.data(), std::min(text.size(), capacity - 1));
}

bool GigeRegisters::read(std::uint32_t address, std::uint32_t& value) const {
    std::uint32_t wire = 0;
    if (!read(address, std::span(reinterpret_cast<std::uint8_t*>(&wire), sizeof wire)))
        return false;
    value = ntohl(wire);
    return true;
}

bool GigeRegisters::write(std::uint32_t address, std::uint32_t value) {
    const std::lock_guard lock(mutex_);
    if (address < reg_user_name || address >= reg_xml) return false;  // constant, or not there
    if (address == reg_line_selector) {
        line_modes_[peek(reg_line_selector) % line_modes_.size()] = peek(reg_line_mode);
        set(reg_line_mode, line_modes_[value % line_modes_.size()]);
    }
    set(static_cast<Register>(address), value);
    if (address == reg_chunk_mode)
        set(reg_payload_size, identity_.width * identity_.height + (value != 0 ? chunk_bytes : 0));
    return true;
}

void GigeRegisters::resize(std::uint32_t width, std::uint32_t height) {
    const std::lock_guard lock(mutex_);
    set(reg_width, width);
    set(reg_height, height);
    set(reg_payload_size, width * height);
}

bool GigeRegisters::read(std::uint32_t address, std::span<std::uint8_t> out) const {
    const std::lock_guard lock(mutex_);
    if (address > memory_.size() || out.size() > memory_.size() - address) return false;
    std::copy_n(memory_.begin() + address, out.size(), out.begin());
    return true;
}

std::uint32_t GigeRegisters::value(Register address) const {
    std::uint32_t value = 0;
    read(address, value);
    return value;
}

float GigeRegisters::real(Register address) const { return std::bit_cast<float>(value(address)); }

}  // namespace versavis::rig
