// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "versavis.h"
#include "versavis/imu_window.hpp"
#include "versavis/set_reader.hpp"
#include "versavis/stream.hpp"
#include "versavis/wait_set.hpp"

using namespace versavis;

struct versavis_stream {
    ring::Reader reader;
};

struct versavis_wait_set {
    WaitSet set;
};

struct versavis_imu_window {
    ImuWindow window;
    std::vector<versavis_imu_sample> samples;  ///< of the newest span
};

struct versavis_sets {
    SetReader reader;
    std::vector<versavis_imu_sample> imu;  ///< of the newest set
};

namespace {

static_assert(sizeof(versavis_frame) == ring::metadata_size);
static_assert(sizeof(versavis_imu) == ring::metadata_size);
static_assert(sizeof(versavis_event) == ring::metadata_size);
static_assert(offsetof(versavis_frame, tick_high) == offsetof(FrameMetadata, tick_high));
static_assert(offsetof(versavis_frame, sigma) == offsetof(FrameMetadata, sigma_ns));
static_assert(offsetof(versavis_imu, accel_age) == offsetof(ImuMetadata, accel_age_ns));
static_assert(offsetof(versavis_event, count) == offsetof(EventMetadata, count));
static_assert(sizeof(ring::Payload) <= sizeof(versavis_item::held) &&
              alignof(ring::Payload) <= alignof(std::uint64_t));
static_assert(static_cast<int>(Pause::gone) == VERSAVIS_GONE);
static_assert(static_cast<int>(SpanGap::numbers) == VERSAVIS_SPAN_NUMBERS);
static_assert(VERSAVIS_MOST_CAMERAS <= 32);

/// An item that was begun with zeros holds nothing.
ring::Payload* held(const versavis_item& item) {
    if (item.held[5] == 0) return nullptr;
    return std::launder(reinterpret_cast<ring::Payload*>(const_cast<std::uint64_t*>(item.held)));
}
static_assert(sizeof(ring::Payload) <= 5 * sizeof(std::uint64_t), "the last word marks it as held");

void describe(versavis_error* error, const std::string& text) {
    if (error == nullptr) return;
    const std::size_t size = std::min(text.size(), sizeof error->message - 1);
    std::memcpy(error->message, text.data(), size);
    error->message[size] = '\0';
}

int fail(versavis_error* error, const std::string& text) {
    describe(error, text);
    return VERSAVIS_ERROR;
}

int invalid(versavis_error* error, const char* text) {
    describe(error, text);
    return VERSAVIS_INVALID;
}

void fill(versavis_item& to, ring::Item item, ring::StreamKind kind) {
    versavis_release(&to);
    to.number = item.number;
    to.life = item.life;
    to.lost = 0;
    to.time = item.time.ns;
    to.stale = item.stale ? 1 : 0;
    to.kind = static_cast<std::uint32_t>(kind);
    std::memcpy(to.data.words, item.metadata.data(), sizeof to.data.words);
    to.payload = item.payload.data();
    to.payload_size = item.payload.size();
    new (to.held) ring::Payload(std::move(item.payload));
    to.held[5] = 1;
}

int give(ring::Received received, const versavis_stream& stream, versavis_item& item) {
    if (!received) {
        versavis_release(&item);
        item.number = 0;
        item.time = 0;
        item.kind = 0;
        item.lost = received.error().lost;
        return static_cast<int>(received.error().why);
    }
    fill(item, std::move(*received), stream.reader.kind());
    return VERSAVIS_OK;
}

std::optional<Position> position(std::uint32_t from, Position otherwise) {
    switch (from) {
        case VERSAVIS_DEFAULT: return otherwise;
        case VERSAVIS_NEXT: return Position::next;
        case VERSAVIS_LATEST: return Position::latest;
        case VERSAVIS_MIDDLE: return Position::middle;
        case VERSAVIS_OLDEST: return Position::oldest;
        default: return std::nullopt;
    }
}

/// None: a position that there is not.
std::optional<StreamOptions> translate(const char* instance, const versavis_options* from) {
    StreamOptions options;
    if (instance != nullptr) options.instance = instance;
    if (from == nullptr) return options;
    const auto start = position(from->start, Position::next);
    const auto after_loss = position(from->after_loss, Position::middle);
    if (!start || !after_loss) return std::nullopt;
    options.start = *start;
    options.after_loss = *after_loss;
    if (from->owner >= 0) options.owner = static_cast<std::uint32_t>(from->owner);
    options.sealed_only = from->sealed_only != 0;
    return options;
}

int give(Expected<int> descriptor, versavis_error* error) {
    return descriptor ? *descriptor : fail(error, descriptor.error().message());
}

/// No exception leaves this library.
template <class Work>
int guarded(versavis_error* error, Work work) {
    try {
        return work();
    } catch (const std::bad_alloc& exception) {
        describe(error, exception.what());
        return VERSAVIS_NO_MEMORY;
    } catch (const std::exception& exception) {
        return fail(error, exception.what());
    }
}

versavis_imu_sample sample_of(const ImuSample& from) {
    versavis_imu_sample sample{};
    sample.time = from.time.ns;
    std::memcpy(&sample.data, from.metadata.data(), sizeof sample.data);
    return sample;
}

void fill(versavis_imu_span& to, versavis_imu_window& window, const ImuSpan& span) {
    window.samples.clear();
    for (const ImuSample& sample : span.samples) window.samples.push_back(sample_of(sample));
    to.samples = window.samples.data();
    to.count = window.samples.size();
    to.lost = span.lost;
    to.gap = static_cast<std::uint32_t>(span.gap);
    to.has_beyond = span.beyond ? 1 : 0;
    to.beyond = span.beyond ? sample_of(*span.beyond) : versavis_imu_sample{};
}

/// Into one that was released.
void fill(versavis_set& to, versavis_sets& sets, FrameSet made) {
    to.life = made.life;
    to.tick = made.tick;
    to.epoch = made.epoch;
    to.time = made.time.ns;
    to.spread = made.spread.ns;
    for (std::size_t i = 0; i < made.frames.size(); ++i) {
        if (!made.frames[i]) continue;
        fill(to.frames[i], std::move(*made.frames[i]), ring::StreamKind::frames);
        to.present |= 1U << i;
    }
    sets.imu.clear();
    for (const ImuSample& sample : made.imu.samples) sets.imu.push_back(sample_of(sample));
    to.imu = sets.imu.data();
    to.imu_count = sets.imu.size();
    to.imu_lost = made.imu.lost;
    to.imu_covered = made.imu.covered() ? 1 : 0;
    to.imu_gap = static_cast<std::uint32_t>(made.imu.gap);
}

Expected<SetReader> open_sets(const std::vector<std::string>& names, const StreamOptions& streams,
                              const versavis_sets_options* from) {
    SetOptions options;
    static_cast<StreamOptions&>(options) = streams;
    if (from != nullptr) {
        if (from->imu != nullptr) options.imu = from->imu;
        if (from->patience > 0) options.patience = nanoseconds(from->patience);
        options.partial = from->partial != 0;
        options.suspect = from->suspect != 0;
    }
    return SetReader::open(names, options);
}

}  // namespace

