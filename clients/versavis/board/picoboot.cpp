// SPDX-License-Identifier: BSD-3-Clause
#include "board/picoboot.hpp"

#include <fmt/format.h>

#include <array>
#include <cstring>

namespace versavis::client {

namespace {

constexpr std::uint8_t vendor_class = 0xFF;

constexpr std::uint32_t magic = 0x431FD10B;

enum Id : std::uint8_t {
    exclusive_access = 0x01,
    reboot_chip = 0x02,
    flash_erase = 0x03,
    write_memory = 0x05,
    exit_xip = 0x06,
    read_memory = 0x84,
};
constexpr std::uint8_t to_host = 0x80;  // bit of Id

constexpr std::uint8_t exclusive_and_eject = 2;

// Requests to the interface.
constexpr std::uint8_t vendor_out = 0x41;
constexpr std::uint8_t vendor_in = 0xC1;
constexpr std::uint8_t interface_reset = 0x41;
constexpr std::uint8_t get_command_status = 0x42;

/// For one command. The slowest erases a sector, which takes a worn flash 0.4 s.
constexpr Duration command_timeout = seconds(3);

/// Between the answer to the reboot and the reboot, so that the answer arrives.
constexpr std::uint32_t reboot_delay_ms = 100;

/// As the boot loader answers it.
struct Status {
    std::uint32_t token;
    std::uint32_t code;
    std::uint8_t id;
    std::uint8_t in_progress;
    std::uint8_t reserved[6];
};
static_assert(sizeof(Status) == 16);

const char* name_of(std::uint8_t id) {
    switch (id) {
        case exclusive_access: return "take the flash for itself";
        case reboot_chip: return "reboot";
        case flash_erase: return "erase";
        case write_memory: return "write";
        case exit_xip: return "stop running from the flash";
        default: return "read";
    }
}

const char* name_of_status(std::uint32_t code) {
    constexpr std::array names{"no reason given",
                               "unknown command",
                               "wrong command length",
                               "wrong transfer length",
                               "wrong address",
                               "wrong alignment",
                               "another writer came between",
                               "it is rebooting",
                               "unknown error"};
    return code < names.size() ? names[code] : "a reason that this program does not know";
}

}  // namespace

struct Picoboot::Command {
    std::uint32_t magic_word = magic;
    std::uint32_t token = 0;
    std::uint8_t id = 0;
    std::uint8_t arguments_size = 0;
    std::uint16_t reserved = 0;
    std::uint32_t transfer_size = 0;
    std::array<std::uint32_t, 4> arguments{};

