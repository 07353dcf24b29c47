// SPDX-License-Identifier: BSD-3-Clause
// Reading a stream by its name: frames, IMU samples, events, sentences or the status document.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ring_path.hpp"
#include "ring_reader.hpp"
#include "versavis/metadata.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis {

using ring::NoItem;
using ring::Options;
using ring::Pause;
using ring::Position;

/// An item with its metadata by name.
template <class Data>
struct Typed : ring::Item {
    explicit Typed(ring::Item item)
        : ring::Item(std::move(item)), data(unpack<Data>(this->metadata)) {}

    Data data;
};

/// None: the payload holds fewer bytes than the metadata claim.
VERSAVIS_API std::optional<ImageView> image_of(const FrameMetadata& frame,
                                               const ring::Payload& payload);

struct Frame : Typed<FrameMetadata> {
    using Typed::Typed;

    /// The pixels in place: what was read of them is good if valid() is true afterwards. None: the
    /// payload holds fewer bytes than the metadata claim.
    std::optional<ImageView> image() const { return image_of(data, payload); }

    /// As the pixels, good if valid() is true afterwards.
    SensorState sensor() const { return unpack_sensor_state(payload.attributes()); }
};

using ImuSample = Typed<ImuMetadata>;
using Event = Typed<EventMetadata>;
using NmeaSentence = Typed<NmeaMetadata>;      ///< the payload is the line, without its end
using StatusDocument = Typed<ring::Metadata>;  ///< the payload is the document

/// Where a stream is found, and how it is read.
struct StreamOptions : Options {
    std::string instance = default_instance();
};

/// A typed reader of one stream. Not thread-safe; open one per thread.
template <class T, ring::StreamKind kind>
class Stream {
 public:
    using Result = Expected<T, NoItem>;

    /// Errors: invalid: no name of a stream; wrong_kind; and those of Reader::open.
    static Expected<Stream> open(const std::string& name, const StreamOptions& options = {}) {
        if (!is_stream_name(name))
            return failure(ErrorCode::invalid, name, "is not a name of a stream",
                           "see 'versavis list'");
        auto reader = ring::Reader::open(stream_path(options.instance, name), options);
        if (!reader) return Unexpected(reader.error());
        if (reader->kind() != kind)
            return failure(ErrorCode::wrong_kind, name, "is a stream of another kind",
                           "see 'versavis list'");
        return Stream(std::move(*reader));
    }

    /// See ring::Reader.
    Result next() { return typed(reader_.next()); }
    Result next(Duration timeout) { return typed(reader_.next(timeout)); }
    Result latest(Duration timeout = {}) { return typed(reader_.latest(timeout)); }

    const ring::Reader& reader() const { return reader_; }
    ring::Reader& reader() { return reader_; }

 private:
    explicit Stream(ring::Reader reader) : reader_(std::move(reader)) {}

    static Result typed(ring::Received received) {
        if (!received) return Unexpected<NoItem>(received.error());
        return T(std::move(*received));
    }

    ring::Reader reader_;
};

/// One stream of an instance, as `versavis list` shows it.
struct StreamInfo {
    std::string name;
    ring::StreamKind kind{};
    std::uint64_t published = 0;  ///< items since it was made
    std::uint64_t retained = 0;   ///< how many can be read at any one time, at most
    bool alive = false;           ///< its writer is
    std::optional<Error> error;   ///< it cannot be opened; of the rest, only its name is known
};

/// The streams of an instance, by name. `options` as for opening them; it waits for nothing.
/// Errors: absent: no such instance; forbidden.
VERSAVIS_API Expected<std::vector<StreamInfo>> list_streams(const StreamOptions& options = {});

using FrameStream = Stream<Frame, ring::StreamKind::frames>;
using ImuStream = Stream<ImuSample, ring::StreamKind::imu>;
using EventStream = Stream<Event, ring::StreamKind::events>;
using NmeaStream = Stream<NmeaSentence, ring::StreamKind::nmea>;
using StatusStream = Stream<StatusDocument, ring::StreamKind::status>;

}  // namespace versavis
