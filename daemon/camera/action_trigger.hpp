// SPDX-License-Identifier: BSD-3-Clause
// Triggers a GigE Vision camera at instants of its own clock, by scheduled action commands.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "pipeline/camera_pipeline.hpp"
#include "posix/file_descriptor.hpp"

namespace versavis::daemon {

/// By which a camera knows the actions that are meant for it. They are sent to each camera alone,
/// so that all of them may have the same; another program's are of no avail.
constexpr std::uint32_t action_device_key = 0x56455253;
constexpr std::uint32_t action_group_key = 0x41564953;
constexpr std::uint32_t action_group_mask = 1;

/// GigE Vision's ACTION_CMD with a time, of which an acknowledge is wanted.
std::vector<std::uint8_t> scheduled_action(CameraTime at, std::uint16_t request);

/// Of an acknowledge: its status, 0 for success; none: it is not that of this request.
std::optional<std::uint16_t> action_status(std::span<const std::uint8_t> packet,
                                           std::uint16_t request);

/// Sends what the pipeline wants next, on a thread of its own, until it ends.
class ActionTrigger {
 public:
    /// Null: there is no socket to be had.
    static std::unique_ptr<ActionTrigger> create(in_addr interface, in_addr camera,
                                                 CameraPipeline& pipeline);
    ~ActionTrigger();
    ActionTrigger(const ActionTrigger&) = delete;
    ActionTrigger& operator=(const ActionTrigger&) = delete;

 private:
    ActionTrigger(FileDescriptor socket, CameraPipeline& pipeline);

    void run();
    void receive();

    FileDescriptor socket_;
    FileDescriptor stop_;
    CameraPipeline& pipeline_;
    std::uint16_t request_ = 0;  ///< newest ...
    std::uint64_t trigger_ = 0;  ///< ... and what it asks for
    std::thread thread_;
};

}  // namespace versavis::daemon
