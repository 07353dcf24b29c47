// SPDX-License-Identifier: BSD-3-Clause
// Plain images of one GigE Vision camera by a packet socket, received straight into the slots of
// its pipeline. The thread sleeps while packets come, and asks at once for those that are lost.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "base/detached_tasks.hpp"
#include "camera/frame_assembler.hpp"
#include "camera/frame_source.hpp"
#include "camera/gvcp.hpp"
#include "camera/packet_ring.hpp"
#include "engine/pairing/block_id.hpp"
#include "posix/file_descriptor.hpp"

namespace versavis::daemon {

class ImageReceiver final : public FrameSource, private FrameAssembler::Owner {
 public:
    /// Directs the camera's packets to here. `camera`, which is at `device`, must outlive it. The
    /// pipeline's ring must be prepared. `meter` may be null.
    static Expected<std::unique_ptr<FrameSource>> create(ArvCamera* camera,
                                                         const NetworkDevice& device,
                                                         const CameraConfiguration& configuration,
                                                         const CameraSetup& setup,
                                                         CameraPipeline& pipeline,
                                                         FrameMeter* meter, DetachedTasks& patient);
    ~ImageReceiver() override;  ///< gives back all slots; the camera need not answer any more

    std::uint64_t packets() const override { return packets_; }
    bool unsuited() const override { return no_image_; }

 private:
    struct Stream {
        std::size_t packet_size = 0;
        bool sends_again = false;
        std::uint64_t ticks_per_second = 0;
    };

    ImageReceiver(ArvDevice* device, PacketRing ring, const Stream& stream,
                  const CameraConfiguration& configuration, const CameraSetup& setup,
                  CameraPipeline& pipeline, FrameMeter* meter, DetachedTasks& patient);

    std::optional<FrameAssembler::Memory> begin_frame() override;
    void end_frame(const FrameAssembler::Frame& frame) override;
    void ask(const gvsp::PacketRange& range) override;

    void run();
    std::uint32_t drain(HostTime now);
    void wait(std::uint32_t arrived, HostTime now) const;

    ArvDevice* device_;
    DetachedTasks& patient_;
    PacketRing ring_;
    Stream stream_;
    FrameAssembler assembler_;
    pairing::BlockIdUnwrapper block_ids_;
    std::uint16_t request_ = 0;
    std::atomic<std::uint64_t> packets_{0};
    std::atomic<bool> no_image_{false};
    FileDescriptor stop_;
    std::thread thread_;
};

}  // namespace versavis::daemon
