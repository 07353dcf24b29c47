// SPDX-License-Identifier: BSD-3-Clause
#include "camera_registers.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "bytes.hpp"

namespace versavis::rig {

namespace {

constexpr std::size_t least_description = 0x20000;

/// Bytes of a field.
std::uint32_t size_of(const Field& field) {
    return field.format == NumberFormat::double_float ? 8 : 4;
}

std::endian order_of(const CameraFamily& family) {
    return family.little_endian ? std::endian::little : std::endian::big;
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

CameraRegisters::CameraRegisters(const CameraScenario& settings, const CameraFamily& family,
                                 TransportMemory transport)
    : settings_(settings),
      family_(family),
      transport_(std::move(transport)),
      memory_(reg_xml + std::max(transport_.description.size(), least_description)) {
    reset();
}

void CameraRegisters::reset() {
    const std::lock_guard lock(mutex_);
    std::fill(memory_.begin(), memory_.end(), std::uint8_t{0});
    std::copy(transport_.registers.begin(), transport_.registers.end(), memory_.begin());
    std::copy(transport_.description.begin(), transport_.description.end(),
              memory_.begin() + reg_xml);
    line_modes_ = {};
    set(reg_width, settings_.width);
    set(reg_height, settings_.height);
    set(reg_pixel_format, pixel_format_mono8);
    set(reg_acquisition_mode, 2);
    set(reg_frame_rate, std::bit_cast<std::uint32_t>(20.0F));
    set(reg_temperature, std::bit_cast<std::uint32_t>(static_cast<float>(settings_.temperature_c)));
    set(reg_exposure_limit, std::bit_cast<std::uint32_t>(1e7F));
    set(reg_exposure_auto, settings_.exposure_swing > 0 ? 2 : 0);
    set(reg_gain_auto, settings_.auto_gain ? 2 : 0);
    load_user_set(false);
}

/// The factory settings, or those that are loaded at the start.
void CameraRegisters::load_user_set(bool factory) {
    std::fill(memory_.begin() + reg_model, memory_.begin() + reg_xml, std::uint8_t{0});
    for (const auto& [field, value] : family_.defaults) put(field, value);
    put(family_.exposure, settings_.exposure_us);
    for (const auto& [field, value] : family_.left_behind)
        if (!factory) put(field, value);
    settle();
}

/// What follows from other registers.
void CameraRegisters::settle() {
    if (family_.binning) {
        const auto binning = static_cast<std::uint32_t>(std::max(1.0, get(*family_.binning)));
        set(reg_width, settings_.width / binning);
        set(reg_height, settings_.height / binning);
    }
    set(reg_payload_size,
        peek(reg_width) * peek(reg_height) + (holds(family_.chunks) ? family_.chunk_bytes() : 0));
    for (const RegisterLock& lock : family_.locks)
        if (lock.shown) put(*lock.shown, holds(lock.when) ? 1 : 0);
}

void CameraRegisters::set(std::uint32_t address, std::uint32_t value) {
    store_number(std::span(memory_).subspan(address, sizeof value), value, std::endian::big);
}

std::uint32_t CameraRegisters::peek(std::uint32_t address) const {
    const auto bytes = std::span(memory_).subspan(address, sizeof(std::uint32_t));
    return static_cast<std::uint32_t>(load_number(bytes, std::endian::big));
}

bool CameraRegisters::write(std::uint64_t address, std::span<const std::uint8_t> in) {
    const std::lock_guard lock(mutex_);
    if (address > reg_xml || in.size() > reg_xml - address) return false;
    const std::uint32_t line = peek(reg_line_selector);
    std::copy(in.begin(), in.end(), memory_.begin() + static_cast<std::ptrdiff_t>(address));
    if (address == reg_line_selector) {
        line_modes_[line % line_modes_.size()] = peek(reg_line_mode);
        set(reg_line_mode, line_modes_[peek(reg_line_selector) % line_modes_.size()]);
    }
    if (family_.user_set_load && address == family_.user_set_load->at)
        load_user_set(get(*family_.user_set) == 0);
    if (address == reg_chunk_mode || address >= reg_model) settle();
    return true;
}

bool CameraRegisters::write(std::uint32_t address, std::uint32_t value) {
    std::array<std::uint8_t, sizeof value> wire{};
    store_number(wire, value, std::endian::big);
    return write(address, wire);
}

void CameraRegisters::resize(std::uint32_t width, std::uint32_t height) {
    const std::lock_guard lock(mutex_);
    set(reg_width, width);
    set(reg_height, height);
    set(reg_payload_size, width * height);
}

bool CameraRegisters::read(std::uint64_t address, std::span<std::uint8_t> out) const {
    const std::lock_guard lock(mutex_);
    if (address > memory_.size() || out.size() > memory_.size() - address) return false;
    std::copy_n(memory_.begin() + static_cast<std::ptrdiff_t>(address), out.size(), out.begin());
    return true;
}

std::uint32_t CameraRegisters::value(std::uint32_t address) const {
    const std::lock_guard lock(mutex_);
    return peek(address);
}

std::uint64_t CameraRegisters::raw(const Field& field) const {
    return load_number(std::span(memory_).subspan(field.at, size_of(field)), order_of(family_));
}

double CameraRegisters::get(const Field& field) const {
    const std::uint64_t bits = raw(field);
    const auto word = static_cast<std::uint32_t>(bits);
    switch (field.format) {
        case NumberFormat::single_float: return static_cast<double>(std::bit_cast<float>(word));
        case NumberFormat::double_float: return std::bit_cast<double>(bits);
        default: return (word & field.bits) >> std::countr_zero(field.bits);
    }
}

void CameraRegisters::put(const Field& field, double value) {
    std::uint64_t bits = 0;
    switch (field.format) {
        case NumberFormat::single_float:
            bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
            break;
        case NumberFormat::double_float: bits = std::bit_cast<std::uint64_t>(value); break;
        default:
            bits = (raw(field) & ~field.bits) |
                   (static_cast<std::uint32_t>(value) << std::countr_zero(field.bits) & field.bits);
    }
    store_number(std::span(memory_).subspan(field.at, size_of(field)), bits, order_of(family_));
}

bool CameraRegisters::holds(const FieldValues& values) const {
    return !values.empty() && std::all_of(values.begin(), values.end(), [this](const auto& entry) {
        return get(entry.first) == entry.second;
    });
}

double CameraRegisters::number(const std::optional<Field>& field) const {
    const std::lock_guard lock(mutex_);
    return field ? get(*field) : 0;
}

void CameraRegisters::set_number(const Field& field, double value) {
    const std::lock_guard lock(mutex_);
    put(field, value);
}

bool CameraRegisters::all(const FieldValues& values) const {
    const std::lock_guard lock(mutex_);
    return holds(values);
}

bool CameraRegisters::any(const FieldValues& values) const {
    const std::lock_guard lock(mutex_);
    return std::any_of(values.begin(), values.end(),
                       [this](const auto& entry) { return holds({entry}); });
}

bool CameraRegisters::locked(std::uint32_t address, bool acquiring) const {
    const std::lock_guard guard(mutex_);
    return std::any_of(family_.locks.begin(), family_.locks.end(), [&](const RegisterLock& lock) {
        return (lock.when.empty() ? acquiring : holds(lock.when)) &&
               std::any_of(lock.fields.begin(), lock.fields.end(),
                           [&](const Field& field) { return address - field.at < size_of(field); });
    });
}

float CameraRegisters::real(Register address) const { return std::bit_cast<float>(value(address)); }

}  // namespace versavis::rig
