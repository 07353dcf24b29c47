// SPDX-License-Identifier: BSD-3-Clause
#include "gvsp_transmitter.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

#include "posix/thread.hpp"
#include "scene.hpp"

namespace versavis::rig {

namespace {

constexpr std::size_t most_waiting = 8;
constexpr std::size_t most_resendable = 4;
constexpr std::uint32_t ip_udp_header = 28;
constexpr std::uint32_t extended_id_flag = 0x80;
constexpr std::uint16_t payload_image = 0x0001;
constexpr std::uint16_t payload_image_with_chunks = 0x4001;
constexpr std::size_t batch = 16;

enum PacketFormat : std::uint8_t { leader = 1, trailer = 2, payload = 3 };

/// Eight bytes, or twenty with an extended block id.
using PacketHeader = std::vector<std::uint8_t>;

template <class T>
void put(std::vector<std::uint8_t>& out, T value) {
    for (int shift = static_cast<int>(sizeof(T) * 8) - 8; shift >= 0; shift -= 8)
        out.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >>
                                                static_cast<unsigned>(shift)));
}

std::uint32_t header_size(const StreamFrame& frame) { return frame.extended_id ? 20 : 8; }

PacketHeader packet_header(const StreamFrame& frame, PacketFormat format, std::uint32_t packet_id) {
    PacketHeader out;
    put(out, std::uint16_t{0});  // status
    put(out, static_cast<std::uint16_t>(frame.extended_id ? 0 : frame.block_id));
    if (!frame.extended_id) {
        put(out, std::uint32_t{format} << 24U | packet_id);
        return out;
    }
    put(out, (extended_id_flag | std::uint32_t{format}) << 24U);
    put(out, frame.block_id);
    put(out, packet_id);
    return out;
}

std::vector<std::uint8_t> leader_body(const StreamFrame& frame) {
    std::vector<std::uint8_t> out;
    put(out, std::uint16_t{0});
    put(out, frame.chunks.empty() ? payload_image : payload_image_with_chunks);
    put(out, frame.camera_time_ns);
    put(out, std::uint32_t{0x01080001});
    put(out, frame.width);
    put(out, frame.height);
    put(out, std::uint64_t{0});  // offsets
    put(out, std::uint32_t{0});  // paddings
    return out;
}

std::vector<std::uint8_t> trailer_body(const StreamFrame& frame) {
    std::vector<std::uint8_t> out;
    put(out, std::uint32_t{1});
    put(out, frame.height);
    return out;
}

std::size_t data_bytes(const StreamFrame& frame) {
    const std::size_t all = frame.pixels.size() + frame.chunks.size();
    return frame.missing == Missing::second_half ? all / 2 : all;
}

/// Pixels first, then chunks.
std::uint8_t data_byte(const StreamFrame& frame, std::size_t at) {
    return at < frame.pixels.size() ? frame.pixels[at] : frame.chunks[at - frame.pixels.size()];
}

std::uint32_t data_per_packet(const StreamFrame& frame, const StreamSettings& settings) {
    return settings.packet_size - ip_udp_header - header_size(frame);
}

std::uint32_t data_packets(const StreamFrame& frame, const StreamSettings& settings) {
    const std::uint32_t size = data_per_packet(frame, settings);
    return static_cast<std::uint32_t>((data_bytes(frame) + size - 1) / size);
}

/// A packet that is lost is also lost when it is asked for again: only frame and number decide.
bool lost(const StreamFrame& frame, const StreamSettings& settings, std::uint32_t id) {
    const bool full = id != 0 && id < data_packets(frame, settings);
    if (frame.largest_packet != 0 && full) return settings.packet_size > frame.largest_packet;
    const std::uint64_t mixed = (frame.block_id * 0x9E3779B97F4A7C15ULL + id) * 0xBF58476D1CE4E5B9;
    return static_cast<double>(mixed >> 40U) < frame.loss * static_cast<double>(1U << 24U);
}

std::chrono::nanoseconds until(HostTime time) {
    return std::chrono::nanoseconds((time - host_now()).ns);
}

}  // namespace

