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
    std::vector<versavis_imu_sample> samples;  ///< of the newest span, and the one beyond it
};

struct versavis_sets {
    SetReader reader;
};

namespace {

/// What a versavis_set holds.
struct HeldSet {
    std::vector<std::optional<Frame>> frames;
    std::vector<versavis_imu_sample> imu;
};

static_assert(sizeof(versavis_frame) == ring::metadata_size);
static_assert(sizeof(versavis_imu) == ring::metadata_size);
static_assert(sizeof(versavis_event) == ring::metadata_size);
static_assert(sizeof(versavis_nmea) == ring::metadata_size);
static_assert(offsetof(versavis_frame, tick_high) == offsetof(FrameMetadata, tick_high));
static_assert(offsetof(versavis_frame, sigma) == offsetof(FrameMetadata, sigma_ns));
static_assert(offsetof(versavis_imu, accel_age) == offsetof(ImuMetadata, accel_age_ns));
static_assert(offsetof(versavis_event, count) == offsetof(EventMetadata, count));
static_assert(offsetof(versavis_nmea, reserved) == offsetof(NmeaMetadata, reserved));
static_assert(sizeof(ring::Payload) <= sizeof(versavis_item::held) &&
              alignof(ring::Payload) <= alignof(std::uint64_t));
static_assert(static_cast<int>(Pause::gone) == VERSAVIS_GONE);
static_assert(static_cast<int>(SpanGap::numbers) == VERSAVIS_SPAN_NUMBERS);
static_assert(VERSAVIS_MOST_CAMERAS <= 32);
static_assert(static_cast<int>(ErrorCode::exhausted) == VERSAVIS_EXHAUSTED);
static_assert(no_epoch == VERSAVIS_NO_EPOCH);

/// An item that was begun with zeros holds nothing.
ring::Payload* held(const versavis_item& item) {
    if (item.held[5] == 0) return nullptr;
    return std::launder(reinterpret_cast<ring::Payload*>(const_cast<std::uint64_t*>(item.held)));
}
static_assert(sizeof(ring::Payload) <= 5 * sizeof(std::uint64_t), "the last word marks it as held");

constexpr auto bad_options =
    "the options were not begun with their VERSAVIS_..._INIT, ask for what this library does not "
    "know, or their start or after_loss is not a position";

void describe(versavis_error* error, const std::string& text) {
    if (error == nullptr) return;
    const std::size_t size = std::min(text.size(), sizeof error->message - 1);
    std::memcpy(error->message, text.data(), size);
    error->message[size] = '\0';
}

int fail(versavis_error* error, const Error& why) {
    describe(error, why.message());
    return static_cast<int>(why.code);
}

/// Structures as they were when their size was first a part of them: a program that says less did
/// not begin with their VERSAVIS_..._INIT.
template <class T>
constexpr std::uint32_t first_size = sizeof(T);

/// No structure of any header becomes larger: a size beyond it is what lay on the stack.
constexpr std::uint32_t most_size = 4096;

/// True when the caller's structure has at least what it had at first.
template <class T>
bool has_size(const T* caller) {
    return caller != nullptr && caller->size >= first_size<T> && caller->size <= most_size;
}

/// What the caller asks for, as far as its header goes. None: it has no size, or asks for something
/// that this library does not know.
template <class T>
std::optional<T> asked(const T* caller, const T& defaults) {
    if (caller == nullptr) return defaults;
    if (!has_size(caller)) return std::nullopt;
    const auto* bytes = reinterpret_cast<const std::byte*>(caller);
    const std::size_t known = std::min<std::size_t>(caller->size, sizeof(T));
    if (std::any_of(bytes + known, bytes + caller->size,
                    [](std::byte b) { return b != std::byte{}; }))
        return std::nullopt;
    T options = defaults;
    std::memcpy(static_cast<void*>(&options), bytes, known);
    return options;
}

/// Fills in what the caller's header knows; what only it knows becomes zeros.
template <class T>
int give(const T& known, T* caller) {
    if (!has_size(caller)) return VERSAVIS_INVALID;
    const std::uint32_t size = caller->size;
    auto* bytes = reinterpret_cast<std::byte*>(caller);
    std::memset(bytes, 0, size);
    std::memcpy(bytes, &known, std::min<std::size_t>(size, sizeof(T)));
    caller->size = size;
    return VERSAVIS_OK;
}

versavis_time time_of(const EpochTime& from) { return {from.life, from.ns, from.epoch, 0}; }
EpochTime time_of(const versavis_time& from) { return {from.life, from.ns, from.epoch}; }

int invalid(versavis_error* error, const char* text) {
    describe(error, text);
    return VERSAVIS_INVALID;
}

void fill(versavis_item& to, ring::Item item, ring::StreamKind kind) {
    versavis_release(&to);
    to.number = item.number;
    to.lost = 0;
    to.time = time_of(item.time);
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
        item.time = {};
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

/// None: no options, or a position that there is not.
std::optional<StreamOptions> translate(const char* instance, const versavis_options* caller) {
    StreamOptions options;
    if (instance != nullptr) options.instance = instance;
    const auto from = asked<versavis_options>(caller, VERSAVIS_OPTIONS_INIT);
    if (!from) return std::nullopt;
    const auto start = position(from->start, Position::next);
    const auto after_loss = position(from->after_loss, Position::middle);
    if (!start || !after_loss) return std::nullopt;
    options.start = *start;
    options.after_loss = *after_loss;
    if (from->owner >= 0) options.owner = static_cast<std::uint32_t>(from->owner);
    options.sealed_only = from->sealed_only != 0;
    options.wait = nanoseconds(from->wait);
    return options;
}

int give(Expected<int> descriptor, versavis_error* error) {
    return descriptor ? *descriptor : fail(error, descriptor.error());
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
        describe(error, exception.what());
        return VERSAVIS_ERROR;
    }
}

versavis_imu_sample sample_of(const ImuSample& from) {
    versavis_imu_sample sample{};
    sample.time = time_of(from.time);
    std::memcpy(&sample.data, from.metadata.data(), sizeof sample.data);
    return sample;
}

std::vector<versavis_imu_sample> samples_of(const ImuSpan& span) {
    std::vector<versavis_imu_sample> samples;
    for (const ImuSample& sample : span.samples) samples.push_back(sample_of(sample));
    return samples;
}

versavis_imu_span fill(versavis_imu_window& window, const ImuSpan& span) {
    window.samples = samples_of(span);
    versavis_imu_span to = VERSAVIS_IMU_SPAN_INIT;
    to.count = window.samples.size();
    if (span.beyond) window.samples.push_back(sample_of(*span.beyond));
    to.samples = window.samples.data();
    to.beyond = span.beyond ? &window.samples.back() : nullptr;
    to.lost = span.lost;
    to.gap = static_cast<std::uint32_t>(span.gap);
    return to;
}

/// Into one that was released.
int fill(versavis_set& to, FrameSet made) {
    versavis_set set = VERSAVIS_SET_INIT;
    set.tick = made.tick;
    set.time = time_of(made.time);
    set.spread = made.spread.ns;
    for (std::size_t i = 0; i < made.frames.size(); ++i)
        if (made.frames[i]) set.present |= 1U << i;
    auto held = std::make_unique<HeldSet>();
    held->frames = std::move(made.frames);
    held->imu = samples_of(made.imu);
    set.imu = held->imu.data();
    set.imu_count = held->imu.size();
    set.imu_lost = made.imu.lost;
    set.imu_gap = static_cast<std::uint32_t>(made.imu.gap);
    set.held = held.release();
    return give(set, &to);
}

const HeldSet* held(const versavis_set* set) {
    return has_size(set) ? static_cast<const HeldSet*>(set->held) : nullptr;
}

template <class Take>
int next_set(versavis_sets* sets, versavis_set* set, Take take) {
    if (sets == nullptr || !has_size(set)) return VERSAVIS_INVALID;
    versavis_set_release(set);
    return guarded(nullptr, [&]() -> int {
        auto made = take(sets->reader);
        return made ? fill(*set, std::move(*made)) : static_cast<int>(made.error().why);
    });
}

Expected<SetReader> open_sets(const std::vector<std::string>& names, const StreamOptions& streams,
                              const versavis_sets_options& from) {
    SetOptions options;
    static_cast<StreamOptions&>(options) = streams;
    if (from.imu != nullptr) options.imu = from.imu;
    if (from.patience > 0) options.patience = nanoseconds(from.patience);
    options.partial = from.partial != 0;
    options.suspect = from.suspect != 0;
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
        case VERSAVIS_INVALID:
            return "an argument is missing, out of range, of another kind, or was not begun with "
                   "its "
                   "VERSAVIS_..._INIT";
        case VERSAVIS_ABSENT: return "there is no such stream";
        case VERSAVIS_FORBIDDEN: return "permission denied";
        case VERSAVIS_NOT_TRUSTED: return "the stream is not of a user whom this program trusts";
        case VERSAVIS_WRONG_KIND: return "a stream of another kind";
        case VERSAVIS_UNSUPPORTED: return "the service is of another release: install the same";
        case VERSAVIS_DAMAGED: return "not a ring, or a damaged one";
        case VERSAVIS_EXHAUSTED: return "no descriptor or thread available";
        case VERSAVIS_OTHER_EPOCH: return "times of two epochs do not compare";
        default: return "unknown result";
    }
}

