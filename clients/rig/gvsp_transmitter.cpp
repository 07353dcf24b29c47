// SPDX-License-Identifier: BSD-3-Clause
#include "gvsp_transmitter.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "bytes.hpp"
#include "camera_registers.hpp"

namespace versavis::rig {

namespace {

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
    append_number(out, value, sizeof value, std::endian::big);
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
    put(out, pixel_format_mono8);
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

std::uint32_t data_per_packet(const StreamFrame& frame, const StreamSettings& settings) {
    return settings.packet_size - ip_udp_header - header_size(frame);
}

std::uint32_t data_packets(const StreamFrame& frame, const StreamSettings& settings) {
    const std::uint32_t size = data_per_packet(frame, settings);
    return static_cast<std::uint32_t>((frame.size() + size - 1) / size);
}

/// A packet that is lost is also lost when it is asked for again: only frame and number decide.
bool lost(const StreamFrame& frame, const StreamSettings& settings, std::uint32_t id) {
    const bool full = id != 0 && id < data_packets(frame, settings);
    if (frame.largest_packet != 0 && full) return settings.packet_size > frame.largest_packet;
    const std::uint64_t mixed = (frame.block_id * 0x9E3779B97F4A7C15ULL + id) * 0xBF58476D1CE4E5B9;
    return static_cast<double>(mixed >> 40U) < frame.loss * static_cast<double>(1U << 24U);
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
}

void GvspTransmitter::configure(const StreamSettings& settings) {
    const std::lock_guard lock(mutex_);
    settings_ = settings;
}

StreamSettings GvspTransmitter::current_settings() {
    const std::lock_guard lock(mutex_);
    return settings_;
}

std::uint16_t GvspTransmitter::source_port() const {
    sockaddr_in self{};
    socklen_t size = sizeof self;
    ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&self), &size);
    return ntohs(self.sin_port);
}

void GvspTransmitter::forget() {
    const std::lock_guard lock(mutex_);
    sent_.clear();
}

/// For requests to send it again. A packet that is to be missing is missing then, too.
void GvspTransmitter::keep(const StreamFrame& frame) {
    const std::lock_guard lock(mutex_);
    if (frame.missing == Missing::nothing) sent_.push_back(frame);
    if (sent_.size() > most_resendable) sent_.pop_front();
}

void GvspTransmitter::transmit(StreamFrame frame) {
    const StreamSettings settings = current_settings();
    if (!frame.paint) keep(frame);
    const bool possible = settings.destination.sin_port != 0;
    frame.done(possible && frame.missing == Missing::nothing);
    if (!possible) return;
    if (frame.missing != Missing::leader) send_packets(frame, settings, 0, 0, true);
    if (frame.paint) {
        frame.paint_when_exposed();
        keep(frame);
    }
    sleep_until(frame.due);
    std::uint32_t end = data_packets(frame, settings) + 1;  // the trailer
    if (frame.missing == Missing::end) --end;
    const double link_ns = link_mbps_ > 0 ? settings.packet_size * 8e3 / link_mbps_ : 0;
    const double ns_per_packet = link_ns + static_cast<double>(settings.packet_delay_ns);
    const HostTime begin = host_now();
    for (std::uint32_t first = 1; first < end; first += batch) {
        const HostTime due =
            begin + Duration{static_cast<std::int64_t>((first - 1) * ns_per_packet)};
        sleep_until(due);
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
    const std::size_t end = std::min(begin + size, frame.size());
    if (id != 1 && end <= frame.pixels.size()) return {};
    std::vector<std::uint8_t> body(end - begin);
    frame.copy(begin, body);
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
                                        std::min(size, frame.size() - (id - 1) * size));
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
        if (found == sent_.end()) return;
        frame = *found;
        settings = settings_;
    }
    for (std::uint32_t id = first; id <= last; id += batch)
        send_packets(frame, settings, id, std::min<std::uint32_t>(last, id + batch - 1), false);
}

void GvspTransmitter::send_test_packet() {
    const StreamSettings settings = current_settings();
    const std::vector<std::uint8_t> packet(settings.packet_size - ip_udp_header);
    ::sendto(socket_.get(), packet.data(), packet.size(), 0,
             reinterpret_cast<const sockaddr*>(&settings.destination), sizeof settings.destination);
}

}  // namespace versavis::rig
