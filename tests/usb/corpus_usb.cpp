// SPDX-License-Identifier: BSD-3-Clause
// A bus with USB3 Vision cameras whose registers another program keeps: it passes on packets of the
// control channel. Run under umockdev-wrapper; prints the testbed's directory once all cameras are
// plugged in, and ends with standard input.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <umockdev.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include "simulated_device.hpp"
#include "u3v_description.hpp"

using namespace versavis::test;

namespace {

/// Of the control channel: a packet of the host and one of the camera.
constexpr std::size_t largest_packet = 65536;

constexpr int stop_interval_ms = 20;

int connect_to(const char* path) {
    const int socket = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un peer{};
    peer.sun_family = AF_UNIX;
    std::strncpy(peer.sun_path, path, sizeof peer.sun_path - 1);
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&peer), sizeof peer) == 0)
        return socket;
    ::close(socket);
    throw std::runtime_error(std::string("nobody keeps registers at ") + path);
}

class RemoteCamera final : public UsbFunction {
 public:
    RemoteCamera(const char* vendor, const char* model, const char* serial, const char* path)
        : description_(u3v_description(vendor, model, serial)), socket_(connect_to(path)) {}
    RemoteCamera(const RemoteCamera&) = delete;
    RemoteCamera& operator=(const RemoteCamera&) = delete;
    ~RemoteCamera() override {
        stop_ = true;
        if (thread_.joinable()) thread_.join();
        ::close(socket_);
    }

    const UsbDescription& description() const override { return description_; }
    void receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override {
        if (endpoint != u3v_control_out) return;
        [[maybe_unused]] const auto sent =
            ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    /// Once it is plugged in.
    void start() {
        thread_ = std::thread([this] { forward(); });
    }

 private:
    void forward() {
        std::vector<std::uint8_t> buffer(largest_packet);
        while (!stop_) {
            pollfd readable{socket_, POLLIN, 0};
            if (::poll(&readable, 1, stop_interval_ms) <= 0) continue;
            const ssize_t size = ::recv(socket_, buffer.data(), buffer.size(), 0);
            if (size <= 0) return;
            node()->send(u3v_control_in, Bytes(buffer.begin(), buffer.begin() + size));
        }
    }

    const UsbDescription description_;
    const int socket_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

/// A camera and its place on the bus, which it leaves first.
struct Plugged {
    std::shared_ptr<RemoteCamera> camera;
    std::unique_ptr<SimulatedDevice> device;
};

void run(std::span<char*> arguments) {
    const GObjectPtr<UMockdevTestbed> testbed(umockdev_testbed_new());
    std::vector<Plugged> cameras;
    for (; arguments.size() >= 4; arguments = arguments.subspan(4)) {
        Plugged next;
        next.camera =
            std::make_shared<RemoteCamera>(arguments[0], arguments[1], arguments[2], arguments[3]);
        next.device = std::make_unique<SimulatedDevice>(
            testbed.get(), "1-" + std::to_string(cameras.size() + 1), next.camera);
        next.camera->start();
        cameras.push_back(std::move(next));
    }
    std::printf("%s\n", umockdev_testbed_get_root_dir(testbed.get()));
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
}

}  // namespace

int main(int count, char** arguments) {
    if (count < 5 || count % 4 != 1) {
        std::fprintf(stderr, "usage: corpus_usb (VENDOR MODEL SERIAL SOCKET)...\n");
        return 64;
    }
    try {
        run({arguments + 1, static_cast<std::size_t>(count - 1)});
    } catch (const std::exception& error) {
        std::fprintf(stderr, "corpus_usb: %s\n", error.what());
        return 1;
    }
    return 0;
}
