// SPDX-License-Identifier: BSD-3-Clause
#include "foreign_packet.hpp"

namespace versavis::liar {

namespace {

constexpr std::size_t header_size = 12;
constexpr std::size_t crc_size = 4;
constexpr Field header_nonce{"nonce", 4, 4};
constexpr Field header_sequence{"sequence", 8, 4};

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
    }
    return ~crc;
}

std::uint64_t number(std::span<const std::uint8_t> bytes, const Field& field) {
    std::uint64_t value = 0;
    for (unsigned i = field.size; i-- > 0;) value = value << 8U | bytes[field.offset + i];
    return value;
}

void put(std::span<std::uint8_t> bytes, const Field& field, std::uint64_t value) {
    for (unsigned i = 0; i < field.size; ++i)
        bytes[field.offset + i] = static_cast<std::uint8_t>(value >> 8U * i);
}

std::optional<Bytes> without_cobs(std::span<const std::uint8_t> encoded) {
    Bytes plain;
    while (!encoded.empty()) {
        const std::size_t code = encoded[0];
        if (code == 0 || code > encoded.size()) return {};
        plain.insert(plain.end(), encoded.begin() + 1, encoded.begin() + code);
        encoded = encoded.subspan(code);
        if (code != 0xFF && !encoded.empty()) plain.push_back(0);
    }
    return plain;
}

Bytes with_cobs(std::span<const std::uint8_t> plain) {
    Bytes encoded{1};
    std::size_t code_at = 0;
    for (const std::uint8_t byte : plain) {
        if (encoded[code_at] == 0xFF) {
            code_at = encoded.size();
            encoded.push_back(1);
        }
        if (byte == 0) {
            code_at = encoded.size();
            encoded.push_back(1);
        } else {
            encoded.push_back(byte);
            ++encoded[code_at];
        }
    }
    encoded.push_back(0);
    return encoded;
}

}  // namespace

std::int64_t get(const Packet& packet, const Field& field) {
    return static_cast<std::int64_t>(number(packet.payload, field));
}

void set(Packet& packet, const Field& field, std::int64_t value) {
    put(packet.payload, field, static_cast<std::uint64_t>(value));
}

std::vector<Field> instants(Type type) {
    switch (type) {
        case Type::board_hello: return {board_hello_time};
        case Type::exposure: return {exposure::trigger_time, exposure::start, exposure::end};
        case Type::imu_sample: return {imu_sample::time};
        case Type::event: return {event::time};
        case Type::clock_answer: return {clock_answer::received, clock_answer::sent};
        case Type::clock_follow_up: return {clock_follow_up::sent};
        case Type::health: return {health_time};
        default: return {};
    }
}

std::optional<Packet> decode(std::span<const std::uint8_t> encoded) {
    const auto plain = without_cobs(encoded);
    if (!plain || plain->size() < header_size + crc_size) return {};
    const std::size_t covered = plain->size() - crc_size;
    const Field crc{"CRC", static_cast<unsigned>(covered), crc_size};
    if (number(*plain, crc) != crc32(std::span(*plain).first(covered))) return {};
    return Packet{static_cast<Type>((*plain)[0]),
                  static_cast<std::uint32_t>(number(*plain, header_nonce)),
                  static_cast<std::uint32_t>(number(*plain, header_sequence)),
                  {plain->begin() + header_size, plain->begin() + static_cast<long>(covered)}};
}

Bytes encode(const Packet& packet) {
    Bytes plain(header_size);
    plain[0] = static_cast<std::uint8_t>(packet.type);
    put(plain, header_nonce, packet.nonce);
    put(plain, header_sequence, packet.sequence);
    plain.insert(plain.end(), packet.payload.begin(), packet.payload.end());
    const std::uint32_t crc = crc32(plain);
    plain.resize(plain.size() + crc_size);
    put(plain, {"CRC", static_cast<unsigned>(plain.size() - crc_size), crc_size}, crc);
    return with_cobs(plain);
}

}  // namespace versavis::liar
