// SPDX-License-Identifier: BSD-3-Clause
#include "record/recorder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <ctime>
#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>

#include "base/stream_names.hpp"
#include "base/task_queue.hpp"
#include "engine/toml/service_file.hpp"
#include "record/item_writer.hpp"
#include "record/png_encoder.hpp"
#include "record/write_back.hpp"
#include "recording/bag_metadata.hpp"
#include "recording/lenses.hpp"
#include "status/status_document.hpp"
#include "versavis/ring_path.hpp"
#include "versavis/ring_reader.hpp"
#include "versavis/wait_set.hpp"

namespace versavis::client {

namespace {

/// A chunk ends when it is so large, or so old: a crash loses no more.
constexpr std::uint64_t chunk_size = 4 << 20U;
constexpr Duration chunk_age = milliseconds(500);

/// Between looks for new streams, whose rings hold some seconds at least, and reports of progress.
constexpr Duration round = seconds(1);

/// Between looks at `stop`.
constexpr Duration longest_wait = milliseconds(100);

/// Items of one stream in a row, while others wait.
constexpr int in_a_row = 64;

/// Encoded at a time.
constexpr std::size_t frames_per_processor = 4;

constexpr std::uint32_t slipped = static_cast<std::uint32_t>(EventKind::pairing_slipped);

/// Where a new epoch is a gap; events of two epochs may come in any order.
std::uint32_t epoch_of(ring::StreamKind kind, const ring::Item& item) {
    const bool in_order = kind == ring::StreamKind::frames || kind == ring::StreamKind::imu;
    return in_order ? item.time.epoch : 0;
}

/// False also where nobody knows: what belongs to another epoch is rather recorded than lost.
bool is_older(const EpochTime& time, const EpochTime& from) {
    if (time.epoch == no_epoch) return time.output() < from.output();
    const auto since = time.since(from);
    return since && *since < Duration{};
}

/// Evidence and clock are of the service's whole run.
bool has_stamps(ring::StreamKind kind) {
    return kind != ring::StreamKind::evidence && kind != ring::StreamKind::clock;
}

struct Source {
    std::string name;
    ring::Reader reader;
    std::uint32_t epoch = 0;
    bool gone = false;   ///< and that was reported
    bool begun = false;  ///< an item of it was taken
    OutputTime last{};   ///< stamp of the newest that was
    /// What is older is not wanted, and what was overwritten before the first item not missed.
    std::optional<EpochTime> from{};
    /// Gaps before the first item: they have no time until it comes.
    std::vector<std::pair<GapReason, std::uint64_t>> unreported{};

