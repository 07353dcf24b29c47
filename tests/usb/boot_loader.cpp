// SPDX-License-Identifier: BSD-3-Clause
#include "boot_loader.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "board/uf2.hpp"

namespace versavis::test {

namespace {

using client::flash_begin;
using client::flash_page;
using client::flash_sector;

constexpr std::uint8_t drive_in = 0x81;
constexpr std::uint8_t drive_out = 0x02;
constexpr std::uint8_t command_out = 0x03;
constexpr std::uint8_t answer_in = 0x84;

enum Id : std::uint8_t {
    exclusive_access = 0x01,
    reboot_chip = 0x02,
    flash_erase = 0x03,
    write_memory = 0x05,
    exit_xip = 0x06,
    read_memory = 0x84,
};

enum PicobootStatus : std::uint32_t {
    ok = 0,
    unknown_command = 1,
    wrong_command_length = 2,
    wrong_transfer_length = 3,
    wrong_address = 4,
    wrong_alignment = 5,
    unknown_error = 8,
};

UsbDescription describe(std::uint16_t product) {
    UsbDescription usb;
    // clang-format off
    usb.device = {
        18, 1, 0x10, 0x01,  // USB 1.1
        0, 0, 0,            // class by interface
        64, 0x8a, 0x2e, static_cast<std::uint8_t>(product), 0x00, 0x00, 0x01,
        1, 2, 3,            // manufacturer, product, serial
        1};
    usb.configuration = {
        9, 2, 55, 0, 2, 1, 0, 0x80, 0xfa,
        9, 4, 0, 0, 2, 0x08, 0x06, 0x50, 0,  // interface 0: the drive
        7, 5, drive_in, 2, 64, 0, 0,
        7, 5, drive_out, 2, 64, 0, 0,
        9, 4, 1, 0, 2, 0xff, 0, 0, 0,        // interface 1: PICOBOOT
        7, 5, command_out, 2, 64, 0, 0,
        7, 5, answer_in, 2, 64, 0, 0};
    // clang-format on
    usb.strings = {"Raspberry Pi", "RP2 Boot", "E0C9125B0D9B"};  // the same for all chips
    return usb;
}

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

}  // namespace

void Flash::load(const std::vector<std::uint8_t>& image) {
    const std::lock_guard lock(mutex_);
    std::copy(image.begin(), image.end(), bytes_.begin());
}

void Flash::erase(std::size_t at, std::size_t size) {
    const std::lock_guard lock(mutex_);
    std::fill_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), size, std::uint8_t{0xFF});
}

void Flash::write(std::size_t at, std::span<const std::uint8_t> page) {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < page.size(); ++i) bytes_[at + i] &= page[i];
}

std::vector<std::uint8_t> Flash::read(std::size_t at, std::size_t size) const {
    const std::lock_guard lock(mutex_);
    const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(at);
    std::vector<std::uint8_t> bytes(begin, begin + static_cast<std::ptrdiff_t>(size));
    for (const auto& [place, bit] : worn_)
        if (place >= at && place < at + size)
            bytes[place - at] = static_cast<std::uint8_t>(bytes[place - at] & ~(1U << bit));
    return bytes;
}

void Flash::wear_out(std::size_t at, std::uint8_t bit) {
    const std::lock_guard lock(mutex_);
    worn_[at] = bit;
}

bool Flash::starts() const {
    const auto stage = read(0, flash_page);
    return word(stage, 252) == client::boot_stage_crc({stage.data(), 252});
}

BootLoader::BootLoader(Flash& flash, const BootLoaderFaults& faults, BootLoaderEvents events)
    : description_(describe(faults.product)),
      flash_(flash),
      faults_(faults),
      events_(std::move(events)) {}

int BootLoader::control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> /*out*/,
                        Bytes& reply) {
    if (setup[4] != 1) return -EPIPE;
    switch (setup[0] << 8 | setup[1]) {
        case 0x4141: reset(); return 0;
        case 0xc142:  // status of the newest command
            reply.assign(16, 0);
            std::memcpy(reply.data(), &command_.token, 4);
            std::memcpy(reply.data() + 4, &status_, 4);
            reply[8] = command_.id;
            return 0;
        default: return -EPIPE;
    }
}