int versavis_time_difference(const versavis_time* later, const versavis_time* earlier,
                             int64_t* ns) {
    if (later == nullptr || earlier == nullptr || ns == nullptr) return VERSAVIS_INVALID;
    const auto span = time_of(*later).since(time_of(*earlier));
    if (!span) return VERSAVIS_OTHER_EPOCH;
    *ns = span->ns;
    return VERSAVIS_OK;
}

int versavis_list(const char* instance, const versavis_options* options,
                  int (*visit)(const versavis_stream_info*, void*), void* context,
                  versavis_error* error) {
    if (visit == nullptr) return invalid(error, "versavis_list: visit is NULL");
    return guarded(error, [&]() -> int {
        const auto how = translate(instance, options);
        if (!how) return invalid(error, bad_options);
        const auto streams = list_streams(*how);
        if (!streams) return fail(error, streams.error());
        for (const StreamInfo& stream : *streams) {
            const std::string why = stream.error ? stream.error->message() : "";
            const versavis_stream_info info{
                sizeof(versavis_stream_info),
                static_cast<std::uint32_t>(stream.kind),
                stream.name.c_str(),
                stream.published,
                stream.retained,
                stream.alive ? 1 : 0,
                stream.error ? static_cast<int>(stream.error->code) : VERSAVIS_OK,
                why.c_str()};
            if (const int result = visit(&info, context); result != 0) return result;
        }
        return VERSAVIS_OK;
    });
}

