// SPDX-License-Identifier: BSD-3-Clause
// A conversation with the board in the wire protocol, over the bulk endpoints of its CDC-ACM
// function, without the service.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "device/cdc_port.hpp"
#include "device/handshake.hpp"

namespace versavis::client {

class Conversation {
 public:
    /// Takes the board for this program. Error: also when another one has it.
    static device::UsbExpected<Conversation> open(const device::UsbDevice& device);

    /// Stops its cameras, too, as each hello does. Error: it does not answer in time.
    Expected<device::Greeting> greet();

    template <class T>
    Expected<> send(const T& message) {
        const wire::Frame frame = encoder_.encode(message);
        return write({frame.bytes, frame.size});
    }

    /// Takes packets until one of them is what is waited for, of which it returns true. False: none
    /// was in time.
    Expected<bool> listen(const std::function<bool(const wire::Packet&)>& take, Duration timeout);

    /// See device::CdcPort::touch().
    void touch() { port_.touch(); }

 private:
    Conversation(device::CdcPort port, std::string where)
        : port_(std::move(port)), where_(std::move(where)) {}

    Expected<> write(std::span<const std::uint8_t> bytes);

    device::CdcPort port_;
    std::string where_;
    wire::Decoder decoder_;
    device::Encoder encoder_;
};

}  // namespace versavis::client
