// SPDX-License-Identifier: BSD-3-Clause
// Makes recordings for tests, byte by byte, as docs/contracts/recording-format.md has them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "recording/mcap_summary.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::test {

/// What a ring would give.
struct FileItem {
    std::string stream;
    ring::StreamKind kind = ring::StreamKind::events;
    std::uint64_t number = 0;
    std::uint64_t life = 1;
    OutputTime time;
    ring::Metadata metadata{};
    std::vector<std::byte> payload;
    std::uint64_t attributes = ring::no_attributes;  ///< of a frame; these: as before version 1.2
};

class RecordingFile {
 public:
    explicit RecordingFile(const std::string& part = "0", const std::string& recording = "1");

    void add(const FileItem& item, bool as_png = false);
    void add_gap(const std::string& stream, const std::string& reason, std::uint64_t items,
                 OutputTime time);
    /// `anew`: the next chunk announces its channels again, as the recorder does.
    void end_chunk(bool anew = false);
    void add_attachment(const std::string& name, const std::string& content);

    /// What is there so far, with the last chunk as far as it is ended.
    const std::string& cut() const { return bytes_; }

    /// The whole file.
    std::string finish();

    /// A record of the format.
    static std::string record(std::uint8_t opcode, const std::string& content);

 private:
    std::uint16_t channel(const std::string& topic, const std::string& encoding,
                          const std::string& schema, const std::string& schema_encoding,
                          const std::map<std::string, std::string>& metadata);
    void message(std::uint16_t channel, std::uint32_t sequence, std::int64_t time,
                 const std::string& data);

    std::string bytes_;
    std::string chunk_;
    client::McapSummary summary_;
    std::map<std::string, std::uint16_t> channels_;
    std::set<std::uint16_t> announced_;
    std::map<std::uint16_t, std::vector<client::MessagePlace>> places_;
    std::uint32_t sequence_ = 0;
};

/// Two cameras at 20 Hz, `cam0` and `cam1` (whose stamps are 40 ns later), an IMU at 200 Hz, events
/// and status: `seconds` long, some frames of `cam1` are missing, one of `cam0` is suspect, the
/// last images lie behind the IMU's end, and one sample in ten repeats. Only frames of `cam1` have
/// gain and temperature.
std::string sample_recording(int seconds, bool as_png, bool cut_off, std::uint32_t pixel_format,
                             std::uint32_t width = 61, std::uint32_t height = 9);

/// The pixels of its frames: rows of `stride` bytes.
std::vector<std::byte> sample_pixels(const FrameMetadata& frame, std::uint64_t number);

}  // namespace versavis::test
