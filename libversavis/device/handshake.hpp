// SPDX-License-Identifier: BSD-3-Clause
// How a program begins to talk to the board (docs/contracts/wire-protocol.md), whatever carries
// their bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <span>
#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"
#include "wire/packet.hpp"

namespace versavis::device {

/// Hellos until the board is given up, and the time for the answer to each.
inline constexpr int hello_attempts = 5;
inline constexpr Duration hello_timeout = milliseconds(250);

/// What the board says of itself.
struct Greeting {
    wire::BoardHello hello{};  ///< of another major version: only its version
    bool understood = true;    ///< it speaks this protocol
    std::uint32_t nonce = 0;   ///< another one: it has booted since

    std::string serial() const;
    /// Name and version; of another protocol version, that.
    std::string firmware() const;
};

/// None: the packet is something else.
std::optional<Greeting> read_greeting(const wire::Packet& packet);

/// Numbers what one connection sends, under a nonce of its own.
class Encoder {
 public:
    template <class T>
    wire::Frame encode(const T& message) {
        wire::Frame frame{};
        wire::encode(message, nonce_, sequence_++, frame);
        return frame;
    }

 private:
    std::uint32_t nonce_ = std::random_device{}();
    std::uint32_t sequence_ = 0;
};

/// Says hello until it is answered, which `answered` waits for. False: the board does not answer.
Expected<bool> greet(Encoder& encoder,
                     const std::function<Expected<>(std::span<const std::uint8_t>)>& write,
                     const std::function<Expected<bool>(Duration)>& answered);

}  // namespace versavis::device
