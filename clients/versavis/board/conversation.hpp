// SPDX-License-Identifier: BSD-3-Clause
// A conversation with the board in the wire protocol, over the bulk endpoints of its CDC-ACM
// function, without the service.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "board/usb_bus.hpp"
#include "wire/packet.hpp"

namespace versavis::client {

/// What the board said of itself.
struct Greeting {
    wire::BoardHello hello{};  ///< of another protocol version: only its version
    bool understood = true;    ///< it speaks this protocol
    std::uint32_t nonce = 0;   ///< another one: it has booted since

    std::string serial() const;
    /// Name and version; of another protocol version, that.
    std::string firmware() const;
};

class Conversation {
 public:
    /// Takes the board for this program. Error: also when another one has it.
    static UsbExpected<Conversation> open(const UsbDevice& device);

    /// Stops its cameras, too, as each hello does. Error: it does not answer in time.
    Expected<Greeting> greet();

    template <class T>
    Expected<> send(const T& message) {
        wire::Frame frame{};
        wire::encode(message, nonce_, sequence_++, frame);
        return write({frame.bytes, frame.size});
    }

    /// Takes packets until one of them is what is waited for, of which it returns true. False: none
    /// was in time.
    Expected<bool> listen(const std::function<bool(const wire::Packet&)>& take, Duration timeout);

    /// Reboots the board into its boot loader in the way of serial ports, by 1200 baud, also when
    /// its program hangs.
    void touch();

 private:
    Conversation(UsbHandle handle, int control, UsbFunction data, std::string where);

    Expected<> write(std::span<const std::uint8_t> bytes);
    Expected<> say_hello();

    UsbHandle handle_;
    int control_;
    UsbFunction data_;
    std::string where_;
    wire::Decoder decoder_;
    std::uint32_t nonce_;
    std::uint32_t sequence_ = 0;
};

}  // namespace versavis::client
