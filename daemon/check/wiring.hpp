// SPDX-License-Identifier: BSD-3-Clause
// What is wired to what: from pulses that were sent, one output at a time, and from the edges and
// frames that followed, to one sentence for each fault.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "versavis/time.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// A camera as the configuration has it.
struct WiredCamera {
    std::string name;
    unsigned output = 0;  ///< that triggers it, and input of its exposure line
    bool strobe = true;   ///< its exposure line is wired
    Duration latency;     ///< trigger to start of exposure
};

/// An edge of an exposure input.
struct LineEdge {
    BoardTime at;
    bool exposing = false;  ///< the level that the configuration takes for an exposure begins
};

/// Frames of one camera.
struct FrameCount {
    std::size_t arrived = 0;
    std::size_t incomplete = 0;  ///< of those: packets are missing
};

/// Pulses at one output, and all that happened meanwhile. The gaps between them are irregular, and
/// longer than the exposures. Of inputs whose output sends no pulses, not all edges are known.
struct PulseRun {
    std::optional<unsigned> output;   ///< none: nothing was triggered
    Duration width;                   ///< of the pulses
    std::vector<BoardTime> pulses;    ///< when each began
    std::size_t skipped = 0;          ///< that were due while the camera still exposed
    std::vector<Duration> exposures;  ///< by camera, as it was set
    std::vector<FrameCount> frames;   ///< by camera
    std::array<std::vector<LineEdge>, wire::camera_count> inputs;  ///< edges in order of time
    bool working = false;  ///< at the exposure that the configuration asks for
};

/// One fault, or that there is none.
struct WiringFinding {
    std::string code;  ///< stable: for programs
    std::string text;  ///< what is wrong, and what to do
};

struct CameraWiring {
    std::string name;
    bool right = false;
    std::vector<WiringFinding> findings;
};

/// The runs: one without pulses; two for each output, with other widths and exposures; and for each
/// camera one `working` at its output. Anything that is missing is not judged.
std::vector<CameraWiring> judge_wiring(const std::vector<WiredCamera>& cameras,
                                       const std::vector<PulseRun>& runs);

}  // namespace versavis::daemon