const char* versavis_version(void) { return VERSAVIS_VERSION; }

const char* versavis_result_text(int result) {
    switch (result) {
        case VERSAVIS_OK: return "done";
        case VERSAVIS_NOTHING: return "nothing new in the time given";
        case VERSAVIS_LOST: return "items were overwritten before they were read";
        case VERSAVIS_RESTARTED: return "the service was restarted";
        case VERSAVIS_GONE: return "the service is gone; waiting for it";
        case VERSAVIS_OVERTAKEN: return "the writer reused the memory: discard what was read";
        case VERSAVIS_ERROR: return "failed; versavis_error says why";
        case VERSAVIS_NO_MEMORY: return "no memory";
        case VERSAVIS_INVALID: return "an argument is missing, out of range, or of another kind";
        default: return "unknown result";
    }
}

int versavis_open(const char* instance, const char* stream, const versavis_options* options,
                  versavis_stream** opened, versavis_error* error) {
    if (stream == nullptr || opened == nullptr)
        return invalid(error, "versavis_open: name or stream is NULL");
    *opened = nullptr;
    return guarded(error, [&]() -> int {
        const auto how = translate(instance, options);
        if (!how) return invalid(error, "versavis_open: start or after_loss is not a position");
        if (!is_stream_name(stream))
            return fail(error, std::string(stream) + ": is not a name of a stream");
        auto reader = ring::Reader::open(stream_path(how->instance, stream), *how);
        if (!reader) return fail(error, reader.error().message());
        *opened = new versavis_stream{std::move(*reader)};
        return VERSAVIS_OK;
    });
}

void versavis_close(versavis_stream* stream) { delete stream; }