int versavis_open(const char* instance, const char* stream, const versavis_options* options,
                  versavis_stream** opened, versavis_error* error) {
    if (stream == nullptr || opened == nullptr)
        return invalid(error, "versavis_open: name or stream is NULL");
    *opened = nullptr;
    return guarded(error, [&]() -> int {
        const auto how = translate(instance, options);
        if (!how) return invalid(error, bad_options);
        if (!is_stream_name(stream))
            return invalid(error, (std::string(stream) + ": is not a name of a stream").c_str());
        auto reader = ring::Reader::open(stream_path(how->instance, stream), *how);
        if (!reader) return fail(error, reader.error());
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
    if (stream == nullptr || !has_size(item)) return VERSAVIS_INVALID;
    return guarded(nullptr,
                   [&] { return give(stream->reader.next(nanoseconds(timeout)), *stream, *item); });
}

int versavis_latest(versavis_stream* stream, versavis_item* item, int64_t timeout) {
    if (stream == nullptr || !has_size(item)) return VERSAVIS_INVALID;
    return guarded(
        nullptr, [&] { return give(stream->reader.latest(nanoseconds(timeout)), *stream, *item); });
}

int versavis_seek(versavis_stream* stream, std::uint32_t to) {
    const auto place = position(to, Position::next);
    if (stream == nullptr || !place) return VERSAVIS_INVALID;
    stream->reader.seek(*place);
    return VERSAVIS_OK;
}

int versavis_seek_time(versavis_stream* stream, const versavis_time* time) {
    if (stream == nullptr || time == nullptr) return VERSAVIS_INVALID;
    return stream->reader.seek(time_of(*time)) ? VERSAVIS_OK : VERSAVIS_OTHER_EPOCH;
}

int versavis_fd(versavis_stream* stream, versavis_error* error) {
    if (stream == nullptr) return invalid(error, "versavis_fd: the stream is NULL");
    return guarded(error, [&] { return give(stream->reader.fd(), error); });
}

int versavis_valid(const versavis_item* item) {
    const ring::Payload* payload = has_size(item) ? held(*item) : nullptr;
    return payload != nullptr && payload->valid() ? 1 : 0;
}

int versavis_copy(const versavis_item* item, void* to, size_t size) {
    const ring::Payload* payload = has_size(item) ? held(*item) : nullptr;
    if (payload == nullptr || size < payload->size() || (to == nullptr && payload->size() > 0))
        return VERSAVIS_INVALID;
    return payload->copy_to(static_cast<std::byte*>(to)) ? VERSAVIS_OK : VERSAVIS_OVERTAKEN;
}

void versavis_release(versavis_item* item) {
    if (!has_size(item)) return;
    if (ring::Payload* payload = held(*item)) payload->~Payload();
    item->held[5] = 0;
    item->payload = nullptr;
    item->payload_size = 0;
}

int versavis_view(const versavis_item* item, versavis_image* image) {
    if (!has_size(item) || item->kind != VERSAVIS_FRAMES || !held(*item)) return VERSAVIS_INVALID;
    FrameMetadata metadata{};
    std::memcpy(static_cast<void*>(&metadata), item->data.words, sizeof metadata);
    const auto view = image_of(metadata, *held(*item));
    if (!view) return VERSAVIS_INVALID;
    const versavis_image known{sizeof known,
                               view->width,
                               view->height,
                               view->stride,
                               view->pixel_format,
                               view->layout.channels,
                               view->layout.bytes_per_channel,
                               0,
                               reinterpret_cast<const uint8_t*>(view->data)};
    return give(known, image);
}

int versavis_sensor(const versavis_item* item, versavis_sensor_state* state) {
    if (!has_size(item) || item->kind != VERSAVIS_FRAMES || !held(*item)) return VERSAVIS_INVALID;
    const SensorState found = unpack_sensor_state(held(*item)->attributes());
    const versavis_sensor_state known{sizeof known, found.gain, found.temperature_c};
    if (const int result = give(known, state); result != VERSAVIS_OK) return result;
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
        return added ? VERSAVIS_OK : fail(error, added.error());
    });
}

