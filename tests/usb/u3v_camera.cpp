// SPDX-License-Identifier: BSD-3-Clause
#include "u3v_camera.hpp"

#include <algorithm>
#include <chrono>

#include "bytes.hpp"
#include "posix/thread.hpp"
#include "u3v_description.hpp"

namespace versavis::test {

namespace {

constexpr std::uint32_t control_magic = 0x43563355;  // "U3VC"
constexpr std::uint32_t leader_magic = 0x4C563355;   // "U3VL"
constexpr std::uint32_t trailer_magic = 0x54563355;  // "U3VT"
constexpr std::uint16_t read_memory_command = 0x0800;
constexpr std::uint16_t write_memory_command = 0x0802;
constexpr std::size_t control_header = 12;
constexpr std::uint16_t acknowledge_wanted = 1U << 14U;
constexpr std::uint16_t image = 0x0001;
constexpr std::uint16_t image_with_chunks = 0x4001;
enum U3vStatus : std::uint16_t {
    success = 0,
    not_implemented = 0x8001,
    invalid_parameter = 0x8002,
    invalid_address = 0x8003,
    write_protect = 0x8004,
};

constexpr std::uint32_t packet_size = 1024;
constexpr std::size_t most_frames_queued = 4;
constexpr auto poll_interval = std::chrono::milliseconds(20);

void put(Bytes& bytes, std::uint64_t value, std::size_t size) {
    rig::append_number(bytes, value, size, std::endian::little);
}

std::uint64_t get(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
    return rig::load_number(bytes.subspan(at, size), std::endian::little);
}

rig::CameraScenario with_long_ids(rig::CameraScenario settings) {
    settings.extended_ids = true;
    return settings;
}

}  // namespace

U3vCamera::U3vCamera(const rig::World& world, const rig::CameraScenario& settings,
                     const rig::CameraFamily& family)
    : description_(u3v_description(family.vendor, family.model, settings.serial)),
      camera_(world, with_long_ids(settings), family, u3v_memory(settings, family), *this),
      thread_(start_thread("camera", [this] {
          for (; !stop_; std::this_thread::sleep_for(poll_interval)) camera_.poll(host_now());
      })) {}

U3vCamera::~U3vCamera() {
    stop_ = true;
    thread_.join();
}

void U3vCamera::plugged(bool in) {
    {
        const std::lock_guard sending(sending_);
        plugged_ = in;
    }
    camera_.restart();  // powered by the bus
}

void U3vCamera::stall_data() { node()->halt(u3v_data_in); }

void U3vCamera::receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
    if (endpoint != u3v_control_out || muted_ || camera_.muted()) return;
    if (bytes.size() < control_header || get(bytes, 0, 4) != control_magic) return;
    const auto command = static_cast<std::uint16_t>(get(bytes, 6, 2));
    const auto parameters = bytes.subspan(control_header);
    Bytes body;
    std::uint16_t status = not_implemented;
    if (command == read_memory_command) status = read_memory(parameters, body);
    if (command == write_memory_command) status = write_memory(parameters, body);
    if ((get(bytes, 4, 2) & acknowledge_wanted) == 0) return;
    Bytes packet;
    put(packet, control_magic, 4);
    put(packet, status, 2);
    put(packet, command + 1U, 2);
    put(packet, body.size(), 2);
    put(packet, get(bytes, 10, 2), 2);  // its number
    packet.insert(packet.end(), body.begin(), body.end());
    node()->send(u3v_control_in, std::move(packet));
}

std::uint16_t U3vCamera::read_memory(std::span<const std::uint8_t> command, Bytes& body) {
    if (command.size() < 12) return invalid_parameter;
    const std::size_t size = get(command, 10, 2);
    if (control_header + size > u3v_control_packet) return invalid_parameter;
    set(sirm_required_payload, registers_.value(rig::reg_payload_size));
    body.resize(size);
    if (registers_.read(get(command, 0, 8), body)) return success;
    body.clear();
    return invalid_address;
}