int versavis_stream_kind(const versavis_stream* stream) {
    return stream == nullptr ? VERSAVIS_INVALID : static_cast<int>(stream->reader.kind());
}

const char* versavis_stream_name(const versavis_stream* stream) {
    return stream == nullptr ? "" : stream->reader.name();
}

int versavis_next(versavis_stream* stream, versavis_item* item, int64_t timeout) {
    if (stream == nullptr || item == nullptr) return VERSAVIS_INVALID;
    return guarded(nullptr,
                   [&] { return give(stream->reader.next(nanoseconds(timeout)), *stream, *item); });
}

int versavis_latest(versavis_stream* stream, versavis_item* item, int64_t timeout) {
    if (stream == nullptr || item == nullptr) return VERSAVIS_INVALID;
    return guarded(
        nullptr, [&] { return give(stream->reader.latest(nanoseconds(timeout)), *stream, *item); });
}

int versavis_seek(versavis_stream* stream, std::uint32_t to) {
    const auto place = position(to, Position::next);
    if (stream == nullptr || !place) return VERSAVIS_INVALID;
    stream->reader.seek(*place);
    return VERSAVIS_OK;
}

int versavis_seek_time(versavis_stream* stream, int64_t time) {
    if (stream == nullptr) return VERSAVIS_INVALID;
    stream->reader.seek(OutputTime{time});
    return VERSAVIS_OK;
}

int versavis_fd(versavis_stream* stream, versavis_error* error) {
    if (stream == nullptr) return invalid(error, "versavis_fd: the stream is NULL");
    return guarded(error, [&] { return give(stream->reader.fd(), error); });
}

int versavis_valid(const versavis_item* item) {
    if (item == nullptr) return 0;
    const ring::Payload* payload = held(*item);
    return payload != nullptr && payload->valid() ? 1 : 0;
}

int versavis_copy(const versavis_item* item, void* to, size_t size) {
    const ring::Payload* payload = item == nullptr ? nullptr : held(*item);
    if (payload == nullptr || size < payload->size() || (to == nullptr && payload->size() > 0))
        return VERSAVIS_INVALID;
    return payload->copy_to(static_cast<std::byte*>(to)) ? VERSAVIS_OK : VERSAVIS_OVERTAKEN;
}

void versavis_release(versavis_item* item) {
    if (item == nullptr) return;
    if (ring::Payload* payload = held(*item)) payload->~Payload();
    item->held[5] = 0;
    item->payload = nullptr;
    item->payload_size = 0;
}

int versavis_view(const versavis_item* item, versavis_image* image) {
    if (item == nullptr || image == nullptr || item->kind != VERSAVIS_FRAMES || !held(*item))
        return VERSAVIS_INVALID;
    FrameMetadata metadata{};
    std::memcpy(static_cast<void*>(&metadata), item->data.words, sizeof metadata);
    const auto view = image_of(metadata, *held(*item));
    if (!view) return VERSAVIS_INVALID;
    *image = {reinterpret_cast<const uint8_t*>(view->data),
              view->width,
              view->height,
              view->stride,
              view->pixel_format,
              view->layout.channels,
              view->layout.bytes_per_channel};
    return VERSAVIS_OK;
}

int versavis_sensor(const versavis_item* item, versavis_sensor_state* state) {
    if (item == nullptr || state == nullptr || item->kind != VERSAVIS_FRAMES || !held(*item))
        return VERSAVIS_INVALID;
    const SensorState found = unpack_sensor_state(held(*item)->attributes());
    *state = {found.gain, found.temperature_c};
    return held(*item)->valid() ? VERSAVIS_OK : VERSAVIS_OVERTAKEN;
}

const char* versavis_pixel_format_name(uint32_t pixel_format) {
    return pixel_format_name(pixel_format);
}

const char* versavis_event_name(uint32_t kind) { return to_string(static_cast<EventKind>(kind)); }

const char* versavis_reason_name(uint32_t reason) {
    return to_string(static_cast<EventReason>(reason));
}

versavis_wait_set* versavis_wait_set_new(void) {
    versavis_wait_set* made = nullptr;
    guarded(nullptr, [&] {
        made = new versavis_wait_set{};
        return VERSAVIS_OK;
    });
    return made;
}

void versavis_wait_set_free(versavis_wait_set* set) { delete set; }

