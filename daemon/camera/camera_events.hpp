// SPDX-License-Identifier: BSD-3-Clause
// Switches on the events of an open camera that the service uses, and has them sent to it.
#pragma once

#include <memory>
#include <string>

#include "camera/aravis_node_map.hpp"
#include "camera/message_channel.hpp"

namespace versavis::daemon {

/// Before the camera acquires. Null: it has no such events, refuses them, or is no GigE Vision one.
std::unique_ptr<MessageChannel> receive_events(AravisNodeMap& nodes, in_addr interface,
                                               in_addr camera, MessageChannel::Sink sink);

}  // namespace versavis::daemon
