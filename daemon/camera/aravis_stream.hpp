// SPDX-License-Identifier: BSD-3-Clause
// Frames of one camera through Aravis, received straight into the slots of its pipeline.
#pragma once

#include <atomic>
#include <future>
#include <memory>
#include <vector>

#include "base/detached_tasks.hpp"
#include "camera/frame_source.hpp"
#include "engine/pairing/block_id.hpp"

namespace versavis::daemon {

/// How large packets are, and that Aravis receives them by a UDP socket, before a stream is made.
/// Error: no packet passes.
Expected<> set_up_packets(ArvCamera* camera, const CameraConfiguration& configuration);

class AravisStream final : public FrameSource {
 public:
    /// `camera` must outlive the stream. The pipeline's ring must be prepared. `meter` and
    /// `chunks`, the parser of what follows the pixels, may be null.
    static Expected<std::unique_ptr<FrameSource>> create(
        ArvCamera* camera, const CameraConfiguration& configuration, const CameraSetup& setup,
        CameraPipeline& pipeline, FrameMeter* meter, Object<ArvChunkParser> chunks,
        DetachedTasks& patient);
    ~AravisStream() override;  ///< gives back all slots; the camera need not answer any more

    bool needs_polling() const override { return !calls_back_; }
    void poll(Duration timeout) override;
    std::uint64_t packets() const override;

 private:
    AravisStream(const CameraConfiguration& configuration, const CameraSetup& setup,
                 CameraPipeline& pipeline, FrameMeter* meter, DetachedTasks& patient)
        : FrameSource(configuration, setup, pipeline, meter), patient_(patient) {}

    static void on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);
    void take(ArvBuffer* buffer);
    void refill();
    std::uint64_t block_id(ArvBuffer* buffer);
    double chunk_value(ArvBuffer* buffer, const ChunkFeature& feature) const;
    void note_starvation();
    void note_pauses(bool good);
    void enlarge_receive_buffer() const;

    DetachedTasks& patient_;
    bool calls_back_ = true;
    std::shared_ptr<std::promise<void>> ended_ = std::make_shared<std::promise<void>>();
    std::atomic<bool> closing_{false};
    Object<ArvStream> stream_;
    Object<ArvChunkParser> chunk_parser_;
    std::vector<std::uint32_t> queued_;  ///< slots that Aravis holds
    std::uint64_t underruns_ = 0;        ///< packets, as Aravis counts them
    std::uint64_t given_up_ = 0;         ///< frames of which Aravis missed too many packets to ask
    unsigned pauses_ = 0;                ///< complete ones among them, in a row
    unsigned packet_timeout_us_ = 0;     ///< silence within a frame after which packets are missed
    pairing::BlockIdUnwrapper block_ids_;
};

}  // namespace versavis::daemon