int versavis_wait_set_wait(versavis_wait_set* set, int64_t timeout, uint32_t* which) {
    if (set == nullptr || which == nullptr) return VERSAVIS_INVALID;
    return guarded(nullptr, [&] {
        const auto found = set->set.wait(nanoseconds(timeout));
        *which = static_cast<std::uint32_t>(found.value_or(0));
        return found ? VERSAVIS_OK : VERSAVIS_NOTHING;
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
        if (!how) return invalid(error, bad_options);
        auto window = ImuWindow::open(stream, *how);
        if (!window) return fail(error, window.error());
        *opened = new versavis_imu_window{std::move(*window), {}};
        return VERSAVIS_OK;
    });
}

void versavis_imu_window_close(versavis_imu_window* window) { delete window; }

int versavis_imu_window_span(versavis_imu_window* window, const versavis_time* after,
                             const versavis_time* upto, int64_t patience, versavis_imu_span* span) {
    if (window == nullptr || after == nullptr || upto == nullptr || !has_size(span))
        return VERSAVIS_INVALID;
    const auto length = time_of(*upto).since(time_of(*after));
    if (!length) return VERSAVIS_OTHER_EPOCH;
    if (*length < Duration{}) return VERSAVIS_INVALID;
    return guarded(nullptr, [&]() -> int {
        const auto found =
            window->window.between(time_of(*after), time_of(*upto), nanoseconds(patience));
        if (!found) return static_cast<int>(found.error().why);
        return give(fill(*window, *found), span);
    });
}

