// SPDX-License-Identifier: BSD-3-Clause
// How a GigE Vision camera's packets are received: by a packet socket or by a UDP socket.
#pragma once

#include "configuration.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

/// By a packet socket, a frame is complete at most this much later: what was asked for comes within
/// it, and the receiver sleeps less between looks.
constexpr Duration packet_socket_lateness = milliseconds(2);

/// Lateness that varies may be this part of a period at most, the pairing's `close_by_arrival`, or
/// an arrival does not show which exposure its frame is of.
constexpr int latenesses_in_period = 3;

/// Arrivals by a packet socket still show which exposure a frame of this camera is of.
bool packet_socket_suits(const CameraConfiguration& camera);

/// What frames may be late by, beside what the network takes, in the modes that `receive` allows.
Duration receive_lateness(const CameraConfiguration& camera);

/// This process may open a packet socket (CAP_NET_RAW).
bool packet_socket_allowed();

/// `socket` or `packet`, which is for plain images alone. Error: `packet` is configured and not
/// allowed.
Expected<ReceiveMode> choose_receive_mode(const CameraConfiguration& camera, bool allowed,
                                          bool plain_images);

/// Empty for `automatic`: no mode was chosen.
const char* to_string(ReceiveMode mode);

}  // namespace versavis::daemon
