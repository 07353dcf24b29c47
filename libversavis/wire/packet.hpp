// SPDX-License-Identifier: BSD-3-Clause
// Packs structs of messages.hpp into COBS frames with CRC and finds them again in a byte stream;
// freestanding.
#pragma once

#include <cstring>

#include "wire/cobs.hpp"
#include "wire/crc32.hpp"
#include "wire/messages.hpp"

namespace versavis::wire {

inline constexpr std::size_t crc_size = sizeof(std::uint32_t);
/// Most bytes that one packet takes in the stream, with its delimiter.
inline constexpr std::size_t max_frame_size = cobs_bound(max_packet_size) + 1;

/// Bytes of one encoded packet, with its delimiter.
struct Frame {
    alignas(4) std::uint8_t bytes[max_frame_size];
    std::size_t size;
};

/// A packet with the right CRC and, if its type is known, the right size: receivers ignore unknown
/// types. A board_hello of another major version has whatever size that gives it.
/// `payload` lives until the decoder's next call.
struct Packet {
    Header header;
    const std::uint8_t* payload;
    std::size_t payload_size;

    /// Which version a board_hello is of, whatever that version made of the rest.
    bool read(HelloVersion& out) const {
        if (header.type != Type::board_hello || payload_size < sizeof out) return false;
        std::memcpy(&out, payload, sizeof out);
        return true;
    }

    /// The payload as T when the packet is one; false otherwise.
    template <class T>
    bool read(T& out) const {
        if (header.type != T::type || payload_size != sizeof(T)) return false;
        std::memcpy(&out, payload, sizeof(T));
        return true;
    }
};

/// Encodes a message of `type`, the `size` bytes at `message`, with the sender's nonce and sequence
/// number. All in all at most max_packet_size.
inline void encode(Type type, const void* message, std::size_t size, std::uint32_t nonce,
                   std::uint32_t sequence, Frame& frame) {
    const std::size_t body = sizeof(Header) + size;
    const std::size_t whole = body + crc_size;
    // Where words are copied as such, and from where it is stuffed in place.
    constexpr std::size_t ahead = 4;
    static_assert(ahead >= cobs_bound(max_packet_size) - max_packet_size &&
                      ahead + max_packet_size <= max_frame_size,
                  "has room");
    std::uint8_t* const raw = frame.bytes + ahead;
    const Header header{type, {}, nonce, sequence};
    std::memcpy(raw, &header, sizeof header);
    std::memcpy(raw + sizeof header, message, size);
    const std::uint32_t crc = crc32(raw, body);
    std::memcpy(raw + body, &crc, crc_size);
    frame.size = cobs_encode(raw, whole, frame.bytes);
    frame.bytes[frame.size++] = 0;
}

template <class T>
void encode(const T& message, std::uint32_t nonce, std::uint32_t sequence, Frame& frame) {
    static_assert(std::is_trivially_copyable<T>::value && sizeof(T) == payload_size(T::type),
                  "a wire struct");
    static_assert(sizeof(Header) + sizeof(T) + crc_size <= max_packet_size, "fits");
    encode(T::type, &message, sizeof message, nonce, sequence, frame);
}

/// Cuts a byte stream into packets. Malformed input is counted and skipped up to the next
/// delimiter.
class Decoder {
 public:
    /// Takes `size` bytes and calls on_packet(const Packet&) for each that completes a valid
    /// packet.
    template <class OnPacket>
    void feed(const std::uint8_t* data, std::size_t size, OnPacket&& on_packet) {
        for (std::size_t i = 0; i < size; ++i) {
            if (data[i] != 0) {
                if (filled_ < sizeof encoded_)
                    encoded_[filled_++] = data[i];
                else
                    overflow_ = true;
                continue;
            }
            Packet packet{};
            if (filled_ == 0 && !overflow_) continue;  // delimiters may be repeated
            if (!overflow_ && open(packet))
                on_packet(static_cast<const Packet&>(packet));
            else
                ++errors_;
            filled_ = 0;
            overflow_ = false;
        }
    }

    /// Runs of bytes between delimiters that were not a valid packet.
    std::uint32_t errors() const { return errors_; }

 private:
    bool open(Packet& packet) {
        const std::size_t size = cobs_decode(encoded_, filled_, decoded_, sizeof decoded_);
        if (size == cobs_invalid || size < sizeof(Header) + crc_size) return false;
        std::uint32_t crc = 0;
        std::memcpy(&crc, decoded_ + size - crc_size, crc_size);
        if (crc != crc32(decoded_, size - crc_size)) return false;
        std::memcpy(&packet.header, decoded_, sizeof packet.header);
        packet.payload = decoded_ + sizeof packet.header;
        packet.payload_size = size - sizeof packet.header - crc_size;
        HelloVersion version{};
        if (packet.read(version) && version.major != protocol_major) return true;
        const std::size_t known = payload_size(packet.header.type);
        return known == 0 || known == packet.payload_size;
    }

    bool overflow_ = false;
    std::size_t filled_ = 0;
    std::uint32_t errors_ = 0;
    std::uint8_t encoded_[max_frame_size - 1] = {};
    std::uint8_t decoded_[max_packet_size] = {};
};

}  // namespace versavis::wire