std::uint16_t U3vCamera::write_memory(std::span<const std::uint8_t> command, Bytes& body) {
    if (command.size() < 9) return invalid_parameter;
    const std::uint64_t address = get(command, 0, 8);
    if (address >= rig::reg_xml) return invalid_address;
    const bool writable = address == abrm_timestamp_latch || address == sirm_control ||
                          (address >= sirm_max_leader && address < manifest) ||
                          address >= rig::reg_width;
    if (!writable) return write_protect;
    const auto data = command.subspan(8);
    switch (camera_.write(static_cast<std::uint32_t>(address), data)) {
        case rig::GenicamCamera::Written::no_such: return invalid_address;
        case rig::GenicamCamera::Written::locked: return write_protect;
        case rig::GenicamCamera::Written::done: break;
    }
    if (address == abrm_timestamp_latch) set(abrm_timestamp, camera_.ticks(host_now()));
    if (address == sirm_control && (value(sirm_control) & 1U) == 0) node()->flush(u3v_data_in);
    put(body, 0, 2);
    put(body, data.size(), 2);
    return success;
}

std::uint32_t U3vCamera::value(U3vRegister address) const {
    return __builtin_bswap32(registers_.value(address));
}

void U3vCamera::set(U3vRegister address, std::uint64_t value) {
    Bytes bytes;
    put(bytes, value, sizeof value);
    registers_.write(address, bytes);
}

bool U3vCamera::ready(const rig::StreamFrame& frame) const {
    return plugged_ && (value(sirm_control) & 1U) != 0 && value(sirm_payload_size) > 0 &&
           !node()->halted(u3v_data_in) &&
           node()->queued(u3v_data_in) < most_frames_queued * frame.size();
}

void U3vCamera::transmit(rig::StreamFrame frame) {
    const std::lock_guard sending(sending_);
    const bool possible = ready(frame);
    frame.done(possible && frame.missing == rig::Missing::nothing);
    if (!possible) return;
    if (frame.missing != rig::Missing::leader) send_leader(frame);
    frame.paint_when_exposed();
    rig::sleep_until(frame.due);
    send_payload(frame);
    if (frame.missing != rig::Missing::end) send_trailer(frame);
    frame.sent(host_now());
}

void U3vCamera::send_leader(const rig::StreamFrame& frame) {
    Bytes leader;
    put(leader, leader_magic, 4);
    put(leader, 0, 2);
    put(leader, u3v_leader_size, 2);
    put(leader, frame.block_id - 1, 8);  // the first one is 0
    put(leader, 0, 2);
    put(leader, frame.chunks.empty() ? image : image_with_chunks, 2);
    put(leader, frame.camera_time_ns, 8);
    put(leader, rig::pixel_format_mono8, 4);
    put(leader, frame.width, 4);
    put(leader, frame.height, 4);
    put(leader, 0, 8);  // offsets
    put(leader, 0, 4);  // padding, reserved
    node()->send(u3v_data_in, std::move(leader));
}

// In transfers of the size that the host has set. A short packet ends one that is not full.
void U3vCamera::send_payload(const rig::StreamFrame& frame) {
    const std::size_t announced = registers_.value(rig::reg_payload_size);
    const std::size_t most = value(sirm_payload_size);
    for (std::size_t at = 0; at < frame.size(); at += most) {
        Bytes part(std::min(most, frame.size() - at));
        frame.copy(at, part);
        const std::size_t length = part.size();
        node()->send(u3v_data_in, std::move(part));
        const bool asked_for = length == most || frame.size() - at == announced % most;
        if (!asked_for && length % packet_size == 0) node()->send(u3v_data_in, {});
    }
}

void U3vCamera::send_trailer(const rig::StreamFrame& frame) {
    Bytes trailer;
    put(trailer, trailer_magic, 4);
    put(trailer, 0, 2);
    put(trailer, frame.chunks.empty() ? u3v_trailer_size - 4U : u3v_trailer_size, 2);
    put(trailer, frame.block_id - 1, 8);
    put(trailer, success, 2);
    put(trailer, 0, 2);
    put(trailer, frame.size(), 8);
    put(trailer, frame.height, 4);
    if (!frame.chunks.empty()) put(trailer, 0, 4);  // their layout is always the same
    node()->send(u3v_data_in, std::move(trailer));
}

}  // namespace versavis::test
