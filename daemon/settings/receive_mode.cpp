// SPDX-License-Identifier: BSD-3-Clause
#include "receive_mode.hpp"

#include <sys/socket.h>

#include "posix/file_descriptor.hpp"

namespace versavis::daemon {

bool packet_socket_suits(const CameraConfiguration& camera) {
    return period_of(camera) >= packet_socket_lateness * latenesses_in_period;
}

Duration receive_lateness(const CameraConfiguration& camera) {
    const bool perhaps_packet =
        camera.receive == ReceiveMode::packet ||
        (camera.receive == ReceiveMode::automatic && packet_socket_suits(camera));
    return perhaps_packet ? packet_socket_lateness : Duration{};
}

bool packet_socket_allowed() {
    // It receives nothing.
    return FileDescriptor(::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0)).get() >= 0;
}

Expected<ReceiveMode> choose_receive_mode(const CameraConfiguration& camera, bool allowed,
                                          bool plain_images) {
    if (camera.receive == ReceiveMode::packet && !allowed)
        return failure("receive", "\"packet\" needs CAP_NET_RAW, which the service does not have",
                       "grant it by packet-socket.conf (docs/user/operations.md), or set receive = "
                       "\"auto\"");
    const bool packet =
        plain_images &&
        (camera.receive == ReceiveMode::packet ||
         (camera.receive == ReceiveMode::automatic && allowed && packet_socket_suits(camera)));
    return packet ? ReceiveMode::packet : ReceiveMode::socket;
}

const char* to_string(ReceiveMode mode) {
    switch (mode) {
        case ReceiveMode::automatic: return "";
        case ReceiveMode::socket: return "socket";
        case ReceiveMode::packet: return "packet";
    }
    return "";
}

}  // namespace versavis::daemon
