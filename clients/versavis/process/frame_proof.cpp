// SPDX-License-Identifier: BSD-3-Clause
#include "process/frame_proof.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::client {

namespace {

using namespace pairing;

// Of the period of the triggers: how far a frame's camera time may be from the exposure's. If
// lower, auto exposure, which moves the middle against what the camera stamps, leaves frames
// unproved; if higher, a camera that stamps by a coarse timer could still not be off by one
// trigger, which is eight times as far.
constexpr double tolerance = 0.125;

// Frames between two anchors on one side. If lower, the camera's clock rate is known less well; if
// higher, of a short stream the beginning stays unproved.
constexpr std::size_t anchor_distance = 10;

// How far beyond the anchors, in their distance.
constexpr double reach = 8;

/// Frames of one stream of the camera, in the order in which they arrived.
struct Frame {
    Arrival arrival;
    std::optional<Exposure> exposure;
    bool afterwards = false;
};

struct ProvedStream {
    Limits limits;
    std::vector<Frame> frames;
    std::vector<Exposure> spare;  ///< no frame was proved of them
};

class Collector final : public Outcome {
 public:
    std::vector<ProvedStream> streams;

 private:
    void paired(const Arrival& arrival, const Exposure& exposure) override {
        streams.back().frames.push_back({arrival, exposure, false});
    }
    void frame_unpaired(const Arrival& arrival, EventReason /*reason*/,
                        const Exposure* /*guess*/) override {
        streams.back().frames.push_back({arrival, std::nullopt, false});
    }
    void exposure_unpaired(const Exposure& exposure, EventReason /*reason*/) override {
        streams.back().spare.push_back(exposure);
    }
    void locked(const Exposure& /*first*/) override {}
    void slipped(const Arrival& /*at*/) override {}
};

double middle_of(const Exposure& exposure) {
    return static_cast<double>(middle(exposure.start, exposure.end).ns);
}

/// Two proved frames that an unproved one is measured by.
struct Anchors {
    const Frame* first;
    const Frame* second;
    bool around;  ///< one on each side
};

std::optional<Anchors> anchors(const std::vector<Frame>& frames, std::size_t at) {
    std::vector<const Frame*> before;
    std::vector<const Frame*> after;
    for (std::size_t i = at; i-- > 0 && before.size() <= anchor_distance;)
        if (frames[i].exposure && !frames[i].afterwards) before.push_back(&frames[i]);
    for (std::size_t i = at + 1; i < frames.size() && after.size() <= anchor_distance; ++i)
        if (frames[i].exposure && !frames[i].afterwards) after.push_back(&frames[i]);
    if (!before.empty() && !after.empty()) return Anchors{before.front(), after.front(), true};
    const auto& side = before.empty() ? after : before;
    if (side.size() <= anchor_distance) return std::nullopt;
    return Anchors{side.front(), side.back(), false};
}

bool steps_equal(const Frame& anchor, const Arrival& arrival, const Exposure& exposure) {
    return static_cast<std::int64_t>(arrival.block_id - anchor.arrival.block_id) ==
           static_cast<std::int64_t>(exposure.trigger - anchor.exposure->trigger);
}

/// By the camera's clock: it must show this exposure, and none beside it.
bool clock_agrees(const Anchors& by, const Arrival& arrival, const Exposure& exposure,
                  const Limits& limits) {
    const auto camera = [](const Frame& frame) {
        return static_cast<double>(frame.arrival.camera_time.ns);
    };
    const double span = camera(*by.second) - camera(*by.first);
    if (span == 0 || arrival.camera_time.ns == 0) return false;
    const double share = (static_cast<double>(arrival.camera_time.ns) - camera(*by.first)) / span;
    if (!by.around && std::abs(share) > reach) return false;
    const double begin = middle_of(*by.first->exposure);
    const double expected = begin + share * (middle_of(*by.second->exposure) - begin);
    return std::abs(middle_of(exposure) - expected) <
           tolerance * static_cast<double>(limits.period.ns);
}

bool proves(const Anchors& by, const Arrival& arrival, const Exposure& exposure,
            const Limits& limits) {
    if (!exposure.exposed || arrival.arrived < exposure.earliest_on_host) return false;
    const bool first = steps_equal(*by.first, arrival, exposure);
    const bool second = steps_equal(*by.second, arrival, exposure);
    const bool has_clock = limits.camera_clock && by.first->arrival.camera_time.ns != 0;
    // With the clock, one side's numbers are enough: on the other a frame may be lost.
    if (has_clock) return (first || second) && clock_agrees(by, arrival, exposure, limits);
    return by.around && first && second;
}

void prove_afterwards(ProvedStream& stream) {
    for (std::size_t i = 0; i < stream.frames.size(); ++i) {
        Frame& frame = stream.frames[i];
        if (frame.exposure) continue;
        const auto by = anchors(stream.frames, i);
        if (!by) continue;
        const auto fits = [&](const Exposure& exposure) {
            return proves(*by, frame.arrival, exposure, stream.limits);
        };
        const auto found = std::find_if(stream.spare.begin(), stream.spare.end(), fits);
        if (found == stream.spare.end() ||
            std::find_if(found + 1, stream.spare.end(), fits) != stream.spare.end())
            continue;
        frame.exposure = *found;
        frame.afterwards = true;
        stream.spare.erase(found);
    }
}

}  // namespace

struct FrameProof::Run {
    Collector collector;
    Replay replay{collector};
};

FrameProof::FrameProof() : run_(std::make_unique<Run>()) {}
FrameProof::FrameProof(FrameProof&&) noexcept = default;
FrameProof& FrameProof::operator=(FrameProof&&) noexcept = default;
FrameProof::~FrameProof() = default;

void FrameProof::add(const Evidence& evidence) {
    std::vector<ProvedStream>& streams = run_->collector.streams;
    if (const auto* limits = std::get_if<Limits>(&evidence)) {
        run_->replay.finish();  // gives back what it holds, to its own stream
        streams.push_back({*limits, {}, {}});
    }
    run_->replay.apply(evidence);
    if (begun() && std::holds_alternative<Reset>(evidence))
        streams.push_back({streams.back().limits, {}, {}});
}

bool FrameProof::begun() const { return run_->replay.begun(); }

std::vector<ProvedFrame> FrameProof::finish() {
    run_->replay.finish();
    std::vector<ProvedFrame> proved;
    for (ProvedStream& stream : run_->collector.streams) {
        std::stable_sort(
            stream.frames.begin(), stream.frames.end(),
            [](const auto& a, const auto& b) { return a.arrival.arrived < b.arrival.arrived; });
        prove_afterwards(stream);
        for (const Frame& frame : stream.frames)
            if (frame.exposure)
                proved.push_back({frame.arrival, *frame.exposure, frame.afterwards});
    }
    return proved;
}

}  // namespace versavis::client