int versavis_imu_window_fd(versavis_imu_window* window, versavis_error* error) {
    if (window == nullptr) return invalid(error, "versavis_imu_window_fd: the window is NULL");
    return guarded(error, [&] { return give(window->window.reader().fd(), error); });
}

int versavis_sets_open(const char* instance, const char* const* cameras, size_t count,
                       const versavis_sets_options* options, versavis_sets** opened,
                       versavis_error* error) {
    if (cameras == nullptr || opened == nullptr || count == 0 || count > VERSAVIS_MOST_CAMERAS ||
        std::find(cameras, cameras + count, nullptr) != cameras + count)
        return invalid(error, "versavis_sets_open: needs the names of 1 to 16 cameras");
    *opened = nullptr;
    return guarded(error, [&]() -> int {
        const auto how = asked<versavis_sets_options>(options, VERSAVIS_SETS_OPTIONS_INIT);
        const auto streams = how ? translate(instance, how->streams) : std::nullopt;
        if (!streams) return invalid(error, bad_options);
        auto sets = open_sets({cameras, cameras + count}, *streams, *how);
        if (!sets) return fail(error, sets.error());
        *opened = new versavis_sets{std::move(*sets)};
        return VERSAVIS_OK;
    });
}

void versavis_sets_close(versavis_sets* sets) { delete sets; }

int versavis_sets_next(versavis_sets* sets, versavis_set* set, int64_t timeout) {
    return next_set(sets, set,
                    [&](SetReader& reader) { return reader.next(nanoseconds(timeout)); });
}

int versavis_sets_latest(versavis_sets* sets, versavis_set* set, int64_t timeout) {
    return next_set(sets, set,
                    [&](SetReader& reader) { return reader.latest(nanoseconds(timeout)); });
}

int versavis_sets_report(const versavis_sets* sets, versavis_set_report* report) {
    if (sets == nullptr) return VERSAVIS_INVALID;
    const SetReport& known = sets->reader.report();
    const versavis_set_report made{sizeof made,    0,          known.sets,   known.incomplete,
                                   known.left_out, known.lost, known.skipped};
    return give(made, report);
}

int versavis_sets_fd(versavis_sets* sets, versavis_error* error) {
    if (sets == nullptr) return invalid(error, "versavis_sets_fd: sets is NULL");
    return guarded(error, [&] { return give(sets->reader.fd(), error); });
}

int versavis_set_frame(const versavis_set* set, uint32_t camera, versavis_item* item) {
    const HeldSet* frames = held(set);
    if (frames == nullptr || camera >= frames->frames.size() || !has_size(item))
        return VERSAVIS_INVALID;
    const auto& frame = frames->frames[camera];
    if (!frame) {
        versavis_release(item);
        return VERSAVIS_NOTHING;
    }
    fill(*item, *frame, ring::StreamKind::frames);
    return VERSAVIS_OK;
}

int versavis_set_valid(const versavis_set* set) {
    const HeldSet* frames = held(set);
    if (frames == nullptr) return 0;
    const auto good = [](const auto& frame) { return !frame || frame->valid(); };
    return std::all_of(frames->frames.begin(), frames->frames.end(), good) ? 1 : 0;
}

void versavis_set_release(versavis_set* set) {
    if (!has_size(set)) return;
    delete static_cast<HeldSet*>(set->held);
    const versavis_set empty = VERSAVIS_SET_INIT;
    give(empty, set);
}
