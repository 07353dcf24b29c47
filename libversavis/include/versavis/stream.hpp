// SPDX-License-Identifier: BSD-3-Clause
// Reading a stream by its name: frames, IMU samples, events or the status document.
#pragma once

#include <string>
#include <utility>

#include "versavis/metadata.hpp"
#include "versavis/ring/path.hpp"
#include "versavis/ring/reader.hpp"

namespace versavis {

using ring::Found;

/// What a stream gave: an item when `found` is Found::item, else why there is none.
template <class Data>
struct Received : ring::Item {
    Data data{};
};

/// A typed reader of one stream. Not thread-safe; open one per thread.
template <class Data, ring::StreamKind kind>
class Stream {
 public:
    /// Errors: no such stream, no permission, a stream of another kind.
    static Expected<Stream> open(const std::string& name,
                                 const std::string& instance = default_instance(),
                                 ring::Reader::From from = ring::Reader::From::newest) {
        auto reader = ring::Reader::open(stream_path(instance, name), from);
        if (!reader) return Unexpected(reader.error());
        if (reader->kind() != kind)
            return failure(name, "is a stream of another kind", "see 'versavis list'");
        return Stream(std::move(*reader));
    }

    /// The next item, without waiting.
    Received<Data> next() { return typed(reader_.next()); }

    /// The next item, waiting for it up to `timeout`.
    Received<Data> wait(Duration timeout) { return typed(reader_.wait(timeout)); }

    /// True while the payload of `item` is untouched: what was read of it in place before this call
    /// is good.
    bool intact(const ring::Item& item) const { return reader_.intact(item); }

    /// Copies the payload to `destination` of item.payload_size bytes; false when the writer
    /// overtook the copy.
    bool copy(const ring::Item& item, std::byte* destination) const {
        return reader_.copy(item, destination);
    }

    const ring::Reader& reader() const { return reader_; }

 private:
    explicit Stream(ring::Reader reader) : reader_(std::move(reader)) {}

    static Received<Data> typed(const ring::Item& item) {
        Received<Data> received;
        static_cast<ring::Item&>(received) = item;
        received.data = unpack<Data>(item.metadata);
        return received;
    }

    ring::Reader reader_;
};

using FrameStream = Stream<FrameMetadata, ring::StreamKind::frames>;
using ImuStream = Stream<ImuMetadata, ring::StreamKind::imu>;
using EventStream = Stream<EventMetadata, ring::StreamKind::events>;
using StatusStream =
    Stream<ring::Metadata, ring::StreamKind::status>;  ///< the payload is the document

}  // namespace versavis