GvspTransmitter::GvspTransmitter(const std::string& address, double link_mbps, double packet_loss,
                                 std::uint64_t seed)
    : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)),
      link_mbps_(link_mbps),
      packet_loss_(packet_loss),
      random_(seed) {
    sockaddr_in self{};
    self.sin_family = AF_INET;
    self.sin_addr.s_addr = inet_addr(address.c_str());
    ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self);
    const int buffer = 4 << 20;
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    thread_ = start_thread("transmitter", [this] { run(); });
}

GvspTransmitter::~GvspTransmitter() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    thread_.join();
}

void GvspTransmitter::configure(const StreamSettings& settings) {
    const std::lock_guard lock(mutex_);
    settings_ = settings;
}

std::uint16_t GvspTransmitter::source_port() const {
    sockaddr_in self{};
    socklen_t size = sizeof self;
    ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&self), &size);
    return ntohs(self.sin_port);
}

void GvspTransmitter::send(StreamFrame frame) {
    {
        const std::lock_guard lock(mutex_);
        if (queue_.size() < most_waiting) {
            const bool overtakes = !queue_.empty() && queue_.back().after_next;
            if (overtakes) {
                queue_.back().after_next = false;
                queue_.back().due = std::max(queue_.back().due, frame.due);
                queue_.back().leader_due = queue_.back().due;
            }
            queue_.insert(overtakes ? queue_.end() - 1 : queue_.end(), std::move(frame));
            wake_.notify_all();
            return;
        }
    }
    frame.done(false);
}

void GvspTransmitter::clear() {
    std::deque<StreamFrame> dropped;
    {
        const std::lock_guard lock(mutex_);
        dropped.swap(queue_);
        sent_.clear();
    }
    for (const StreamFrame& frame : dropped) frame.done(false);
}

void GvspTransmitter::mute(HostTime until) {
    const std::lock_guard lock(mutex_);
    muted_until_ = until;
}

bool GvspTransmitter::muted() const {
    const std::lock_guard lock(mutex_);
    return host_now() < muted_until_;
}

void GvspTransmitter::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        if (queue_.empty() || queue_.front().after_next) {
            wake_.wait(lock);
            continue;
        }
        if (const auto left = until(queue_.front().leader_due); left.count() > 0) {
            wake_.wait_for(lock, left);
            continue;
        }
        StreamFrame frame = queue_.front();
        queue_.pop_front();
        const StreamSettings settings = settings_;
        lock.unlock();
        transmit(std::move(frame), settings);
        lock.lock();
    }
}

/// For requests to send it again. A packet that is to be missing is missing then, too.
void GvspTransmitter::keep(const StreamFrame& frame) {
    const std::lock_guard lock(mutex_);
    if (frame.missing == Missing::nothing) sent_.push_back(frame);
    if (sent_.size() > most_resendable) sent_.pop_front();
}

void GvspTransmitter::transmit(StreamFrame frame, const StreamSettings& settings) {
    if (frame.paint) {
        frame.painted =
            std::make_shared<std::vector<std::uint8_t>>(std::size_t{frame.width} * frame.height);
        frame.pixels = *frame.painted;
    } else {
        keep(frame);
    }
    const bool possible = settings.destination.sin_port != 0 && !muted();
    frame.done(possible && frame.missing == Missing::nothing);
    if (!possible) return;
    if (frame.missing != Missing::leader) send_packets(frame, settings, 0, 0, true);
    if (frame.paint) {
        if (const auto left = until(frame.exposed); left.count() > 0)
            std::this_thread::sleep_for(left);
        frame.paint(*frame.painted);
        keep(frame);
    }
    if (const auto left = until(frame.due); left.count() > 0) std::this_thread::sleep_for(left);
    std::uint32_t end = data_packets(frame, settings) + 1;  // the trailer
    if (frame.missing == Missing::end) --end;
    const double link_ns = link_mbps_ > 0 ? settings.packet_size * 8e3 / link_mbps_ : 0;
    const double ns_per_packet = link_ns + static_cast<double>(settings.packet_delay_ns);
    const HostTime begin = host_now();
    for (std::uint32_t first = 1; first < end; first += batch) {
        const HostTime due =
            begin + Duration{static_cast<std::int64_t>((first - 1) * ns_per_packet)};
        if (const auto left = until(due); left.count() > 0) std::this_thread::sleep_for(left);
        send_packets(frame, settings, first, std::min<std::uint32_t>(first + batch, end) - 1, true);
    }
    const HostTime last = host_now();
    if (frame.missing != Missing::end) send_packets(frame, settings, end, end, true);
    frame.sent(last);
}

