// SPDX-License-Identifier: BSD-3-Clause
#include "usb_bridge.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <stdexcept>

namespace versavis::test {

UsbBridge::UsbBridge(UMockdevTestbed* testbed, const std::string& socket_path,
                     const std::string& serial)
    : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un peer{};
    peer.sun_family = AF_UNIX;
    std::strncpy(peer.sun_path, socket_path.c_str(), sizeof peer.sun_path - 1);
    if (::connect(socket_, reinterpret_cast<const sockaddr*>(&peer), sizeof peer) != 0) {
        ::close(socket_);
        throw std::runtime_error("no rig is listening at " + socket_path);
    }
    device_ = std::make_unique<SimulatedUsbDevice>(
        testbed, serial, [this](std::span<const std::byte> bytes) {
            [[maybe_unused]] const auto sent =
                ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        });
    thread_ = std::thread([this] { forward(); });
}

UsbBridge::~UsbBridge() {
    stop_ = true;
    thread_.join();
    device_.reset();
    ::close(socket_);
}

void UsbBridge::forward() {
    std::array<std::byte, 4096> buffer{};
    while (!stop_) {
        pollfd readable{socket_, POLLIN, 0};
        if (::poll(&readable, 1, 20) <= 0) continue;
        const ssize_t size = ::recv(socket_, buffer.data(), buffer.size(), 0);
        if (size <= 0) return;
        device_->send(std::span(buffer).first(static_cast<std::size_t>(size)));
    }
}

}  // namespace versavis::test
