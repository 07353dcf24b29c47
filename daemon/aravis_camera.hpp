// SPDX-License-Identifier: BSD-3-Clause
// Aravis with our errors and lifetimes: a camera that is open, its features, and one stream into ring slots.
#pragma once

#include <arv.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "camera_pipeline.hpp"
#include "configuration.hpp"
#include "versavis/pairing/block_id.hpp"

namespace versavis::daemon {

struct ObjectDeleter {
    void operator()(void* object) const { g_object_unref(object); }
};
template <class T>
using Object = std::unique_ptr<T, ObjectDeleter>;

/// Set by Aravis's heartbeat thread, which must do nothing else.
using ControlLost = std::atomic<bool>;

/// Opens the device and takes control. Errors: not found, controlled by somebody else.
Expected<Object<ArvCamera>> open_camera(const std::string& device);

/// Sets trigger, lines and the features of the configuration, in the order that cameras need.
Expected<> configure_camera(ArvCamera* camera, const CameraConfiguration& configuration);

/// Sets any feature from text. Errors name the feature and the values that the camera allows.
Expected<> set_feature(ArvDevice* device, const std::string& name, const std::string& value);

/// Frames of one camera, received straight into the slots of its pipeline.
class AravisStream {
 public:
    /// `camera` must outlive the stream. The pipeline's ring must be prepared.
    static Expected<std::unique_ptr<AravisStream>> create(ArvCamera* camera,
                                                          const CameraConfiguration& configuration,
                                                          CameraPipeline& pipeline, std::uint64_t payload);
    ~AravisStream();  ///< gives back all slots
    AravisStream(const AravisStream&) = delete;
    AravisStream& operator=(const AravisStream&) = delete;

    /// True: frames must be fetched by poll(), because this transport calls nobody.
    bool needs_polling() const { return !calls_back_; }
    void poll(Duration timeout);

 private:
    AravisStream(const CameraConfiguration& configuration, CameraPipeline& pipeline, std::uint64_t payload)
        : configuration_(configuration), pipeline_(pipeline), payload_(payload) {}

    static void on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);
    void take(ArvBuffer* buffer);
    void refill();
    EventReason refusal(ArvBuffer* buffer) const;
    void enlarge_receive_buffer() const;

    const CameraConfiguration& configuration_;
    CameraPipeline& pipeline_;
    std::uint64_t payload_;
    bool calls_back_ = true;
    std::atomic<bool> closing_{false};
    Object<ArvStream> stream_;
    std::vector<std::uint32_t> queued_;  ///< slots that Aravis holds
    pairing::BlockIdUnwrapper block_ids_;
};

}  // namespace versavis::daemon