int versavis_wait_set_add(versavis_wait_set* set, versavis_stream* stream, versavis_error* error) {
    if (set == nullptr || stream == nullptr)
        return invalid(error, "versavis_wait_set_add: the set or the stream is NULL");
    return guarded(error, [&]() -> int {
        const auto added = set->set.add(stream->reader);
        return added ? VERSAVIS_OK : fail(error, added.error().message());
    });
}

int versavis_wait_set_wait(versavis_wait_set* set, int64_t timeout) {
    if (set == nullptr) return VERSAVIS_INVALID;
    return guarded(nullptr, [&] {
        const auto found = set->set.wait(nanoseconds(timeout));
        return found ? static_cast<int>(*found) : -1;
    });
}

int versavis_wait_set_fd(versavis_wait_set* set, versavis_error* error) {
    if (set == nullptr) return invalid(error, "versavis_wait_set_fd: the set is NULL");
    return guarded(error, [&] { return give(set->set.fd(), error); });
}

int versavis_imu_window_open(const char* instance, const char* stream,
                             const versavis_options* options, versavis_imu_window** opened,
                             versavis_error* error) {
    if (stream == nullptr || opened == nullptr)
        return invalid(error, "versavis_imu_window_open: name or window is NULL");
    *opened = nullptr;
    return guarded(error, [&]() -> int {
        const auto how = translate(instance, options);
        if (!how) return invalid(error, "versavis_imu_window_open: after_loss is not a position");
        auto window = ImuWindow::open(stream, *how);
        if (!window) return fail(error, window.error().message());
        *opened = new versavis_imu_window{std::move(*window), {}};
        return VERSAVIS_OK;
    });
}

void versavis_imu_window_close(versavis_imu_window* window) { delete window; }

int versavis_imu_window_span(versavis_imu_window* window, uint32_t epoch, int64_t after,
                             int64_t upto, int64_t patience, versavis_imu_span* span) {
    if (window == nullptr || span == nullptr || upto < after) return VERSAVIS_INVALID;
    return guarded(nullptr, [&]() -> int {
        const auto found = window->window.between(OutputTime{after}, OutputTime{upto}, epoch,
                                                  nanoseconds(patience));
        if (!found) return static_cast<int>(found.error().why);
        fill(*span, *window, *found);
        return VERSAVIS_OK;
    });
}

int versavis_sets_open(const char* instance, const char* const* cameras, size_t count,
                       const versavis_sets_options* options, versavis_sets** opened,
                       versavis_error* error) {
    if (cameras == nullptr || opened == nullptr || count == 0 || count > VERSAVIS_MOST_CAMERAS ||
        std::find(cameras, cameras + count, nullptr) != cameras + count)
        return invalid(error, "versavis_sets_open: needs the names of 1 to 16 cameras");
    *opened = nullptr;
    return guarded(error, [&]() -> int {
        const auto streams = translate(instance, options == nullptr ? nullptr : &options->streams);
        if (!streams)
            return invalid(error, "versavis_sets_open: start or after_loss is not a position");
        auto sets = open_sets({cameras, cameras + count}, *streams, options);
        if (!sets) return fail(error, sets.error().message());
        *opened = new versavis_sets{std::move(*sets), {}};
        return VERSAVIS_OK;
    });
}

void versavis_sets_close(versavis_sets* sets) { delete sets; }

int versavis_sets_next(versavis_sets* sets, versavis_set* set, int64_t timeout) {
    if (sets == nullptr || set == nullptr) return VERSAVIS_INVALID;
    versavis_set_release(set);
    return guarded(nullptr, [&]() -> int {
        auto made = sets->reader.next(nanoseconds(timeout));
        if (!made) return static_cast<int>(made.error().why);
        fill(*set, *sets, std::move(*made));
        return VERSAVIS_OK;
    });
}

int versavis_sets_report(const versavis_sets* sets, versavis_set_report* report) {
    if (sets == nullptr || report == nullptr) return VERSAVIS_INVALID;
    const SetReport& known = sets->reader.report();
    *report = {known.sets, known.incomplete, known.left_out, known.lost};
    return VERSAVIS_OK;
}

int versavis_sets_fd(versavis_sets* sets, versavis_error* error) {
    if (sets == nullptr) return invalid(error, "versavis_sets_fd: sets is NULL");
    return guarded(error, [&] { return give(sets->reader.fd(), error); });
}

void versavis_set_release(versavis_set* set) {
    if (set == nullptr) return;
    for (versavis_item& frame : set->frames) versavis_release(&frame);
    set->present = 0;
    set->imu = nullptr;
    set->imu_count = 0;
}
