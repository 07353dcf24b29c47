// SPDX-License-Identifier: BSD-3-Clause
// Sends the events of an emulated GigE Vision camera over its message channel, each at its time.
#pragma once

#include <netinet/in.h>

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <thread>

#include "camera_transport.hpp"
#include "posix/thread.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// Thread-safe.
class EventSender {
 public:
    /// `socket`: of the camera's control port, whose address the packets come from.
    explicit EventSender(int socket)
        : socket_(socket), thread_(start_thread("events", [this] { run(); })) {}
    ~EventSender();
    EventSender(const EventSender&) = delete;
    EventSender& operator=(const EventSender&) = delete;

    /// Port 0: events are dropped.
    void direct_to(const sockaddr_in& destination);
    void send(HostTime due, const TimedEvent& event);

 private:
    void run();
    void transmit(const TimedEvent& event);

    int socket_;
    std::mutex mutex_;
    std::condition_variable wake_;
    bool stop_ = false;
    sockaddr_in destination_{};
    std::uint16_t request_ = 0;
    std::multimap<HostTime, TimedEvent> events_;
    std::thread thread_;
};

}  // namespace versavis::rig