void BootLoader::reset() {
    takes_data_ = awaits_end_ = false;
    command_ = {};
    status_ = ok;
    node()->flush(answer_in);
}

void BootLoader::receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
    if (endpoint != command_out) return;
    if (std::exchange(awaits_end_, false)) {
        if (bytes.empty()) return;
        return refuse(unknown_error);
    }
    if (!takes_data_) return begin(bytes);
    data_.insert(data_.end(), bytes.begin(), bytes.end());
    if (data_.size() < command_.transfer_size) return;
    takes_data_ = false;
    write_pages();
}

void BootLoader::begin(std::span<const std::uint8_t> bytes) {
    if (bytes.size() != 32 || word(bytes, 0) != 0x431fd10b) return refuse(unknown_command);
    command_ = {word(bytes, 4), bytes[8], bytes[9], word(bytes, 12), {}};
    std::memcpy(command_.argument, bytes.data() + 16, sizeof command_.argument);
    status_ =
        command_.id == faults_.refused_command ? std::uint32_t{wrong_alignment} : check(command_);
    if (status_ != ok) return refuse(status_);
    act();
}

std::uint32_t BootLoader::check(const Command& command) const {
    const auto sized = [&](std::uint8_t arguments, std::uint32_t transfer) -> std::uint32_t {
        if (command.arguments_size != arguments) return wrong_command_length;
        return command.transfer_size == transfer ? ok : wrong_transfer_length;
    };
    std::uint32_t status = unknown_command;
    switch (command.id) {
        case exclusive_access: return sized(1, 0);
        case reboot_chip: return sized(12, 0);
        case exit_xip: return sized(0, 0);
        case flash_erase: status = sized(8, 0); break;
        case write_memory:
        case read_memory: status = sized(8, command.argument[1]); break;
        default: return unknown_command;
    }
    if (status != ok) return status;
    return check_range(command, command.id == flash_erase ? flash_sector : flash_page);
}

std::uint32_t BootLoader::check_range(const Command& command, std::uint32_t grain) const {
    const std::uint32_t at = command.argument[0];
    const std::uint32_t size = command.argument[1];
    if (at % grain != 0 || (command.id == flash_erase && size % grain != 0)) return wrong_alignment;
    if (at < flash_begin || at - flash_begin + size > flash_.size()) return wrong_address;
    return left_xip_ ? ok : unknown_error;  // else the flash is mapped, and takes no commands
}

void BootLoader::act() {
    const std::size_t at = command_.argument[0] - flash_begin;
    const std::size_t size = command_.argument[1];
    switch (command_.id) {
        case exit_xip: left_xip_ = true; break;
        case flash_erase: flash_.erase(at, size); break;
        case write_memory:
            data_.clear();
            takes_data_ = true;
            return;
        case read_memory: awaits_end_ = true; return node()->send(answer_in, flash_.read(at, size));
        default: break;
    }
    acknowledge();
    if (command_.id == reboot_chip) events_.reboot(command_.argument[2]);
}

void BootLoader::write_pages() {
    const std::size_t at = command_.argument[0] - flash_begin;
    for (std::size_t done = 0; done < data_.size(); done += flash_page) {
        const std::size_t size = std::min<std::size_t>(flash_page, data_.size() - done);
        flash_.write(at + done, {data_.data() + done, size});
        if (faults_.gone_at == at + done) return events_.gone();
    }
    acknowledge();
}

void BootLoader::acknowledge() {
    if (command_.id != faults_.held_command || released_) node()->send(answer_in, {});
}

void BootLoader::release() {
    released_ = true;
    node()->send(answer_in, {});
}

void BootLoader::refuse(std::uint32_t status) {
    status_ = status;
    takes_data_ = awaits_end_ = false;
    node()->halt(answer_in);
    node()->halt(command_out);
}

}  // namespace versavis::test