    ring::StreamKind kind() const { return reader.kind(); }
};

std::string default_name() {
    return fmt::format("versavis-{:%Y%m%d-%H%M%S}.mcap", fmt::localtime(std::time(nullptr)));
}

/// `NAME.mcap`, `NAME-0001.mcap`, ...
std::string part_name(const std::string& first, unsigned part) {
    if (part == 0) return first;
    const std::filesystem::path path(first);
    const std::string name =
        fmt::format("{}-{:04}{}", path.stem().string(), part, path.extension().string());
    return (path.parent_path() / name).string();
}

std::uint64_t room_on_disk(const std::string& file) {
    struct statvfs system {};
    if (::statvfs(file.c_str(), &system) != 0) return 0;
    return std::uint64_t{system.f_bavail} * system.f_frsize;
}

/// Whatever the document is: it may be played, from any file.
std::string text_at(const nlohmann::json& document, const char* place) {
    const nlohmann::json::json_pointer at(place);
    return document.contains(at) && document[at].is_string() ? document[at].get<std::string>() : "";
}

/// A file that stands where a later one of this recording will: its name.
std::optional<std::string> later_file(const std::string& first) {
    const std::filesystem::path path(first);
    const std::string begin = path.stem().string() + "-";
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(
             path.parent_path().empty() ? "." : path.parent_path(), error)) {
        const std::filesystem::path name = entry.path().filename();
        const std::string stem = name.stem().string();
        const std::string number = stem.substr(std::min(begin.size(), stem.size()));
        if (name.extension() == path.extension() && stem.starts_with(begin) && number.size() >= 4 &&
            number.find_first_not_of("0123456789") == std::string::npos)
            return entry.path().string();
    }
    return std::nullopt;
}

/// Files of one recording have it in common, and nothing else has it.
std::string random_id() {
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

struct Content {
    std::string name;
    std::string media_type;
    std::string bytes;
};

struct PngFrame {
    std::string stream;
    ring::Item item;
    std::vector<std::byte> png;
};

class Recorder {
 public:
    explicit Recorder(const RecordSettings& settings) : settings_(settings) {}

    Expected<RecordReport> run();

 private:
    Expected<> open_streams();
    Expected<> open_stream(const std::string& name, ring::Position start);
    Expected<> read_calibration();
    Expected<> choose_file();
    Expected<> describe_folder() const;
    void go_back();
    void look_for_streams();
    void wait_for_streams();
    void keep_configuration(const nlohmann::json& status);
    Expected<> begin_file();
    Expected<> end_file();
    Expected<> attach_all();
    Expected<> take(Source& source);
    void take_pause(Source& source, const ring::NoItem& none);
    Expected<> take_item(Source& source, ring::Item item);
    Expected<> take_frame(Source& source, ring::Item item);
    Expected<> write_png_frames(bool all);
    void lose(Source& source, std::uint64_t items);
    void report_gap(Source& source, GapReason reason, std::uint64_t items);
    void begin(Source& source, const ring::Item& item);
    void count(const std::string& stream, OutputTime time);
    void stop_early(const Error& why);
    Expected<> take_all();
    Expected<> end_chunk_if_due(HostTime now);
    void end_each_round(HostTime now);
    bool over(HostTime now) const;

    const RecordSettings& settings_;
    const std::string id_ = random_id();
    RecordReport report_;
    std::vector<std::unique_ptr<Source>> sources_;
    WaitSet waiting_;
    std::optional<ItemWriter> writer_;
    bool file_open_ = false;
    std::string folder_;  ///< of all files, with metadata.yaml; empty: none was named
    WriteBack write_back_;
    std::optional<TaskQueue<PngFrame>> png_frames_;
    std::vector<Content> attachments_;
    Lenses lenses_;
    std::map<std::string, std::uint64_t> in_chunk_;  ///< items in the chunk that is open
    HostTime begun_;
    HostTime file_begun_;
    HostTime chunk_begun_;
    HostTime round_begun_;
    std::uint64_t closed_bytes_ = 0;  ///< of files before this one
};

Expected<> Recorder::open_stream(const std::string& name, ring::Position start) {
    ring::Options options;
    options.start = start;
    auto reader = ring::Reader::open(stream_path(settings_.instance, name), options);
    if (!reader) return Unexpected(reader.error());
    // Pairing and clock can only be done again from their earlier inputs, too.
    const bool whole = !has_stamps(reader->kind());
    if (whole) reader->seek(ring::Position::oldest);
    sources_.push_back(std::make_unique<Source>(Source{name, std::move(*reader)}));
    if (whole)
        sources_.back()->from = EpochTime{0, std::numeric_limits<std::int64_t>::min(), no_epoch};
    report_.streams[name].kind = sources_.back()->kind();
    return {};
}

/// So far before the newest item of all: of a stream with nothing new for long, nothing is wanted.
void Recorder::go_back() {
    std::optional<EpochTime> newest;
    for (const auto& source : sources_) {
        if (!has_stamps(source->kind())) continue;
        const auto item = source->reader.latest();
        if (!item || item->time.epoch == no_epoch) continue;
        if (!newest || newest->precedes(item->time)) newest = item->time;
    }
    if (!newest) return;
    newest->ns -= settings_.before->ns;
    report_.from = newest->output();
    for (const auto& source : sources_) {
        if (!has_stamps(source->kind())) continue;
        source->reader.seek(ring::Position::oldest);
        source->from = newest;
    }
}

Expected<> Recorder::open_streams() {
    const bool all = settings_.streams.empty();
    for (const std::string& name : all ? stream_names(settings_.instance) : settings_.streams) {
        auto opened = is_stream_name(name)
                          ? open_stream(name, ring::Position::next)
                          : failure(name, "is not a name of a stream", "see 'versavis list'");
        if (!opened && !all) return Unexpected(explain(opened.error(), settings_.instance, name));
        if (!opened) report_.left_out.push_back(opened.error().message());
    }
    if (sources_.empty())
        return failure(instance_directory(settings_.instance).string(), "has no streams to record",
                       "is versavisd running? --instance selects another instance");
    if (settings_.before) go_back();
    wait_for_streams();
    return {};
}

void Recorder::wait_for_streams() {
    waiting_ = WaitSet();
    for (const auto& source : sources_) {
        auto added = waiting_.add(source->reader);
        if (!added) report_.left_out.push_back(added.error().message());
    }
}

/// A stream that has just come is recorded from its first item on.
void Recorder::look_for_streams() {
    if (!settings_.streams.empty()) return;
    bool found = false;
    for (const std::string& name : stream_names(settings_.instance)) {
        const bool known = std::any_of(sources_.begin(), sources_.end(),
                                       [&](const auto& source) { return source->name == name; });
        if (!known && open_stream(name, ring::Position::oldest)) found = true;
    }
    if (found) wait_for_streams();
}

Expected<> Recorder::read_calibration() {
    for (const std::string& path : settings_.calibration) {
        auto text = read_kalibr_file(path);
        if (!text) return Unexpected(text.error());
        const bool imu = text->find("rostopic") != std::string::npos &&
                         text->find("gyroscope_noise_density") != std::string::npos;
        if (!imu) {
            auto lenses = parse_lenses(*text, path);
            if (!lenses) return Unexpected(lenses.error());
            report_.not_in_camera_info.insert(report_.not_in_camera_info.end(),
                                              lenses->left_out.begin(), lenses->left_out.end());
            lenses_.add(std::move(*lenses));
        }
        attachments_.push_back({imu ? "calibration/imu.yaml" : "calibration/camchain.yaml",
                                "application/yaml", std::move(*text)});
    }
    return {};
}

/// Who records may be somebody who may not read it; then the recording does without.
void Recorder::keep_configuration(const nlohmann::json& status) {
    const std::string name = "configuration.toml";
    const bool known = std::any_of(attachments_.begin(), attachments_.end(),
                                   [&](const Content& one) { return one.name == name; });
    if (known) return;
    if (auto text = service_text(text_at(status, "/configuration")))
        attachments_.push_back({name, "application/toml", std::move(*text)});
}

/// A name that is taken must not end the recording when its turn comes.
Expected<> Recorder::choose_file() {
    report_.files.push_back(settings_.output.empty() ? default_name() : settings_.output);
    if (std::string& first = report_.files.front(); first.ends_with('/')) {
        const auto folder = std::filesystem::path(first).parent_path();
        std::error_code error;
        if (!std::filesystem::create_directory(folder, error))
            return error ? not_written(folder.string(), error.value())
                         : not_written(folder.string(), EEXIST);
        folder_ = folder.string();
        first = (folder / folder.filename()).string() + ".mcap";
    }
    const bool split = settings_.split_bytes > 0 || settings_.split_length;
    const auto taken = split ? later_file(report_.files.front()) : std::nullopt;
    if (!taken) return {};
    return failure(*taken, "exists, and a later file of this recording would need its name",
                   "choose another file with -o, or move it away; no file is overwritten");
}

Expected<> Recorder::begin_file() {
    const auto part = static_cast<unsigned>(writer_ ? report_.files.size() : 0);
    const std::string path = part_name(report_.files.front(), part);
    auto file = McapWriter::create(path, "versavis " VERSAVIS_VERSION);
    if (!file) return Unexpected(file.error());
    if (part > 0) report_.files.push_back(path);
    writer_.emplace(std::move(*file), lenses_);
    file_open_ = true;
    file_begun_ = host_now();
    const auto status = read_status(settings_.instance);
    std::map<std::string, std::string> facts{{"version", "2"},
                                             {"instance", settings_.instance},
                                             {"recording", id_},
                                             {"part", std::to_string(part)},
                                             {"recorder", VERSAVIS_VERSION}};
    std::ifstream("/proc/sys/kernel/random/boot_id") >> facts["boot_id"];
    if (status) keep_configuration(*status);
    if (status) facts["output_clock"] = text_at(*status, "/clock/output");
    if (auto added = writer_->file().add_metadata("versavis", facts); !added) return added;
    if (status) {
        auto attached = writer_->file().attach("status.json", "application/json", status->dump(),
                                               std::int64_t{0});
        if (!attached) return attached;
    }
    return attach_all();
}

Expected<> Recorder::attach_all() {
    for (const Content& one : attachments_)
        if (auto done = writer_->file().attach(one.name, one.media_type, one.bytes, 0); !done)
            return done;
    return {};
}

Expected<> Recorder::end_file() {
    write_back_.finish();
    if (auto ended = writer_->file().end_chunk(); !ended) return ended;
    in_chunk_.clear();  // what it held is in the file, even where that has no room for its summary
    if (auto closed = writer_->file().close(); !closed) return closed;
    file_open_ = false;
    closed_bytes_ += writer_->file().size();
    return {};
}

void Recorder::lose(Source& source, std::uint64_t items) {
    if (source.from) return;
    report_.streams[source.name].lost += items;
    report_gap(source, GapReason::lost, items);
}

void Recorder::report_gap(Source& source, GapReason reason, std::uint64_t items) {
    const OutputTime last = source.last;
    if (source.begun)
        writer_->write_gap(source.name, reason, items, last, last, source.epoch);
    else
        source.unreported.emplace_back(reason, items);
}

void Recorder::take_pause(Source& source, const ring::NoItem& none) {
    if (none.why == ring::Pause::lost) lose(source, none.lost);
    if (none.why == ring::Pause::restarted) {
        ++report_.streams[source.name].restarts;
        report_gap(source, GapReason::restarted, 0);
    }
    if (none.why == ring::Pause::gone) report_gap(source, GapReason::gone, 0);
}

/// The first item of a stream, and each of another epoch.
void Recorder::begin(Source& source, const ring::Item& item) {
    source.from.reset();
    const std::uint32_t epoch = epoch_of(source.kind(), item);
    if (source.begun && epoch != source.epoch) {
        ++report_.streams[source.name].epochs;
        writer_->write_gap(source.name, GapReason::epoch, 0, source.last, source.last, epoch);
    }
    for (const auto& [reason, items] : std::exchange(source.unreported, {}))
        writer_->write_gap(source.name, reason, items, {}, item.time.output(), epoch);
    source.epoch = epoch;
}

void Recorder::count(const std::string& stream, OutputTime time) {
    StreamReport& report = report_.streams[stream];
    if (report.items++ == 0) report.first = time;
    report.last = time;
    ++in_chunk_[stream];
}

Expected<> Recorder::take_item(Source& source, ring::Item item) {
    begin(source, item);
    if (source.kind() == ring::StreamKind::frames) return take_frame(source, std::move(item));
    if (writer_->write(source.name, source.kind(), item) == ItemWriter::Outcome::overtaken) {
        lose(source, 1);
        return {};
    }
    if (source.kind() == ring::StreamKind::events &&
        static_cast<std::uint32_t>(unpack<EventMetadata>(item.metadata).kind) == slipped)
        ++report_.slips;
    source.last = item.time.output();
    count(source.name, source.last);
    source.begun = true;
    return {};
}

Expected<> Recorder::take_frame(Source& source, ring::Item item) {
    const OutputTime time = item.time.output();
    const auto frame = unpack<FrameMetadata>(item.metadata);
    if (png_frames_ && can_be_png(frame, item.payload.size())) {
        if (png_frames_->full())
            if (auto written = write_png_frames(false); !written) return written;
        std::vector<std::byte> pixels(item.payload.size());
        if (!item.payload.copy_to(pixels.data())) {
            lose(source, 1);
            return {};
        }
        png_frames_->push([stream = source.name, item = std::move(item), frame,
                           pixels = std::move(pixels)]() mutable {
            return PngFrame{std::move(stream), std::move(item), encode_png(frame, pixels)};
        });
    } else {
        const auto outcome = writer_->write_frame(source.name, item);
        if (!outcome) {
            ++report_.streams[source.name].lost;
            return Unexpected(outcome.error());
        }
        if (*outcome == ItemWriter::Outcome::overtaken) {
            lose(source, 1);
            return {};
        }
        count(source.name, time);
    }
    source.last = time;
    source.begun = true;
    return {};
}

/// Those that are ready, in the order of their arrival; at least one if the queue is full; `all`:
/// waits for each.
Expected<> Recorder::write_png_frames(bool all) {
    while (png_frames_) {
        auto encoded = png_frames_->take(all || png_frames_->full());
        if (!encoded) break;
        auto written = writer_->write_png(encoded->stream, encoded->item, encoded->png);
        if (!written) {
            ++report_.streams[encoded->stream].lost;
            return written;
        }
        count(encoded->stream, encoded->item.time.output());
    }
    return {};
}

Expected<> Recorder::take(Source& source) {
    for (int i = 0; i < in_a_row;) {
        auto item = source.reader.next();
        if (item) {
            source.gone = false;
            if (source.from && is_older(item->time, *source.from)) continue;
            ++i;
            if (auto taken = take_item(source, std::move(*item)); !taken) return taken;
            continue;
        }
        if (item.error().why == ring::Pause::nothing) break;
        const bool gone = item.error().why == ring::Pause::gone;
        // That it is gone is reported once; the reader returns it at each call.
        if (gone && std::exchange(source.gone, true)) break;
        take_pause(source, item.error());
        if (gone) break;
    }
    return {};
}

Expected<> Recorder::end_chunk_if_due(HostTime now) {
    McapWriter& file = writer_->file();
    if (file.chunk_size() == 0) chunk_begun_ = now;
    if (file.chunk_size() < chunk_size && now - chunk_begun_ < chunk_age) return {};
    if (auto ended = file.end_chunk(); !ended) return ended;
    in_chunk_.clear();
    write_back_.push(file.descriptor(), file.size());
    report_.bytes = closed_bytes_ + file.size();
    const bool large = settings_.split_bytes > 0 && file.size() >= settings_.split_bytes;
    const bool old = settings_.split_length && now - file_begun_ >= *settings_.split_length;
    if (!large && !old) return {};
    if (auto ended = end_file(); !ended) return ended;
    return begin_file();
}

void Recorder::end_each_round(HostTime now) {
    if (now - round_begun_ < round) return;
    round_begun_ = now;
    look_for_streams();
    report_.duration = now - begun_;
    settings_.progress(report_, room_on_disk(writer_->file().path()));
}

bool Recorder::over(HostTime now) const {
    return settings_.stop() || (settings_.length && now - begun_ >= *settings_.length);
}

Expected<> Recorder::take_all() {
    for (const auto& source : sources_) {
        if (auto taken = take(*source); !taken) return taken;
        if (auto ended = end_chunk_if_due(host_now()); !ended) return ended;
    }
    return write_png_frames(false);
}

/// The file ends before the chunk that is open. What was in that, or on its way there, is lost.
void Recorder::stop_early(const Error& why) {
    report_.stopped_early = why;
    write_back_.finish();
    for (const auto& [stream, items] : in_chunk_) {
        report_.streams[stream].items -= items;
        report_.streams[stream].lost += items;
    }
    while (png_frames_) {
        const auto encoded = png_frames_->take(true);
        if (!encoded) break;
        ++report_.streams[encoded->stream].lost;
    }
    if (!file_open_) return;
    if (!writer_->file().close_before_chunk())
        report_.stopped_early->cure += "; then run 'versavis repair' on the file";
    closed_bytes_ += writer_->file().size();
}

/// For readers that open a folder as one recording.
Expected<> Recorder::describe_folder() const {
    if (folder_.empty()) return {};
    const auto text = bag_metadata(report_.files);
    if (!text) return Unexpected(text.error());
    return write_whole_file(folder_ + "/metadata.yaml", *text);
}

Expected<RecordReport> Recorder::run() {
    if (auto read = read_calibration(); !read) return Unexpected(read.error());
    if (auto opened = open_streams(); !opened) return Unexpected(opened.error());
    if (auto chosen = choose_file(); !chosen) return Unexpected(chosen.error());
    if (settings_.png) png_frames_.emplace(frames_per_processor);
    if (auto made = begin_file(); !made) return Unexpected(made.error());
    begun_ = round_begun_ = chunk_begun_ = host_now();
    Expected<> done;
    while (done && !over(host_now())) {
        waiting_.wait(longest_wait);
        done = take_all();
        end_each_round(host_now());
    }
    if (done) done = write_png_frames(true);
    if (done) done = end_file();
    if (!done) stop_early(done.error());
    if (auto described = describe_folder(); !described && !report_.stopped_early)
        report_.stopped_early = described.error();
    report_.duration = host_now() - begun_;
    report_.bytes = closed_bytes_;
    return std::move(report_);
}

}  // namespace

std::uint64_t RecordReport::items() const {
    std::uint64_t all = 0;
    for (const auto& [name, stream] : streams) all += stream.items;
    return all;
}

std::uint64_t RecordReport::lost() const {
    std::uint64_t all = 0;
    for (const auto& [name, stream] : streams) all += stream.lost;
    return all;
}

Expected<RecordReport> record(const RecordSettings& settings) { return Recorder(settings).run(); }

}  // namespace versavis::client
