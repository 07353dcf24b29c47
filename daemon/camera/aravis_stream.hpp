// SPDX-License-Identifier: BSD-3-Clause
// Frames of one camera through Aravis, received straight into the slots of its pipeline.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "camera/auto_exposure.hpp"
#include "camera/camera_setup.hpp"
#include "engine/pairing/block_id.hpp"
#include "stream/camera_pipeline.hpp"

namespace versavis::daemon {

class AravisStream {
 public:
    /// `camera` must outlive the stream. The pipeline's ring must be prepared. `meter` may be null.
    static Expected<std::unique_ptr<AravisStream>> create(ArvCamera* camera,
                                                          const CameraConfiguration& configuration,
                                                          const CameraSetup& setup,
                                                          CameraPipeline& pipeline,
                                                          FrameMeter* meter);
    ~AravisStream();  ///< gives back all slots
    AravisStream(const AravisStream&) = delete;
    AravisStream& operator=(const AravisStream&) = delete;

    /// True: frames must be fetched by poll(), because this transport calls nobody.
    bool needs_polling() const { return !calls_back_; }
    void poll(Duration timeout);

 private:
    AravisStream(const CameraConfiguration& configuration, const CameraSetup& setup,
                 CameraPipeline& pipeline, FrameMeter* meter)
        : configuration_(configuration), setup_(setup), pipeline_(pipeline), meter_(meter) {}

    static void on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);
    void take(ArvBuffer* buffer);
    void refill();
    EventReason refusal(ArvBuffer* buffer) const;
    std::uint32_t stride(ArvBuffer* buffer) const;
    std::uint64_t block_id(ArvBuffer* buffer);
    Duration chunk_exposure(ArvBuffer* buffer) const;
    void note_starvation();
    void enlarge_receive_buffer() const;

    const CameraConfiguration& configuration_;
    CameraSetup setup_;
    CameraPipeline& pipeline_;
    FrameMeter* meter_;
    bool calls_back_ = true;
    std::atomic<bool> closing_{false};
    Object<ArvStream> stream_;
    Object<ArvChunkParser> chunk_parser_;
    std::vector<std::uint32_t> queued_;  ///< slots that Aravis holds
    std::uint64_t underruns_ = 0;        ///< packets, as Aravis counts them
    pairing::BlockIdUnwrapper block_ids_;
    std::uint32_t width_ = 0;  ///< of the first frame: the others must be of the same size
    std::uint32_t height_ = 0;
};

}  // namespace versavis::daemon
