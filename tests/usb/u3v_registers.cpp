// SPDX-License-Identifier: BSD-3-Clause
#include "u3v_registers.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace versavis::test {

namespace {

constexpr std::size_t memory_size = 0x40000;
constexpr std::size_t text_size = 64;
constexpr std::uint32_t leader_size = 52;
constexpr std::uint32_t trailer_size = 32;
constexpr std::uint32_t largest_control_packet = 1024;

}  // namespace

U3vRegisters::U3vRegisters(const Identity& identity) : identity_(identity), memory_(memory_size) {
    reset();
}

void U3vRegisters::reset() {
    const std::lock_guard lock(mutex_);
    std::fill(memory_.begin(), memory_.end(), std::uint8_t{0});
    put(abrm_gencp_version, 0x00010001, 4);
    put_text(abrm_vendor, identity_.vendor);
    put_text(abrm_model, identity_.model);
    put_text(abrm_device_version, "1.0");
    put_text(abrm_serial, identity_.serial);
    put(abrm_capability, 1U << 8U, 8);  // timestamp
    put(abrm_response_ms, identity_.response_ms, 4);
    put(abrm_manifest, manifest, 8);
    put(abrm_sbrm, sbrm_version, 8);
    put(abrm_timestamp_increment, 1, 4);
    put(sbrm_version, 0x00010000, 4);
    put(sbrm_capability, 1, 8);  // SIRM available
    put(sbrm_max_command, largest_control_packet, 4);
    put(sbrm_max_acknowledge, largest_control_packet, 4);
    put(sbrm_stream_channels, 1, 4);
    put(sbrm_sirm, sirm_info, 8);
    put(sbrm_sirm_length, 0x30, 4);
    put(sbrm_speed, 8, 4);  // SuperSpeed
    put(sirm_info, identity_.alignment_log2 << 24U, 4);
    put(sirm_required_leader, leader_size, 4);
    put(sirm_required_trailer, trailer_size, 4);

    const std::string xml = u3v_xml(identity_.width, identity_.height);
    std::memcpy(memory_.data() + reg_xml, xml.data(), xml.size());
    put(manifest, 1, 8);  // entries
    const std::uint32_t version = 0x01000000;
    const std::uint32_t entry = manifest + 8;
    put(static_cast<Register>(entry), version, 4);
    put(static_cast<Register>(entry + 4), 0x01010000, 4);  // schema 1.1, device XML, not compressed
    put(static_cast<Register>(entry + 8), reg_xml, 8);
    put(static_cast<Register>(entry + 16), xml.size(), 8);

    put_feature(reg_width, identity_.width);
    put_feature(reg_height, identity_.height);
    put_feature(reg_pixel_format, 0x01080001);
    put_feature(reg_acquisition_mode, 2);
    put_feature(reg_frame_rate, std::bit_cast<std::uint32_t>(20.0F));
    put_feature(reg_exposure_time, std::bit_cast<std::uint32_t>(5000.0F));
    update_payload();
}

void U3vRegisters::put(Register address, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
        memory_[address + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

void U3vRegisters::put_feature(Register address, std::uint32_t value) {
    put(address, __builtin_bswap32(value), 4);
}

void U3vRegisters::put_text(Register address, const std::string& text) {
    std::memcpy(memory_.data() + address, text.data(), std::min(text.size(), text_size - 1));
}

std::uint32_t U3vRegisters::feature(Register address) const {
    std::uint32_t wire = 0;
    std::memcpy(&wire, memory_.data() + address, sizeof wire);
    return __builtin_bswap32(wire);
}

void U3vRegisters::update_payload() {
    const std::uint32_t bytes_per_pixel =
        feature(reg_pixel_format) == 0x01100007 ? 2 : 1;  // Mono16 or Mono8
    const std::uint32_t size = feature(reg_width) * feature(reg_height) * bytes_per_pixel;
    put_feature(reg_payload_size, size);
    put(sirm_required_payload, size, 8);
}

bool U3vRegisters::read(std::uint64_t address, std::span<std::uint8_t> out) const {
    const std::lock_guard lock(mutex_);
    if (address > memory_.size() || out.size() > memory_.size() - address) return false;
    std::copy_n(memory_.begin() + static_cast<std::ptrdiff_t>(address), out.size(), out.begin());
    return true;
}

U3vRegisters::Written U3vRegisters::write(std::uint64_t address, std::span<const std::uint8_t> in) {
    const std::lock_guard lock(mutex_);
    if (address > memory_.size() || in.size() > memory_.size() - address) return Written::no_such;
    const bool feature_space =
        address >= reg_width && address < reg_xml && address != reg_payload_size;
    const bool stream_space =
        address == sirm_control || (address >= sirm_max_leader && address < manifest);
    if (!feature_space && !stream_space && address != abrm_timestamp_latch)
        return Written::read_only;
    std::copy(in.begin(), in.end(), memory_.begin() + static_cast<std::ptrdiff_t>(address));
    if (feature_space) update_payload();
    return Written::done;
}

std::uint32_t U3vRegisters::bootstrap(Register address) const {
    const std::lock_guard lock(mutex_);
    std::uint32_t value = 0;
    std::memcpy(&value, memory_.data() + address, sizeof value);
    return value;
}

void U3vRegisters::set_bootstrap(Register address, std::uint64_t value, std::size_t size) {
    const std::lock_guard lock(mutex_);
    put(address, value, size);
}

std::uint32_t U3vRegisters::value(Register address) const {
    const std::lock_guard lock(mutex_);
    return feature(address);
}

float U3vRegisters::real(Register address) const { return std::bit_cast<float>(value(address)); }

}  // namespace versavis::test
