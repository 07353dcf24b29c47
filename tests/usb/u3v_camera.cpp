// SPDX-License-Identifier: BSD-3-Clause
#include "u3v_camera.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "u3v_description.hpp"

namespace versavis::test {

namespace {

constexpr std::uint32_t control_magic = 0x43563355;  // "U3VC"
constexpr std::uint32_t leader_magic = 0x4C563355;   // "U3VL"
constexpr std::uint32_t trailer_magic = 0x54563355;  // "U3VT"
constexpr std::uint16_t read_memory_command = 0x0800;
constexpr std::uint16_t write_memory_command = 0x0802;
constexpr std::uint16_t pending_acknowledge = 0x0805;
constexpr std::size_t control_header = 12;
constexpr std::uint16_t acknowledge_wanted = 1U << 14U;
enum Status : std::uint16_t {
    success = 0,
    not_implemented = 0x8001,
    invalid_parameter = 0x8002,
    invalid_address = 0x8003,
    write_protect = 0x8004,
};

constexpr std::uint16_t leader_size = 52;
constexpr std::uint16_t trailer_size = 32;
constexpr std::uint32_t packet_size = 1024;

constexpr std::size_t most_frames_queued = 4;
constexpr std::uint64_t readout_ns = 4'000'000;
constexpr std::uint64_t clock_offset_ns = 77'000'000'000;  // the camera's clock is not the host's
constexpr std::size_t exposures_kept = 1000;

std::uint64_t camera_now_ns() {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return static_cast<std::uint64_t>(
               std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()) +
           clock_offset_ns;
}

std::chrono::steady_clock::time_point host_time(std::uint64_t camera_ns) {
    return std::chrono::steady_clock::time_point{
        std::chrono::nanoseconds{static_cast<std::int64_t>(camera_ns - clock_offset_ns)}};
}

void put(Bytes& bytes, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
        bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

std::uint64_t get(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{bytes[at + i]} << (8 * i);
    return value;
}

Bytes acknowledgement(std::uint16_t status, std::uint16_t command, std::uint16_t id,
                      const Bytes& body) {
    Bytes packet;
    put(packet, control_magic, 4);
    put(packet, status, 2);
    put(packet, command, 2);
    put(packet, body.size(), 2);
    put(packet, id, 2);
    packet.insert(packet.end(), body.begin(), body.end());
    return packet;
}

}  // namespace

U3vCamera::U3vCamera(const U3vRegisters::Identity& identity)
    : description_(u3v_description(identity.vendor, identity.model, identity.serial)),
      registers_(identity),
      thread_([this] { run(); }) {}

U3vCamera::~U3vCamera() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void U3vCamera::plugged(bool in) {
    const std::lock_guard sending(sending_);
    const std::lock_guard lock(mutex_);
    plugged_ = in;
    acquiring_ = false;
    frames_.clear();
    late_answers_.clear();
    if (in) registers_.reset();  // powered by the bus
}

void U3vCamera::halt_cleared(std::uint8_t /*endpoint*/) { ++halts_cleared_; }

void U3vCamera::stall_data() { node()->halt(u3v_data_in); }

std::deque<U3vCamera::Exposure> U3vCamera::exposures() const {
    const std::lock_guard lock(mutex_);
    return exposures_;
}

bool U3vCamera::streaming() const {
    const std::lock_guard lock(mutex_);
    return acquiring_;
}

void U3vCamera::receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
    if (endpoint != u3v_control_out || muted_) return;
    if (bytes.size() < control_header || get(bytes, 0, 4) != control_magic) return;
    const auto command = static_cast<std::uint16_t>(get(bytes, 6, 2));
    const auto id = static_cast<std::uint16_t>(get(bytes, 10, 2));
    const auto parameters = bytes.subspan(control_header);
    Bytes body;
    std::uint16_t status = not_implemented;
    if (command == read_memory_command) status = read_memory(parameters, body);
    if (command == write_memory_command) status = write_memory(parameters, body);
    if ((get(bytes, 4, 2) & acknowledge_wanted) == 0) return;
    Bytes packet = acknowledgement(status, static_cast<std::uint16_t>(command + 1), id, body);
    const std::uint64_t pending_ms = pending_ms_.exchange(0);
    if (pending_ms == 0) {
        node()->send(u3v_control_in, std::move(packet));
        return;
    }
    Bytes promise;
    put(promise, 0, 2);
    put(promise, pending_ms, 2);
    node()->send(u3v_control_in, acknowledgement(success, pending_acknowledge, id, promise));
    const std::lock_guard lock(mutex_);
    late_answers_.push_back({camera_now_ns() + pending_ms * 500'000, std::move(packet)});
    changed_.notify_all();
}

std::uint16_t U3vCamera::read_memory(std::span<const std::uint8_t> command, Bytes& body) const {
    if (command.size() < 12) return invalid_parameter;
    body.resize(get(command, 10, 2));
    if (control_header + body.size() > registers_.bootstrap(sbrm_max_acknowledge)) {
        body.clear();
        return invalid_parameter;
    }
    if (registers_.read(get(command, 0, 8), body)) return success;
    body.clear();
    return invalid_address;
}

std::uint16_t U3vCamera::write_memory(std::span<const std::uint8_t> command, Bytes& body) {
    if (command.size() < 9) return invalid_parameter;
    const std::uint64_t address = get(command, 0, 8);
    const auto data = command.subspan(8);
    switch (registers_.write(address, data)) {
        case U3vRegisters::Written::no_such: return invalid_address;
        case U3vRegisters::Written::read_only: return write_protect;
        case U3vRegisters::Written::done: break;
    }
    written(static_cast<std::uint32_t>(address));
    put(body, 0, 2);
    put(body, data.size(), 2);
    return success;
}

void U3vCamera::written(std::uint32_t address) {
    switch (address) {
        case abrm_timestamp_latch:
            registers_.set_bootstrap(abrm_timestamp, camera_now_ns(), 8);
            break;
        case sirm_control:
            if (!stream_enabled()) node()->flush(u3v_data_in);
            break;
        case reg_acquisition_start: {
            const std::lock_guard lock(mutex_);
            acquiring_ = true;
            block_id_ = 0;
            free_run_next_ns_ = camera_now_ns();
            break;
        }
        case reg_acquisition_stop: {
            const std::lock_guard lock(mutex_);
            acquiring_ = false;
            frames_.clear();
            break;
        }
        case reg_trigger_software:
            if (registers_.value(reg_trigger_source) == 0) expose(camera_now_ns());
            break;
        default: break;
    }
    changed_.notify_all();
}

bool U3vCamera::listens(bool level) const {
    const bool falling = registers_.value(reg_trigger_activation) == 1;
    return level != falling && registers_.value(reg_trigger_mode) == 1 &&
           registers_.value(reg_trigger_source) == 1;
}

bool U3vCamera::trigger_line(bool level) { return listens(level) && expose(camera_now_ns()); }

std::optional<std::uint64_t> U3vCamera::shoot(Shot shot) {
    std::uint64_t block_id = 0;
    {
        const std::lock_guard lock(mutex_);
        if (!plugged_ || !acquiring_) return std::nullopt;
        block_id = block_id_++;
        const auto due = camera_now_ns() + static_cast<std::uint64_t>(
                                               std::max<std::int64_t>(0, shot.until_sent.count()));
        frames_.push_back({due, shot.timestamp_ns, block_id, std::move(shot)});
    }
    changed_.notify_all();
    return block_id;
}

bool U3vCamera::expose(std::uint64_t at_ns) {
    const auto exposure_ns =
        static_cast<std::uint64_t>(std::llround(registers_.real(reg_exposure_time) * 1e3));
    {
        const std::lock_guard lock(mutex_);
        if (!plugged_ || !acquiring_ || at_ns < busy_until_ns_) return false;
        busy_until_ns_ = at_ns + exposure_ns;
        frames_.push_back({busy_until_ns_ + readout_ns, at_ns, block_id_++, {}});
    }
    changed_.notify_all();
    return true;
}

void U3vCamera::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        const bool free_run = acquiring_ && registers_.value(reg_trigger_mode) == 0;
        std::uint64_t wake = camera_now_ns() + 100'000'000;
        if (free_run) wake = std::min(wake, free_run_next_ns_);
        if (!frames_.empty()) wake = std::min(wake, frames_.front().due_ns);
        if (!late_answers_.empty()) wake = std::min(wake, late_answers_.front().due_ns);
        changed_.wait_until(lock, host_time(wake));
        const std::uint64_t now = camera_now_ns();
        if (!late_answers_.empty() && now >= late_answers_.front().due_ns) {
            if (plugged_) node()->send(u3v_control_in, std::move(late_answers_.front().packet));
            late_answers_.pop_front();
        }
        if (free_run && now >= free_run_next_ns_) {
            const std::uint64_t at = free_run_next_ns_;
            const double rate = std::max(0.1, static_cast<double>(registers_.real(reg_frame_rate)));
            free_run_next_ns_ = std::max(now, at + static_cast<std::uint64_t>(1e9 / rate));
            lock.unlock();
            expose(at);
            lock.lock();
        }
        if (frames_.empty() || now < frames_.front().due_ns) continue;
        const Frame frame = frames_.front();
        frames_.pop_front();
        lock.unlock();
        transmit(frame);
        lock.lock();
    }
}

void U3vCamera::transmit(const Frame& frame) {
    const std::lock_guard sending(sending_);
    const std::uint32_t size = registers_.value(reg_payload_size);
    const bool room = node()->queued(u3v_data_in) < most_frames_queued * size;
    const unsigned to_drop = drop_;
    if (to_drop > 0) drop_ = to_drop - 1;
    const bool ready = stream_enabled() && registers_.bootstrap(sirm_payload_size) > 0 &&
                       !node()->halted(u3v_data_in);
    const bool sent = ready && room && to_drop == 0;
    {
        const std::lock_guard lock(mutex_);
        if (!plugged_) return;
        exposures_.push_back({frame.block_id, frame.start_ns, sent});
        if (exposures_.size() > exposures_kept) exposures_.pop_front();
    }
    if (frame.shot.done) frame.shot.done(sent);
    if (!sent) return;
    const Defect defect = defect_.exchange(Defect::none);
    if (defect != Defect::no_leader) send_leader(frame);
    send_payload(frame, defect);
    if (defect != Defect::no_trailer) send_trailer(frame);
}

void U3vCamera::send_leader(const Frame& frame) {
    constexpr std::uint16_t image = 1;
    Bytes leader;
    put(leader, leader_magic, 4);
    put(leader, 0, 2);
    put(leader, leader_size, 2);
    put(leader, frame.block_id, 8);
    put(leader, 0, 2);
    put(leader, image, 2);
    put(leader, frame.start_ns, 8);
    put(leader, registers_.value(reg_pixel_format), 4);
    put(leader, registers_.value(reg_width), 4);
    put(leader, registers_.value(reg_height), 4);
    put(leader, 0, 8);  // offsets
    put(leader, 0, 4);  // padding, reserved
    node()->send(u3v_data_in, std::move(leader));
}

// In transfers of the size that the host has set. A short packet ends one that is not full.
void U3vCamera::send_payload(const Frame& frame, Defect defect) {
    std::uint32_t size = registers_.value(reg_payload_size);
    if (defect == Defect::half_payload) size /= 2;
    if (defect == Defect::too_long) size += 4096;
    const std::uint32_t most = registers_.bootstrap(sirm_payload_size);
    for (std::uint32_t at = 0; at < size; at += most) {
        const std::uint32_t length = std::min(most, size - at);
        Bytes part(length, static_cast<std::uint8_t>(frame.block_id));
        if (frame.shot.pixels.size() >= at + length)
            std::copy_n(frame.shot.pixels.begin() + at, length, part.begin());
        if (at == 0) std::copy(frame.shot.mark.begin(), frame.shot.mark.end(), part.begin());
        if (defect == Defect::payload_like_leader)
            std::memcpy(part.data(), &leader_magic, sizeof leader_magic);
        node()->send(u3v_data_in, std::move(part));
        const bool asked_for =
            length == most || size - at == registers_.value(reg_payload_size) % most;
        if (!asked_for && length % packet_size == 0) node()->send(u3v_data_in, {});
    }
}

void U3vCamera::send_trailer(const Frame& frame) {
    Bytes trailer;
    put(trailer, trailer_magic, 4);
    put(trailer, 0, 2);
    put(trailer, trailer_size, 2);
    put(trailer, frame.block_id, 8);
    put(trailer, success, 2);
    put(trailer, 0, 2);
    put(trailer, registers_.value(reg_payload_size), 8);
    put(trailer, registers_.value(reg_height), 4);
    node()->send(u3v_data_in, std::move(trailer));
}

}  // namespace versavis::test
