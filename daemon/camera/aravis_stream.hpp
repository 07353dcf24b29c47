// SPDX-License-Identifier: BSD-3-Clause
// Frames of one camera through Aravis, received straight into the slots of its pipeline.
#pragma once

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "camera/auto_exposure.hpp"
#include "camera/camera_setup.hpp"
#include "camera/patient_work.hpp"
#include "engine/pairing/block_id.hpp"
#include "stream/camera_pipeline.hpp"

namespace versavis::daemon {

/// By which packets arrive and how large they are, before the stream is made. Error: no packet
/// passes.
Expected<> set_up_packets(ArvCamera* camera, const CameraConfiguration& configuration,
                          ReceiveMode receive);

class AravisStream {
 public:
    /// `camera` must outlive the stream. The pipeline's ring must be prepared. `meter` and
    /// `chunks`, the parser of what follows the pixels, may be null.
    static Expected<std::unique_ptr<AravisStream>> create(
        ArvCamera* camera, const CameraConfiguration& configuration, const CameraSetup& setup,
        CameraPipeline& pipeline, FrameMeter* meter, Object<ArvChunkParser> chunks,
        PatientWork& patient);
    ~AravisStream();  ///< gives back all slots; the camera need not answer any more
    AravisStream(const AravisStream&) = delete;
    AravisStream& operator=(const AravisStream&) = delete;

    /// True: frames must be fetched by poll(), because this transport calls nobody.
    bool needs_polling() const { return !calls_back_; }
    void poll(Duration timeout);

    /// What frames are like that do not fit any more, because size or format of all has changed;
    /// empty: they fit.
    std::string changed() const;

    /// Its stamps are the same for frame after frame.
    bool clock_stands() const { return equal_stamps_ >= stamps_of_a_standing_clock; }

    /// `socket` or `packet`; `automatic` where the transport is not GigE Vision.
    ReceiveMode receive_mode() const { return receive_; }

    /// Frames of any kind that were taken, and packets that arrived, so far.
    std::uint64_t taken() const { return taken_; }
    std::uint64_t packets() const;

 private:
    AravisStream(const CameraConfiguration& configuration, const CameraSetup& setup,
                 CameraPipeline& pipeline, FrameMeter* meter, PatientWork& patient)
        : configuration_(configuration),
          setup_(setup),
          pipeline_(pipeline),
          meter_(meter),
          patient_(patient) {}

    /// At half, two frames in a row that a clock of coarse ticks stamps alike would do; at twice,
    /// it shows three frames later.
    static constexpr unsigned stamps_of_a_standing_clock = 4;

    static void on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);
    void take(ArvBuffer* buffer);
    void refill();
    EventReason refusal(ArvBuffer* buffer) const;
    std::uint32_t stride(ArvBuffer* buffer) const;
    std::uint64_t block_id(ArvBuffer* buffer);
    double chunk_value(ArvBuffer* buffer, const ChunkFeature& feature) const;
    void note_starvation();
    void note_size(ArvBuffer* buffer, EventReason refused);
    void note_clock(const pairing::Arrival& arrival);
    void note_pauses(EventReason refused);
    void prepare_socket() const;
    void enlarge_receive_buffer(int socket) const;

    const CameraConfiguration& configuration_;
    CameraSetup setup_;
    CameraPipeline& pipeline_;
    FrameMeter* meter_;
    PatientWork& patient_;
    bool calls_back_ = true;
    ReceiveMode receive_ = ReceiveMode::automatic;
    std::shared_ptr<std::promise<void>> ended_ = std::make_shared<std::promise<void>>();
    std::atomic<std::uint64_t> changed_{0};  ///< width, height and the bytes that do not fit
    std::atomic<unsigned> equal_stamps_{0};
    std::atomic<std::uint64_t> taken_{0};
    std::uint64_t misfit_ = 0;  ///< the same of the newest frame, when it does not fit
    CameraTime stamp_;          ///< of the newest frame
    std::atomic<bool> closing_{false};
    Object<ArvStream> stream_;
    Object<ArvChunkParser> chunk_parser_;
    std::vector<std::uint32_t> queued_;  ///< slots that Aravis holds
    std::uint64_t underruns_ = 0;        ///< packets, as Aravis counts them
    std::uint64_t given_up_ = 0;         ///< frames of which Aravis missed too many packets to ask
    unsigned pauses_ = 0;                ///< complete ones among them, in a row
    unsigned packet_timeout_us_ = 0;     ///< silence within a frame after which packets are missed
    pairing::BlockIdUnwrapper block_ids_;
    std::uint32_t width_ = 0;  ///< of the first frame: the others must be of the same size
    std::uint32_t height_ = 0;
};

}  // namespace versavis::daemon
