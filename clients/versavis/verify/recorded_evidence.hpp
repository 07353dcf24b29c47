// SPDX-License-Identifier: BSD-3-Clause
// What a recording says of its stamps and of what they were made from, read by the contracts
// (docs/contracts/shm-layout.md) alone: the code that judges stamps shares nothing with the code
// that makes them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/picture_offset.hpp"
#include "recording/recording.hpp"
#include "verify/message_stamps.hpp"
#include "versavis/error.hpp"
#include "versavis/metadata.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Host to board and back.
struct ClockExchange {
    std::uint32_t nonce;
    HostTime sent;
    BoardTime received;
    BoardTime answered;
    HostTime arrived;
};

/// Board to host.
struct ClockMessage {
    std::uint32_t nonce;
    BoardTime departed;
    HostTime arrived;
};

struct OutputReading {
    std::uint32_t epoch;
    HostTime host;
    Duration minus_host;
    Duration uncertainty;  ///< bounds the error of `minus_host`
};

/// A PPS pulse whose second is known.
struct NamedPulse {
    std::uint32_t epoch;
    BoardTime board;
    HostTime host;
    std::int64_t utc_s;
};

struct ClockEvidence {
    std::vector<ClockExchange> exchanges;
    std::vector<ClockMessage> messages;
    std::vector<OutputReading> outputs;
    std::vector<NamedPulse> pulses;
};

/// What is in front of each stamp: where it is in the stream, and when it was recorded.
struct StampedItem {
    std::uint64_t number;  ///< in its segment of the ring
    std::uint64_t life;
    OutputTime time;
};

struct StampedFrame : StampedItem {
    FrameMetadata frame;
};

struct StampedSample : StampedItem {
    BoardTime board;
    HostTime host;
    std::uint64_t sample;
    Duration filter_delay;
    std::uint32_t sigma_ns;
    std::uint32_t epoch;
    std::uint32_t flags;
};

struct ExposureEvidence {
    std::uint64_t trigger;
    BoardTime start;  ///< delays of the lines are subtracted from both
    BoardTime end;
    Duration delay;
    bool exposed;
};

/// The message `exposure` as the board sent it.
struct ExposureRecord {
    std::uint64_t trigger;
    BoardTime start;  ///< delays are not subtracted
    BoardTime end;
    bool measured;  ///< both edges
};

struct ArrivalEvidence {
    std::uint64_t block_id;
    CameraTime camera;  ///< 0: none
    HostTime arrived;
    Duration exposure;  ///< as the camera states it; 0: it does not
};

/// One stream of a camera, from its beginning to the next one, within one boot of the board.
struct CameraRun {
    Duration period;          ///< 0: not known
    Duration latest_arrival;  ///< after the end of the exposure, as the service allows
    std::vector<ExposureEvidence> exposures;
    std::vector<ExposureRecord> records;
    std::vector<ArrivalEvidence> arrivals;
};

struct CameraEvidence {
    std::string name;
    std::vector<StampedFrame> frames;
    std::vector<CameraRun> runs;
    std::vector<RecordedGap> gaps;
    PictureEvidence pictures{};    ///< if they were compared with the gyro
    std::uint64_t impossible = 0;  ///< frames whose times no clock can have: left out
};

struct ImuEvidence {
    std::string name;
    std::vector<StampedSample> samples;
    std::vector<RecordedGap> gaps;
    std::uint64_t impossible = 0;  ///< likewise
};

struct RecordedEvidence {
    ClockEvidence clock;
    std::vector<CameraEvidence> cameras;
    std::vector<ImuEvidence> imus;
    /// When the board set up an IMU, by its name: it sampled at other instants then.
    std::map<std::string, std::vector<BoardTime>> set_up;
    MessageStamps message_stamps;
    std::string output_clock;  ///< as the service named it; empty: not known
};

/// One item of the stream <camera>-evidence (docs/contracts/shm-layout.md).
void add_camera_evidence(const ring::Metadata& metadata, CameraEvidence& camera);

/// Errors: the recording cannot be read or is damaged; stopped.
Expected<RecordedEvidence> read_evidence(const Recording& recording,
                                         const std::function<bool()>& go_on);

}  // namespace versavis::client
