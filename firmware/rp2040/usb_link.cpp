// SPDX-License-Identifier: BSD-3-Clause
#include "usb_link.hpp"

#include <cstring>

namespace versavis::rp2040 {

namespace {

// One bit takes 83 ns.

/// From the last byte of a packet until its acknowledgement is known, at most: the host's
/// turn-around of 2 to 8 bits, 19 bits of handshake, and the interrupt. What the host had by then,
/// it had that much earlier.
constexpr Nanoseconds acknowledged_after = 3'000;

/// The same for a packet of the host, whose acknowledgement the board sends.
constexpr Nanoseconds received_before = 2'500;

constexpr std::size_t word_size = sizeof(std::uint32_t);

void ask_for_work() { interrupt_controller().set_pending = 1U << interrupt_usb_work; }

}  // namespace

std::size_t UsbLink::free_space() {
    const std::size_t free = capacity - (written_ - taken_);
    if (free < capacity / 2) was_full_ = true;
    return free < word_size ? 0 : free - word_size;
}

void UsbLink::write(const std::uint8_t* data, std::size_t size) {
    const std::size_t at = written_ % capacity;
    const std::size_t first = size < capacity - at ? size : capacity - at;
    std::memcpy(outgoing_ + at, data, first);
    if (first < size) std::memcpy(outgoing_, data + first, size - first);
    std::size_t end = written_ + size;
    // After the zero that ends a packet more of them mean nothing. Thus the next packet begins with
    // a word, and words are copied faster than bytes.
    if (size > 0 && data[size - 1] == 0)
        for (; end % word_size != 0; ++end) outgoing_[end % capacity] = 0;
    written_ = end;
    if (!sending_) ask_for_work();
}

std::size_t UsbLink::read(std::uint8_t* data, Nanoseconds& received) {
    if (read_ == received_) return 0;
    const Packet& packet = incoming_[read_ % packets];
    const std::size_t size = packet.size;
    std::memcpy(data, packet.bytes, size);
    received = packet.at;
    read_ = read_ + 1;
    ask_for_work();
    return size;
}

void UsbLink::watch_departure() {
    const InterruptsOff undisturbed;
    watched_ = written_;
    watching_ = true;
    departed_ = false;
}

bool UsbLink::take_departure(Nanoseconds& at) {
    if (!departed_) return false;
    departed_ = false;
    at = departed_at_;
    return true;
}

std::size_t UsbLink::fill(std::uint8_t* packet) {
    const std::uint32_t waiting = written_ - taken_;
    const std::size_t size = waiting < packet_size ? waiting : packet_size;
    const std::size_t at = taken_ % capacity;
    const std::size_t first = size < capacity - at ? size : capacity - at;
    std::memcpy(packet, outgoing_ + at, first);
    if (first < size) std::memcpy(packet + first, outgoing_, size - first);
    taken_ = taken_ + size;
    if (was_full_ && written_ - taken_ < capacity / 2) {
        was_full_ = false;
        wake_flag_.ask();
    }
    return size;
}

void UsbLink::sent(std::size_t size, std::uint32_t at_us) {
    sent_count_ = sent_count_ + size;
    if (!watching_ || static_cast<std::int32_t>(sent_count_ - watched_) < 0) return;
    watching_ = false;
    departed_at_ = clock_.at(at_us) - acknowledged_after;
    departed_ = true;
    wake_flag_.ask();
}

void UsbLink::receive(const std::uint8_t* data, std::size_t size, std::uint32_t at_us) {
    Packet& packet = incoming_[received_ % packets];
    std::memcpy(packet.bytes, data, size);
    packet.size = size;
    packet.at = clock_.at(at_us) - received_before;
    received_ = received_ + 1;
    wake_flag_.ask();
}

void UsbLink::forget(std::uint32_t in_flight) {
    taken_ = written_;
    sent_count_ = taken_ - in_flight;
    watching_ = departed_ = sending_ = false;
}

}  // namespace versavis::rp2040