/// A packet that has to be composed. Empty: its pixels can be sent from where they are.
std::vector<std::uint8_t> GvspTransmitter::special_body(const StreamFrame& frame,
                                                        const StreamSettings& settings,
                                                        std::uint32_t id) {
    if (id == 0) return leader_body(frame);
    if (id == data_packets(frame, settings) + 1) return trailer_body(frame);
    const std::size_t size = data_per_packet(frame, settings);
    const std::size_t begin = (id - 1) * size;
    const std::size_t end = std::min(begin + size, data_bytes(frame));
    if (id != 1 && end <= frame.pixels.size()) return {};
    std::vector<std::uint8_t> body(end - begin);
    for (std::size_t at = begin; at < end; ++at) body[at - begin] = data_byte(frame, at);
    const FrameMark mark{FrameMark::expected_magic, frame.serial};
    if (id == 1) std::memcpy(body.data(), &mark, std::min(sizeof mark, body.size()));
    return body;
}

void GvspTransmitter::send_packets(const StreamFrame& frame, const StreamSettings& settings,
                                   std::uint32_t first, std::uint32_t last, bool lossy) {
    const std::size_t size = data_per_packet(frame, settings);
    const std::uint32_t trailer_id = data_packets(frame, settings) + 1;
    last = std::min(last, trailer_id);
    std::array<PacketHeader, batch> headers;
    std::array<std::vector<std::uint8_t>, batch> special;
    std::array<std::array<iovec, 2>, batch> parts{};
    std::array<mmsghdr, batch> messages{};
    sockaddr_in destination = settings.destination;
    std::size_t count = 0;
    for (std::uint32_t id = first; id <= last && count < batch; ++id) {
        if (lossy && packet_loss_ > 0 &&
            std::uniform_real_distribution<>(0, 1)(random_) < packet_loss_)
            continue;
        if (lost(frame, settings, id)) continue;
        const PacketFormat format = id == 0 ? leader : id == trailer_id ? trailer : payload;
        headers[count] = packet_header(frame, format, id);
        special[count] = special_body(frame, settings, id);
        std::span<const std::uint8_t> body = special[count];
        if (body.empty())
            body = frame.pixels.subspan((id - 1) * size,
                                        std::min(size, data_bytes(frame) - (id - 1) * size));
        parts[count][0] = {headers[count].data(), headers[count].size()};
        parts[count][1] = {const_cast<std::uint8_t*>(body.data()), body.size()};
        messages[count].msg_hdr = {
            &destination, sizeof destination, parts[count].data(), 2, nullptr, 0, 0};
        ++count;
    }
    if (count > 0) ::sendmmsg(socket_.get(), messages.data(), static_cast<unsigned>(count), 0);
}

void GvspTransmitter::resend(std::uint64_t block_id, std::uint32_t first, std::uint32_t last) {
    StreamFrame frame;
    StreamSettings settings;
    {
        const std::lock_guard lock(mutex_);
        const auto found = std::find_if(sent_.begin(), sent_.end(), [&](const StreamFrame& f) {
            return f.block_id == block_id;
        });
        if (found == sent_.end() || host_now() < muted_until_) return;
        frame = *found;
        settings = settings_;
    }
    for (std::uint32_t id = first; id <= last; id += batch)
        send_packets(frame, settings, id, std::min<std::uint32_t>(last, id + batch - 1), false);
}

void GvspTransmitter::send_test_packet() {
    StreamSettings settings;
    {
        const std::lock_guard lock(mutex_);
        settings = settings_;
    }
    const std::vector<std::uint8_t> packet(settings.packet_size - ip_udp_header);
    ::sendto(socket_.get(), packet.data(), packet.size(), 0,
             reinterpret_cast<const sockaddr*>(&settings.destination), sizeof settings.destination);
}

}  // namespace versavis::rig
