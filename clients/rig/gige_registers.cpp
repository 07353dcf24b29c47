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

/// Bytes of a field.
std::uint32_t size_of(const Field& field) {
    return field.format == NumberFormat::double_float ? 8 : 4;
}

}  // namespace

CameraFamily rig_family() {
    const auto single = [](Register at) {
        return Field{at, 0xFFFFFFFF, NumberFormat::single_float};
    };
    CameraFamily family;
    family.triggered = {{{reg_trigger_mode}, 1}};
    family.listens = {{{reg_trigger_source}, 1}};
    family.falling = {{{reg_trigger_activation}, 1}};
    family.exposure = single(reg_exposure_time);
    family.exposure_auto = {{{reg_exposure_auto}, 2}};
    family.exposure_limit = single(reg_exposure_limit);
    family.chunks = {{{reg_chunk_mode}, 1}};
    family.gain_chunk = 0x1002;
    return family;
}

GigeRegisters::GigeRegisters(const Identity& identity, const CameraFamily& family)
    : identity_(identity),
      family_(family),
      description_(describe_camera(identity.hostility,
                                   gige_xml(identity.width, identity.height, family), reg_xml)),
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
    set_text(reg_vendor, family_.vendor, 32);
    set_text(reg_model_name, family_.model, 32);
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
    set(reg_acquisition_mode, 2);
    set(reg_frame_rate, std::bit_cast<std::uint32_t>(20.0F));
    set(reg_temperature, std::bit_cast<std::uint32_t>(static_cast<float>(identity_.temperature_c)));
    set(reg_exposure_limit, std::bit_cast<std::uint32_t>(1e7F));
    set(reg_exposure_auto, identity_.exposure_auto ? 2 : 0);
    set(reg_gain_auto, identity_.gain_auto ? 2 : 0);
    load_user_set(false);
}

/// The factory settings, or those that are loaded at the start.
void GigeRegisters::load_user_set(bool factory) {
    std::fill(memory_.begin() + reg_model, memory_.begin() + reg_xml, std::uint8_t{0});
    for (const auto& [field, value] : family_.defaults) put(field, value);
    put(family_.exposure, identity_.exposure_us);
    for (const auto& [field, value] : family_.left_behind)
        if (!factory) put(field, value);
    settle();
}

/// What follows from other registers.
void GigeRegisters::settle() {
    if (family_.binning) {
        const auto binning = static_cast<std::uint32_t>(std::max(1.0, get(*family_.binning)));
        set(reg_width, identity_.width / binning);
        set(reg_height, identity_.height / binning);
    }
    set(reg_payload_size,
        peek(reg_width) * peek(reg_height) + (holds(family_.chunks) ? family_.chunk_bytes() : 0));
    for (const RegisterLock& lock : family_.locks)
        if (lock.shown) put(*lock.shown, holds(lock.when) ? 1 : 0);
}

void GigeRegisters::set(std::uint32_t address, std::uint32_t value) {
    const std::uint32_t wire = htonl(value);
    std::memcpy(memory_.data() + address, &wire, sizeof wire);
}

std::uint32_t GigeRegisters::peek(std::uint32_t address) const {
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
    set(address, value);
    if (family_.user_set_load && address == family_.user_set_load->at)
        load_user_set(get(*family_.user_set) == 0);
    if (address == reg_chunk_mode || address >= reg_model) settle();
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

double GigeRegisters::get(const Field& field) const {
    std::array<std::uint32_t, 2> words{peek(field.at), peek(field.at + 4)};
    if (family_.little_endian)
        for (std::uint32_t& word : words) word = __builtin_bswap32(word);
    const auto [high, low] =
        family_.little_endian ? std::pair(words[1], words[0]) : std::pair(words[0], words[1]);
    switch (field.format) {
        case NumberFormat::single_float: return static_cast<double>(std::bit_cast<float>(words[0]));
        case NumberFormat::double_float:
            return std::bit_cast<double>(std::uint64_t{high} << 32U | low);
        default: return (words[0] & field.bits) >> std::countr_zero(field.bits);
    }
}

void GigeRegisters::put(const Field& field, double value) {
    const auto swapped = [this](std::uint32_t word) {
        return family_.little_endian ? __builtin_bswap32(word) : word;
    };
    switch (field.format) {
        case NumberFormat::single_float:
            return set(field.at, swapped(std::bit_cast<std::uint32_t>(static_cast<float>(value))));
        case NumberFormat::double_float: {
            const auto bits = std::bit_cast<std::uint64_t>(value);
            const auto high = swapped(static_cast<std::uint32_t>(bits >> 32U));
            const auto low = swapped(static_cast<std::uint32_t>(bits));
            set(field.at, family_.little_endian ? low : high);
            return set(field.at + 4, family_.little_endian ? high : low);
        }
        default: {
            const std::uint32_t others = swapped(peek(field.at)) & ~field.bits;
            const auto own = static_cast<std::uint32_t>(value) << std::countr_zero(field.bits);
            set(field.at, swapped(others | (own & field.bits)));
        }
    }
}

bool GigeRegisters::holds(const FieldValues& values) const {
    return !values.empty() && std::all_of(values.begin(), values.end(), [this](const auto& entry) {
        return get(entry.first) == entry.second;
    });
}

double GigeRegisters::number(const std::optional<Field>& field) const {
    const std::lock_guard lock(mutex_);
    return field ? get(*field) : 0;
}

void GigeRegisters::set_number(const Field& field, double value) {
    const std::lock_guard lock(mutex_);
    put(field, value);
}

bool GigeRegisters::all(const FieldValues& values) const {
    const std::lock_guard lock(mutex_);
    return holds(values);
}

bool GigeRegisters::any(const FieldValues& values) const {
    const std::lock_guard lock(mutex_);
    return std::any_of(values.begin(), values.end(),
                       [this](const auto& entry) { return holds({entry}); });
}

bool GigeRegisters::locked(std::uint32_t address, bool acquiring) const {
    const std::lock_guard guard(mutex_);
    return std::any_of(family_.locks.begin(), family_.locks.end(), [&](const RegisterLock& lock) {
        return (lock.when.empty() ? acquiring : holds(lock.when)) &&
               std::any_of(lock.fields.begin(), lock.fields.end(),
                           [&](const Field& field) { return address - field.at < size_of(field); });
    });
}

float GigeRegisters::real(Register address) const { return std::bit_cast<float>(value(address)); }

}  // namespace versavis::rig
