// SPDX-License-Identifier: BSD-3-Clause
// Any answers of a GigE Vision device to those who look for it and read its memory.
#include "camera/gvcp.hpp"

#include <sys/socket.h>

#include <stdexcept>

#include "camera/description.hpp"
#include "fuzz.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr const char* address = "127.213.86.1";  // of no other test
constexpr Duration patience = milliseconds(2);
constexpr ssize_t header_size = 8;

/// Answers each request with the next message of the input. The byte before it says whether it is
/// the body of an answer with the right header, or all of a packet.
class Device {
 public:
    explicit Device(fuzz::Bytes input)
        : messages_(input), socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in own{};
        own.sin_family = AF_INET;
        own.sin_port = htons(gvcp_port);
        own.sin_addr = *parse_address(address);
        if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0)
            throw std::runtime_error("the port of GigE Vision is in use at 127.213.86.1");
    }

    /// Called when a request may have come. True: the device is silent from here on.
    bool answer() {
        std::uint8_t request[1024];
        sockaddr_in from{};
        socklen_t size = sizeof from;
        const ssize_t count = ::recvfrom(socket_.get(), request, sizeof request, MSG_DONTWAIT,
                                         reinterpret_cast<sockaddr*>(&from), &size);
        idle_ = count < header_size ? idle_ + 1 : 0;
        if (idle_ > 0) return messages_.empty() || idle_ > 1;
        const std::uint8_t kind = messages_.byte();
        const fuzz::Bytes message = messages_.next();
        std::vector<std::uint8_t> sent(message.begin(), message.end());
        if ((kind & 1U) != 0) {
            const auto answered = static_cast<std::uint8_t>(request[3] + 1);
            const std::uint8_t header[header_size] = {0, 0, request[2], answered,
                                                      0, 0, request[6], request[7]};
            sent.insert(sent.begin(), header, header + header_size);
        }
        ::sendto(socket_.get(), sent.data(), sent.size(), 0,
                 reinterpret_cast<const sockaddr*>(&from), size);
        return false;
    }

 private:
    fuzz::Messages messages_;
    int idle_ = 0;  ///< calls since the last request
    FileDescriptor socket_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Device device({data, size});
    const Cancelled silent = [&] { return device.answer(); };
    static_cast<void>(DeviceSearch(address).wait(patience, silent));
    GvcpClient client(*parse_address("127.0.0.1"), *parse_address(address));
    static_cast<void>(client.read(gvcp_description_url, 512, patience, silent));
    static_cast<void>(read_description(client, silent));
    return 0;
}