    /// For the words of an error: most commands have an address.
    std::string text() const {
        if (arguments_size != 8) return name_of(id);
        return fmt::format("{} at {:#010x}", name_of(id), arguments[0]);
    }
};

Expected<Picoboot> Picoboot::open(const device::UsbDevice& device) {
    const std::string where = fmt::format("boot loader at {}", device.port());
    auto handle = device.open();
    if (!handle) return Unexpected(handle.error().as_error(where, "cannot be opened"));
    const device::UsbFunction function = device.function({vendor_class});
    if (!function.complete())
        return failure(where, "has no PICOBOOT interface", "is it an RP2040? Reconnect it");
    if (auto claimed = handle->claim(function.interface); !claimed)
        return Unexpected(claimed.error().as_error(where, "cannot be claimed"));
    Picoboot boot_loader(std::move(*handle), function, where);
    if (auto done = boot_loader.take_over(); !done) return Unexpected(done.error());
    return boot_loader;
}

Expected<> Picoboot::take_over() {
    static_assert(sizeof(Command) == 32);
    // Whatever an earlier program left unfinished ends here.
    if (auto done = reset(); !done)
        return Unexpected(done.error().as_error(where_, "cannot reset"));
    Command take;
    take.id = exclusive_access;
    take.arguments_size = 1;
    take.arguments[0] = exclusive_and_eject;
    if (auto done = run(take, {}, {}); !done) return done;
    Command leave;
    leave.id = exit_xip;
    return run(leave, {}, {});
}

Expected<> Picoboot::erase(std::uint32_t address, std::uint32_t size) {
    Command command;
    command.id = flash_erase;
    command.arguments_size = 8;
    command.arguments = {address, size};
    return run(command, {}, {});
}

Expected<> Picoboot::write(std::uint32_t address, std::span<const std::uint8_t> bytes) {
    Command command;
    command.id = write_memory;
    command.arguments_size = 8;
    command.transfer_size = static_cast<std::uint32_t>(bytes.size());
    command.arguments = {address, command.transfer_size};
    return run(command, {}, bytes);
}

Expected<> Picoboot::read(std::uint32_t address, std::span<std::uint8_t> into) {
    Command command;
    command.id = read_memory;
    command.arguments_size = 8;
    command.transfer_size = static_cast<std::uint32_t>(into.size());
    command.arguments = {address, command.transfer_size};
    return run(command, into, {});
}

Expected<> Picoboot::reboot() {
    Command command;
    command.id = reboot_chip;
    command.arguments_size = 12;
    command.arguments = {0, 0, reboot_delay_ms};  // program counter 0: as after power-up
    auto done = exchange(command, {}, {});
    // It may be gone before its answer was fetched.
    if (!done && done.error().fault != device::UsbFault::gone)
        return Unexpected(explain(command, done.error()));
    return {};
}

/// Also aborts what it does with the flash, and returns the drive.
device::UsbExpected<> Picoboot::reset() {
    for (const std::uint8_t endpoint : {function_.endpoint_out, function_.endpoint_in})
        if (auto done = handle_.clear_halt(endpoint); !done) return done;
    auto done =
        handle_.control(vendor_out, interface_reset, 0, function_.interface, {}, command_timeout);
    if (!done) return Unexpected(done.error());
    return {};
}

Expected<> Picoboot::run(const Command& command, std::span<std::uint8_t> in,
                         std::span<const std::uint8_t> out) {
    Command numbered = command;
    numbered.token = ++token_;
    if (auto done = exchange(numbered, in, out); !done)
        return Unexpected(explain(numbered, done.error()));
    return {};
}

/// Command, data, and an empty packet the other way, which says that it is done.
device::UsbExpected<> Picoboot::exchange(const Command& command, std::span<std::uint8_t> in,
                                         std::span<const std::uint8_t> out) {
    std::array<std::uint8_t, sizeof(Command)> bytes{};
    std::memcpy(bytes.data(), &command, sizeof command);
    if (auto done = handle_.write(function_.endpoint_out, bytes, command_timeout); !done)
        return done;
    if (!out.empty())
        if (auto done = handle_.write(function_.endpoint_out, out, command_timeout); !done)
            return done;
    for (std::size_t filled = 0; filled < in.size();) {
        auto size = handle_.read(function_.endpoint_in, in.subspan(filled), command_timeout);
        if (!size) return Unexpected(size.error());
        if (*size == 0) return Unexpected(device::UsbError{device::UsbFault::late, 0});
        filled += *size;
    }
    if ((command.id & to_host) != 0)
        return handle_.write(function_.endpoint_out, {}, command_timeout);
    std::array<std::uint8_t, 1> nothing{};
    auto done = handle_.read(function_.endpoint_in, nothing, command_timeout);
    if (!done) return Unexpected(done.error());
    return {};
}

Error Picoboot::explain(const Command& command, const device::UsbError& error) {
    const std::string what = "cannot " + command.text();
    if (error.fault != device::UsbFault::stalled && error.fault != device::UsbFault::late)
        return error.as_error(where_, what);
    const std::string why = error.fault == device::UsbFault::stalled
                                ? fmt::format("it refuses ({})", reason(command))
                                : "it does not answer";
    static_cast<void>(reset());
    return {where_, fmt::format("{}: {}", what, why), "reconnect the board"};
}

/// Of a command that stalled.
std::string Picoboot::reason(const Command& command) {
    std::array<std::uint8_t, sizeof(Status)> bytes{};
    const auto size = handle_.control(vendor_in, get_command_status, 0, function_.interface, bytes,
                                      command_timeout);
    Status status{};
    std::memcpy(&status, bytes.data(), sizeof status);
    if (!size || *size != sizeof status || status.token != command.token)
        return "without giving a reason";
    return name_of_status(status.code);
}

}  // namespace versavis::client
