// SPDX-License-Identifier: BSD-3-Clause
#include "camera/u3v_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "device/usb_bus.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

namespace {

/// For one answer.
constexpr Duration command_patience = milliseconds(500);

/// The same for a camera that says that its answer takes longer.
constexpr Duration longest_patience = seconds(5);

/// A question is put so often: what is left of an earlier program's may come first.
constexpr unsigned most_tries = 3;

/// Between looks at whether it is cancelled.
constexpr Duration read_interval = milliseconds(20);

/// Aravis divides what it reads by the room in a packet: a header, and the longest text of GenCP.
constexpr std::uint64_t smallest_packet = 12 + 8 + 64;
constexpr std::uint64_t largest_u3v_packet = 65536;  ///< that Aravis makes use of

/// Aravis takes the leader and the trailer of a frame into memory of 1 MiB.
constexpr std::uint64_t largest_frame_part = 65536;

/// Power of two that the size of a transfer is a multiple of: Aravis' has 1 MiB.
constexpr std::uint64_t largest_alignment = 20;

constexpr std::size_t u3v_header_size = 12;
constexpr std::uint32_t magic = 0x43563355;  // "U3VC"
constexpr std::uint16_t u3v_acknowledge = 1U << 14U;
constexpr std::uint16_t u3v_read_memory = 0x0800;
constexpr std::uint16_t pending = 0x0805;
constexpr std::size_t usb_packet = 1024;  ///< of SuperSpeed: a buffer holds a number of them

/// More bootstrap registers.
constexpr std::uint64_t abrm_manifest = 0x1D0;
constexpr std::uint64_t sbrm_largest_command = 0x14;
constexpr std::uint64_t sbrm_largest_acknowledge = 0x18;
constexpr std::uint64_t sirm_info = 0x0;
constexpr std::uint64_t sirm_leader = 0x10;
constexpr std::uint64_t sirm_trailer = 0x14;
/// Of the first description that the camera has.
constexpr std::uint64_t manifest_schema = 8 + 4;
constexpr std::uint64_t manifest_address = 8 + 8;
constexpr std::uint64_t manifest_size = 8 + 16;

const char* const replug = "unplug it and plug it in";

using Bytes = std::vector<std::uint8_t>;

void put_little_endian(Bytes& bytes, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
        bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

std::uint64_t number_in(const Bytes& bytes, std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{bytes[at + i]} << (8 * i);
    return value;
}

/// None: nothing that can be opened has the name.
std::optional<device::UsbHandle> open_named(const device::UsbBus& bus, const UsbName& name) {
    for (const device::UsbDevice& candidate : bus.devices()) {
        if (candidate.function(u3v_control).interface < 0) continue;
        auto handle = candidate.open();
        if (handle && handle->serial().value_or("") == name.serial &&
            handle->product() == name.model && handle->manufacturer() == name.vendor)
            return std::move(*handle);
    }
    return std::nullopt;
}

/// Memory of one camera whose control interface is claimed.
class ControlChannel {
 public:
    ControlChannel(device::UsbHandle& handle, const device::UsbFunction& control,
                   const Cancelled& cancelled)
        : handle_(handle), control_(control), cancelled_(cancelled) {}

    /// `block`: bytes for one question.
    std::optional<Bytes> read(std::uint64_t address, std::uint64_t size, std::uint64_t block) {
        Bytes bytes;
        while (bytes.size() < size) {
            const auto part = ask(address + bytes.size(), std::min(block, size - bytes.size()));
            if (!part) return std::nullopt;
            bytes.insert(bytes.end(), part->begin(), part->end());
        }
        return bytes;
    }

    std::optional<std::uint64_t> number(std::uint64_t address, std::size_t size) {
        const auto bytes = ask(address, size);
        return bytes ? std::optional(number_in(*bytes, 0, size)) : std::nullopt;
    }

 private:
    std::optional<Bytes> ask(std::uint64_t address, std::uint64_t size) {
        for (unsigned i = 0; i < most_tries && !cancelled_(); ++i) {
            Bytes question;
            put_little_endian(question, magic, 4);
            put_little_endian(question, u3v_acknowledge, 2);
            put_little_endian(question, u3v_read_memory, 2);
            put_little_endian(question, u3v_header_size, 2);
            put_little_endian(question, ++id_, 2);
            put_little_endian(question, address, 8);
            put_little_endian(question, 0, 2);
            put_little_endian(question, size, 2);
            if (!handle_.write(control_.endpoint_out, question, command_patience))
                static_cast<void>(handle_.clear_halt(control_.endpoint_out));
            else if (auto answer = receive(size))
                return answer;
        }
        return std::nullopt;
    }

    /// What it holds, or none: it does not come, or it is a refusal.
    std::optional<Bytes> receive(std::uint64_t size) {
        const HostTime asked = host_now();
        HostTime until = asked + command_patience;
        Bytes buffer((u3v_header_size + size + usb_packet - 1) / usb_packet * usb_packet);
        while (host_now() < until && !cancelled_()) {
            const auto got = handle_.read(control_.endpoint_in, buffer, read_interval);
            if (!got && got.error().fault == device::UsbFault::late) continue;
            if (!got && got.error().fault == device::UsbFault::stalled)
                static_cast<void>(handle_.clear_halt(control_.endpoint_in));
            if (!got) return std::nullopt;
            const std::size_t length = *got;
            if (length < u3v_header_size || number_in(buffer, 0, 4) != magic ||
                number_in(buffer, 10, 2) != id_)
                continue;  // left over
            if (number_in(buffer, 6, 2) == pending) {
                until = asked + longest_patience;
                continue;
            }
            if (number_in(buffer, 4, 2) != 0 || number_in(buffer, 6, 2) != u3v_read_memory + 1 ||
                length != u3v_header_size + size)
                return std::nullopt;
            return Bytes(buffer.begin() + u3v_header_size,
                         buffer.begin() + static_cast<std::ptrdiff_t>(length));
        }
        return std::nullopt;
    }

    device::UsbHandle& handle_;
    device::UsbFunction control_;
    const Cancelled& cancelled_;
    std::uint16_t id_ = 0;
};

/// Reads registers one after the other, and remembers whether one failed.
class Registers {
 public:
    explicit Registers(ControlChannel& channel) : channel_(channel) {}
    std::uint64_t operator()(std::uint64_t address, std::size_t size) {
        const auto value = complete_ ? channel_.number(address, size) : std::nullopt;
        complete_ = value.has_value();
        return value.value_or(0);
    }
    bool complete() const { return complete_; }

 private:
    ControlChannel& channel_;
    bool complete_ = true;
};

CameraResult<Description> read_checked(const std::string& device, ControlChannel& channel) {
    const auto refused = [&](const std::string& why) {
        return problem(CameraState::failed,
                       {device, why, "it cannot be used: ask its maker for another firmware"});
    };
    const auto mute =
        problem(CameraState::failed, {device, "its control channel does not answer", replug});
    Registers read(channel);
    const std::uint64_t sbrm = read(abrm_sbrm, 8);
    const std::uint64_t command = read(sbrm + sbrm_largest_command, 4);
    const std::uint64_t answer = read(sbrm + sbrm_largest_acknowledge, 4);
    const std::uint64_t sirm = read(sbrm + sbrm_sirm, 8);
    const std::uint64_t alignment = read(sirm + sirm_info, 4) >> 24U;
    const std::uint64_t leader = read(sirm + sirm_leader, 4);
    const std::uint64_t trailer = read(sirm + sirm_trailer, 4);
    const std::uint64_t manifest = read(abrm_manifest, 8);
    const std::uint64_t schema = read(manifest + manifest_schema, 4);
    const std::uint64_t address = read(manifest + manifest_address, 8);
    const std::uint64_t size = read(manifest + manifest_size, 8);
    if (!read.complete()) return mute;
    if (std::min(command, answer) < smallest_packet)
        return refused(fmt::format("its control packets have {} bytes, less than {}",
                                   std::min(command, answer), smallest_packet));
    if (std::max(leader, trailer) > largest_frame_part)
        return refused(fmt::format("leader or trailer of its frames have {} bytes, more than {}",
                                   std::max(leader, trailer), largest_frame_part));
    if (alignment > largest_alignment)
        return refused(fmt::format("its transfers are multiples of 2^{} bytes, more than 2^{}",
                                   alignment, largest_alignment));
    if (size == 0 || size > largest_description)
        return refused(fmt::format("its description has {} bytes, more than {} or none", size,
                                   largest_description));
    auto bytes =
        channel.read(address, size, std::min(answer, largest_u3v_packet) - u3v_header_size);
    if (!bytes) return mute;
    return Description{std::move(*bytes), (schema >> 10U & 0x3FU) == 1};
}

}  // namespace

CameraResult<Description> read_usb_description(const std::string& device, const UsbName& name,
                                               const Cancelled& cancelled) {
    const auto bus = device::UsbBus::open();
    if (!bus)
        return problem(CameraState::failed, {device, bus.error().what, "restart the service"});
    auto handle = open_named(*bus, name);
    if (!handle)
        return problem(CameraState::failed, {device, "it was found but cannot be opened",
                                             "check the udev rule, or unplug it and plug it in"});
    const device::UsbFunction control = handle->device().function(u3v_control);
    const auto claimed = handle->claim(control.interface);
    if (!claimed && claimed.error().fault == device::UsbFault::busy)
        return problem(CameraState::busy,
                       {device, "another program holds it", "close that program"});
    if (!claimed)
        return problem(
            CameraState::failed,
            {device, fmt::format("it cannot be claimed: {}", claimed.error().name()), replug});
    ControlChannel channel(*handle, control, cancelled);
    return read_checked(device, channel);
}

}  // namespace versavis::daemon
