// SPDX-License-Identifier: BSD-3-Clause
#include "gvsp_transmitter.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

#include "scene.hpp"

namespace versavis::rig {

namespace {

constexpr std::size_t most_waiting = 8;
constexpr std::size_t most_resendable = 4;
constexpr std::uint32_t ip_udp_header = 28;
constexpr std::uint32_t gvsp_header = 8;
constexpr std::size_t batch = 16;

enum PacketFormat : std::uint8_t { leader = 1, trailer = 2, payload = 3 };

using PacketHeader = std::array<std::uint8_t, gvsp_header>;

template <class T>
void put(std::vector<std::uint8_t>& out, T value) {
    for (int shift = static_cast<int>(sizeof(T) * 8) - 8; shift >= 0; shift -= 8)
        out.push_back(
            static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> static_cast<unsigned>(shift)));
}

PacketHeader packet_header(std::uint16_t block_id, PacketFormat format, std::uint32_t packet_id) {
    return {0,
            0,
            static_cast<std::uint8_t>(block_id >> 8U),
            static_cast<std::uint8_t>(block_id),
            format,
            static_cast<std::uint8_t>(packet_id >> 16U),
            static_cast<std::uint8_t>(packet_id >> 8U),
            static_cast<std::uint8_t>(packet_id)};
}

std::vector<std::uint8_t> leader_body(const StreamFrame& frame) {
    std::vector<std::uint8_t> out;
    put(out, std::uint16_t{0});
    put(out, std::uint16_t{1});  // image
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

std::chrono::nanoseconds until(HostTime time) { return std::chrono::nanoseconds((time - host_now()).ns); }

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
    ::bind(socket_, reinterpret_cast<const sockaddr*>(&self), sizeof self);
    const int buffer = 4 << 20;
    ::setsockopt(socket_, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    thread_ = std::thread([this] { run(); });
}

GvspTransmitter::~GvspTransmitter() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    thread_.join();
    ::close(socket_);
}

void GvspTransmitter::configure(const StreamSettings& settings) {
    const std::lock_guard lock(mutex_);
    settings_ = settings;
}

std::uint16_t GvspTransmitter::source_port() const {
    sockaddr_in self{};
    socklen_t size = sizeof self;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&self), &size);
    return ntohs(self.sin_port);
}

void GvspTransmitter::send(StreamFrame frame) {
    {
        const std::lock_guard lock(mutex_);
        if (queue_.size() < most_waiting) {
            queue_.push_back(std::move(frame));
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
        if (queue_.empty()) {
            wake_.wait(lock);
            continue;
        }
        if (const auto left = until(queue_.front().due); left.count() > 0) {
            wake_.wait_for(lock, left);
            continue;
        }
        const StreamFrame frame = queue_.front();
        queue_.pop_front();
        const StreamSettings settings = settings_;
        sent_.push_back(frame);
        if (sent_.size() > most_resendable) sent_.pop_front();
        lock.unlock();
        transmit(frame, settings);
        lock.lock();
    }
}

void GvspTransmitter::transmit(const StreamFrame& frame, const StreamSettings& settings) {
    const bool possible = settings.destination.sin_port != 0 && !muted();
    frame.done(possible);
    if (!possible) return;
    const std::uint32_t data_size = settings.packet_size - ip_udp_header - gvsp_header;
    const auto packets = static_cast<std::uint32_t>((frame.pixels.size() + data_size - 1) / data_size) + 2;
    const double ns_per_packet = link_mbps_ > 0 ? settings.packet_size * 8e3 / link_mbps_ : 0;
    const HostTime begin = host_now();
    for (std::uint32_t first = 0; first < packets; first += batch) {
        const HostTime due = begin + Duration{static_cast<std::int64_t>(first * ns_per_packet)};
        if (const auto left = until(due); left.count() > 0) std::this_thread::sleep_for(left);
        send_packets(frame, settings, first, std::min<std::uint32_t>(first + batch, packets) - 1, true);
    }
}

void GvspTransmitter::send_packets(const StreamFrame& frame, const StreamSettings& settings,
                                   std::uint32_t first, std::uint32_t last, bool lossy) {
    const std::uint32_t data_size = settings.packet_size - ip_udp_header - gvsp_header;
    const auto data_packets = static_cast<std::uint32_t>((frame.pixels.size() + data_size - 1) / data_size);
    last = std::min(last, data_packets + 1);
    std::array<PacketHeader, batch> headers;
    std::array<std::array<iovec, 2>, batch> parts{};
    std::array<mmsghdr, batch> messages{};
    sockaddr_in destination = settings.destination;
    std::size_t count = 0;
    for (std::uint32_t id = first; id <= last && count < batch; ++id) {
        if (lossy && packet_loss_ > 0 && std::uniform_real_distribution<>(0, 1)(random_) < packet_loss_)
            continue;
        std::span<const std::uint8_t> body;
        std::vector<std::uint8_t> made;
        PacketFormat format = payload;
        if (id == 0) {
            format = leader;
            made = leader_body(frame);
        } else if (id == data_packets + 1) {
            format = trailer;
            made = trailer_body(frame);
        } else {
            const std::size_t at = std::size_t{id - 1} * data_size;
            body = frame.pixels.subspan(at, std::min<std::size_t>(data_size, frame.pixels.size() - at));
            if (id == 1) {
                made.assign(body.begin(), body.end());
                const FrameMark mark{FrameMark::expected_magic, frame.serial};
                std::memcpy(made.data(), &mark, sizeof mark);
            }
        }
        headers[count] = packet_header(frame.block_id, format, id);
        parts[count][0] = {headers[count].data(), gvsp_header};
        if (!made.empty()) {
            const iovec single[2] = {{headers[count].data(), gvsp_header}, {made.data(), made.size()}};
            const msghdr message{
                &destination, sizeof destination, const_cast<iovec*>(single), 2, nullptr, 0, 0};
            if (count > 0) ::sendmmsg(socket_, messages.data(), static_cast<unsigned>(count), 0);
            ::sendmsg(socket_, &message, 0);
            count = 0;
            continue;
        }
        parts[count][1] = {const_cast<std::uint8_t*>(body.data()), body.size()};
        messages[count].msg_hdr = {&destination, sizeof destination, parts[count].data(), 2, nullptr, 0, 0};
        ++count;
    }
    if (count > 0) ::sendmmsg(socket_, messages.data(), static_cast<unsigned>(count), 0);
}

void GvspTransmitter::resend(std::uint16_t block_id, std::uint32_t first, std::uint32_t last) {
    StreamFrame frame;
    StreamSettings settings;
    {
        const std::lock_guard lock(mutex_);
        const auto found = std::find_if(sent_.begin(), sent_.end(),
                                        [&](const StreamFrame& f) { return f.block_id == block_id; });
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
    ::sendto(socket_, packet.data(), packet.size(), 0,
             reinterpret_cast<const sockaddr*>(&settings.destination), sizeof settings.destination);
}

}  // namespace versavis::rig
