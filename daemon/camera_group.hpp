// SPDX-License-Identifier: BSD-3-Clause
// The cameras of the service, and when the board triggers each of them.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "board/board_link.hpp"
#include "camera/camera.hpp"
#include "control/control.hpp"
#include "health/status.hpp"
#include "pipeline/camera_pipeline.hpp"

namespace versavis::daemon {

/// All cameras are added before the first is started; after that it is thread-safe, but for what is
/// of the main thread.
class CameraGroup {
 public:
    CameraGroup(const ring::Place& rings, std::vector<CameraPreset> presets,
                const std::filesystem::path& state_directory, clock::Translator& translator,
                EventJournal& events, BoardLink& board);

    void add(const CameraConfiguration& configuration);
    void start();

    /// Pairs and stamps by these values from now on, and asks the cameras that they concern to take
    /// them; they are of the same cameras. Of the main thread.
    void reconfigure(const std::vector<CameraConfiguration>& configurations);

    /// Of a camera that is there. Of the main thread.
    void ask(const std::string& camera, CameraWish wish);
    ChangeReport changes(const std::string& camera) const;

    /// Waits for the end of all. False: some device still keeps the service waiting, whose camera
    /// and all that it uses must be left as they are until the process ends.
    bool stop(HostTime deadline);

    /// Bounded waits, heartbeats, and starts that the pairing asks for.
    void tick(HostTime now);

    /// The board's clock and numbers begin anew: what pairing holds is void.
    void board_restarted();

    /// The board can trigger: whatever streams is started.
    void board_connected();
    /// The board has other settings for the cameras at these outputs, and stopped them for it.
    void board_changed(std::uint8_t outputs);

    /// Stamp of the middle; none: of no camera here, or board time cannot be translated yet.
    std::optional<clock::Stamp> add(const wire::Exposure& record, HostTime received,
                                    std::optional<BoardTime> expected = std::nullopt);

    /// A pulse at an auxiliary input of the board.
    void auxiliary_pulse(unsigned input, BoardTime at);

    /// The board said that this output got no trigger.
    void triggers_skipped(unsigned output, std::uint64_t count);

    /// Names an event of the camera at output `entry.source`, which becomes the camera's number.
    void name_source(JournalEntry& entry) const;

    bool any_needs_board() const;  ///< it triggers a camera, or sees one
    const std::vector<CameraPreset>& presets() const { return environment_.presets; }
    std::vector<CameraStatus> status() const;
    std::vector<StreamStatus> streams() const;
    std::optional<PtpReport> ptp();  ///< none: no camera is triggered by it

 private:
    struct Unit {
        CameraConfiguration configuration;  ///< of the main thread
        bool enabled = true;                ///< the same
        std::unique_ptr<CameraPipeline> pipeline;
        std::unique_ptr<Camera> camera;
    };

    Camera::Hooks hooks(const CameraConfiguration& configuration, CameraPipeline& pipeline,
                        std::uint32_t index);
    const Unit* find(const std::string& name) const;
    const Unit* at_output(unsigned output) const;
    void start(CameraPipeline& pipeline, pairing::Start how);
    void start_streaming(const Unit& unit, pairing::Start how);

    CameraContext environment_;
    clock::Translator& translator_;
    EventJournal& events_;
    BoardLink& board_;
    PtpClocks ptp_;
    std::vector<Unit> units_;
};

}  // namespace versavis::daemon
