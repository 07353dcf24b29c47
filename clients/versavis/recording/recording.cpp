// SPDX-License-Identifier: BSD-3-Clause
#include "recording/recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <list>
#include <optional>
#include <set>

#include "base/byte_cursor.hpp"
#include "base/plausible_time.hpp"
#include "recording/item_messages.hpp"
#include "recording/mcap_reader.hpp"
#include "recording/ros_image.hpp"

namespace versavis::client {

namespace {

/// Chunks that at() keeps. Streams are written within some chunks of one another: with fewer, a
/// recording with many cameras may be read twice.
constexpr std::size_t kept_chunks = 8;

/// The image that was met last, of one camera.
struct Image {
    std::uint32_t sequence;
    std::uint32_t place;
    std::span<const std::byte> message;
    bool compressed;
};

/// What one way through chunks knows; channels may be announced on the way.
struct Walk {
    std::map<std::uint16_t, ChannelRole> parts;
    std::set<std::string, std::less<>> wanted;  ///< empty: all
    std::map<std::string, Image, std::less<>> images;
    std::vector<std::byte> pixels;

    bool wants(const std::string& stream) const {
        return wanted.empty() || wanted.count(stream) != 0;
    }
};

/// The pixels that the image has for an item, if it has.
void add_pixels(const Image& image, const FrameMetadata& frame, std::vector<std::byte>& unpacked,
                RecordedItem& item) {
    if (image.compressed) {
        const auto message = parse_compressed_image(image.message);
        if (!message) return;
        item.png = message->data;
        if (unpack_png(message->data, frame, unpacked)) item.payload = unpacked;
        return;
    }
    const auto message = parse_image(image.message);
    if (message && message->width == frame.width && message->height == frame.height)
        item.payload = message->data;
}

std::string metadata_value(const RecordingFacts& facts, const std::string& key) {
    const auto found = facts.metadata.find(key);
    return found == facts.metadata.end() ? std::string() : found->second;
}

/// The numbers of files that are named as later ones of a recording.
std::set<std::uint32_t> later_parts(const std::filesystem::path& first) {
    std::set<std::uint32_t> parts;
    const std::string begin = first.stem().string() + "-";
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(
             first.parent_path().empty() ? "." : first.parent_path(), error)) {
        const std::string stem = entry.path().stem().string();
        if (entry.path().extension() != first.extension() || !stem.starts_with(begin)) continue;
        const std::string number = stem.substr(begin.size());
        const bool digits = number.find_first_not_of("0123456789") == std::string::npos;
        if (number.size() < 4 || number.size() > 6 || !digits) continue;
        parts.insert(static_cast<std::uint32_t>(std::stoul(number)));
    }
    parts.erase(0);
    return parts;
}

}  // namespace

struct Recording::File {
    struct Kept {
        std::uint32_t chunk;
        McapBuffer buffer;
        std::span<const std::byte> records;
    };

    McapReader reader;
    std::map<std::uint16_t, ChannelRole> parts;
    std::vector<RecordedStream> streams;
    std::vector<Attachment> attachments;
    RecordingFacts facts;
    std::list<Kept> kept;                                  ///< the one used last in front
    Walk places;                                           ///< of at()
    std::uint32_t index = 0;                               ///< among the recording's files
    mutable std::map<std::uint64_t, std::string> damages;  ///< by their places
    mutable std::set<std::uint32_t> damaged_chunks;

    explicit File(McapReader opened) : reader(std::move(opened)) {}

    Expected<> take_stock();
    void count_items();
    void count(const ChannelRole& part, std::uint64_t items);
    Walk walk(const std::vector<std::string>& wanted) const;
    Expected<bool> visit(Walk& walk, std::uint32_t chunk, const McapRecord& record,
                         const Take& take, bool with_pixels) const;
    Expected<bool> take_item(Walk& walk, const ChannelRole& part, std::uint32_t chunk,
                             const McapRecord& record, const Take& take, bool with_pixels) const;
    bool for_each(const std::vector<std::string>& wanted, const Take& take, bool with_pixels) const;
    void each_record(std::uint32_t chunk, bool with_pixels, const McapReader::Visit& visit) const;
    void note(std::uint64_t offset, const Error& damage) const;
    void check() const;
    Expected<std::span<const std::byte>> keep(std::uint32_t chunk);
    void add_gaps(std::vector<RecordedGap>& gaps) const;

 private:
    mutable McapBuffer buffer_;
};

Recording::Recording() = default;
Recording::Recording(Recording&&) noexcept = default;
Recording& Recording::operator=(Recording&&) noexcept = default;
Recording::~Recording() = default;

Expected<Recording> Recording::open(const std::string& path) {
    auto recording = open_file(path);
    if (recording && metadata_value(recording->facts_, "part") == "0") recording->follow(path);
    return recording;
}

Expected<Recording> Recording::open_file(const std::string& path) {
    auto reader = McapReader::open(path);
    if (!reader) return Unexpected(reader.error());
    auto file = std::make_unique<File>(std::move(*reader));
    if (auto taken = file->take_stock(); !taken) return Unexpected(taken.error());
    Recording recording;
    recording.add(std::move(file));
    return recording;
}

std::vector<std::string> Recording::paths() const {
    std::vector<std::string> paths;
    for (const auto& file : files_) paths.push_back(file->reader.path());
    return paths;
}

/// NAME.mcap is followed by NAME-0001.mcap and so on, of the same run of the same instance.
void Recording::follow(const std::string& path) {
    const std::filesystem::path first(path);
    const auto named = [&](std::uint32_t part) {
        auto next = first;
        return next.replace_filename(
            fmt::format("{}-{:04}{}", first.stem().string(), part, first.extension().string()));
    };
    std::uint32_t last = 0;
    for (const std::uint32_t part : later_parts(first)) {
        const auto next = named(part);
        auto opened = open_file(next.string());
        const bool belongs =
            opened && metadata_value(opened->facts_, "part") == std::to_string(part) &&
            metadata_value(opened->facts_, "recording") == metadata_value(facts_, "recording") &&
            metadata_value(opened->facts_, "boot_id") == metadata_value(facts_, "boot_id") &&
            metadata_value(opened->facts_, "instance") == metadata_value(facts_, "instance");
        if (!belongs) {
            const std::string why = opened ? "it is of another recording" : opened.error().what;
            facts_.defect += fmt::format("{}{} is not used: {}", facts_.defect.empty() ? "" : "; ",
                                         next.filename().string(), why);
            continue;
        }
        for (std::uint32_t missing = last + 1; missing < part; ++missing)
            if (std::error_code error; !std::filesystem::exists(named(missing), error))
                facts_.missing.push_back(named(missing).filename().string());
        last = part;
        add(std::move(opened->files_.front()));
    }
}

void Recording::add(std::unique_ptr<File> file) {
    const RecordingFacts& its = file->facts;
    if (files_.empty()) {
        facts_ = its;
    } else {
        facts_.bytes += its.bytes;
        facts_.good_end += its.good_end;
        facts_.chunks += its.chunks;
        if (!its.defect.empty())
            facts_.defect += fmt::format("{}file {}: {}", facts_.defect.empty() ? "" : "; ",
                                         files_.size() + 1, its.defect);
    }
    for (const RecordedStream& stream : file->streams) {
        const auto found = std::find_if(streams_.begin(), streams_.end(),
                                        [&](const auto& one) { return one.name == stream.name; });
        if (found == streams_.end())
            streams_.push_back(stream);
        else
            found->items += stream.items;
    }
    file->index = static_cast<std::uint32_t>(files_.size());
    files_.push_back(std::move(file));
    facts_.files = files_.size();
}

const std::vector<RecordedStream>& Recording::streams() const { return streams_; }
const std::vector<Attachment>& Recording::attachments() const {
    return files_.front()->attachments;
}
const RecordingFacts& Recording::facts() const { return facts_; }

const Attachment* Recording::attachment(const std::string& name) const {
    const auto& all = attachments();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.name == name; });
    return found == all.end() ? nullptr : &*found;
}

void Recording::File::count(const ChannelRole& part, std::uint64_t items) {
    if (part.role != Role::item) return;
    const auto found = std::find_if(streams.begin(), streams.end(),
                                    [&](const auto& one) { return one.name == part.stream; });
    if (found == streams.end())
        streams.push_back({part.stream, part.kind, items});
    else
        found->items += items;
}

Expected<> Recording::File::take_stock() {
    for (const McapDamage& one : reader.damages()) damages[one.offset] = one.what;
    for (const auto& one : reader.attachments())
        attachments.push_back({one.name, one.media_type, one.content});
    facts = {1,
             reader.size(),
             reader.defect(),
             reader.good_end(),
             reader.chunks().size(),
             reader.library(),
             {}};
    bool ours = false;
    for (const auto& one : reader.metadata())
        if (one.name == "versavis") {
            facts.metadata = one.values;
            ours = true;
        }
    for (const auto& channel : reader.channels())
        parts.insert_or_assign(channel.id, role_of(channel));
    if (reader.defect().empty() && reader.statistics() && !reader.channels().empty()) {
        for (const auto& [channel, part] : parts) {
            const auto found = reader.statistics()->of_channel.find(channel);
            count(part, found == reader.statistics()->of_channel.end() ? 0 : found->second);
        }
    } else {
        count_items();
    }
    places = walk({});
    if (streams.empty() && !ours)
        return failure(reader.path(),
                       !damages.empty()
                           ? "holds no item that can be read: " + damages.begin()->second
                       : reader.chunks().empty() && !reader.defect().empty()
                           ? "holds no complete chunk: " + reader.defect()
                           : "is not a VersaVIS recording: it has none of its items",
                       "name a file that 'versavis record' wrote");
    return {};
}

/// Of a file that was cut off: channels are announced on the way.
void Recording::File::count_items() {
    Walk all = walk({});
    const Take take = [&](const RecordedItem& item) {
        count({Role::item, item.stream, item.kind}, 1);
        return true;
    };
    for (std::uint32_t chunk = 0; chunk < reader.chunks().size(); ++chunk)
        each_record(chunk, false, [&](const McapRecord& record) {
            return visit(all, chunk, record, take, false);
        });
    parts = std::move(all.parts);
}

Walk Recording::File::walk(const std::vector<std::string>& wanted) const {
    Walk walk;
    walk.parts = parts;
    walk.wanted.insert(wanted.begin(), wanted.end());
    return walk;
}

Expected<bool> Recording::File::visit(Walk& walk, std::uint32_t chunk, const McapRecord& record,
                                      const Take& take, bool with_pixels) const {
    if (record.opcode == McapOpcode::channel) {
        const auto channel = parse_channel(record.content);
        if (!channel) return reader.damaged(record.offset, "a channel is not whole");
        walk.parts.insert_or_assign(channel->id, role_of(*channel));
        return true;
    }
    if (record.opcode != McapOpcode::message) return true;
    const auto message = parse_message(record.content);
    if (!message) return reader.damaged(record.offset, "a message is too short");
    const auto found = walk.parts.find(message->channel);
    if (found == walk.parts.end()) return true;
    const ChannelRole& part = found->second;
    if (part.role == Role::item && walk.wants(part.stream))
        return take_item(walk, part, chunk, record, take, with_pixels);
    if (part.role == Role::image || part.role == Role::compressed) {
        const auto place =
            static_cast<std::uint32_t>(record.offset - reader.chunks()[chunk].records_offset);
        walk.images.insert_or_assign(
            part.stream, Image{message->sequence, place,
                               with_pixels ? message->data : std::span<const std::byte>(),
                               part.role == Role::compressed});
    }
    return true;
}

Expected<bool> Recording::File::take_item(Walk& walk, const ChannelRole& part, std::uint32_t chunk,
                                          const McapRecord& record, const Take& take,
                                          bool with_pixels) const {
    const auto message = parse_message(record.content);
    std::uint64_t payload_size = 0;
    const auto parsed =
        part.old ? parse_old_item(message->data, record.length - mcap_message_header, payload_size)
                 : parse_item_message(message->data, payload_size);
    if (!parsed) return reader.damaged(record.offset, "an item is too short");
    if (!is_plausible(parsed->time.ns))
        return reader.damaged(record.offset, "the stamp of an item is no time");
    const auto place =
        static_cast<std::uint32_t>(record.offset - reader.chunks()[chunk].records_offset);
    RecordedItem item{part.stream,
                      part.kind,
                      parsed->number,
                      parsed->life,
                      parsed->time,
                      parsed->metadata,
                      {},
                      parsed->length,
                      ring::no_attributes,
                      {index, chunk, place},
                      {}};
    if (part.kind != ring::StreamKind::frames) {
        if (payload_size != parsed->length)
            return reader.damaged(record.offset, "an item's length differs from the one it states");
        std::vector<std::byte> rest;
        item.payload = parsed->payload;
        if (item.payload.size() < payload_size) {  // it was only glanced at
            if (payload_size > record.length)
                return reader.damaged(record.offset, "an item is longer than its message");
            rest.resize(payload_size);
            if (auto got = reader.read(record.end() - payload_size, rest); !got)
                return Unexpected(got.error());
            item.payload = rest;
        }
        return take(item);
    }
    ItemMessage frame = *parsed;
    frame.kind = part.kind;
    item.attributes = frame.attributes();
    const auto image = walk.images.find(part.stream);
    if (image != walk.images.end() && image->second.sequence == message->sequence) {
        item.place.image = image->second.place;
        if (with_pixels)
            add_pixels(image->second, unpack<FrameMetadata>(item.metadata), walk.pixels, item);
    }
    return take(item);
}

void Recording::File::note(std::uint64_t offset, const Error& damage) const {
    damages.try_emplace(offset, damage.what);
}

/// A chunk that is damaged is left out, and so is a record that `visit` cannot use.
void Recording::File::each_record(std::uint32_t chunk, bool with_pixels,
                                  const McapReader::Visit& visit) const {
    const McapChunk& place = reader.chunks()[chunk];
    if (damaged_chunks.count(chunk) != 0) return;
    const McapReader::Visit each = [&](const McapRecord& record) -> Expected<bool> {
        auto taken = visit(record);
        if (taken) return taken;
        note(record.offset, taken.error());
        return true;
    };
    Expected<> read;
    if (!with_pixels) {
        read = reader.glance(place, each);
    } else {
        const auto records = reader.load(place, buffer_);
        if (!records) damaged_chunks.insert(chunk);
        read = records ? reader.for_each(place, *records, each) : Unexpected(records.error());
    }
    if (!read) note(place.offset, read.error());
}

void Recording::File::check() const {
    for (std::uint32_t chunk = 0; chunk < reader.chunks().size(); ++chunk)
        each_record(chunk, true, [](const McapRecord&) -> Expected<bool> { return true; });
}

bool Recording::File::for_each(const std::vector<std::string>& wanted, const Take& take,
                               bool with_pixels) const {
    Walk way = walk(wanted);
    bool more = true;
    for (std::uint32_t chunk = 0; more && chunk < reader.chunks().size(); ++chunk) {
        way.images.clear();
        each_record(chunk, with_pixels, [&](const McapRecord& record) -> Expected<bool> {
            auto taken = visit(way, chunk, record, take, with_pixels);
            if (taken) more = *taken;
            return taken;
        });
    }
    return more;
}

Expected<> Recording::for_each(const std::vector<std::string>& streams, const Take& take) const {
    return in_each_file(streams, take, true);
}

Expected<> Recording::glance(const std::vector<std::string>& streams, const Take& take) const {
    return in_each_file(streams, take, false);
}

Expected<> Recording::in_each_file(const std::vector<std::string>& streams, const Take& take,
                                   bool with_pixels) const {
    for (const auto& file : files_)
        if (!file->for_each(streams, take, with_pixels)) break;
    return {};
}

Expected<std::span<const std::byte>> Recording::File::keep(std::uint32_t chunk) {
    const auto found =
        std::find_if(kept.begin(), kept.end(), [&](const Kept& one) { return one.chunk == chunk; });
    if (found != kept.end()) {
        kept.splice(kept.begin(), kept, found);
        return found->records;
    }
    if (kept.size() < kept_chunks)
        kept.emplace_front();
    else
        kept.splice(kept.begin(), kept, std::prev(kept.end()));
    Kept& one = kept.front();
    auto records = reader.load(reader.chunks()[chunk], one.buffer);
    if (!records) {
        kept.pop_front();
        return records;
    }
    one.chunk = chunk;
    one.records = *records;
    return one.records;
}

Expected<> Recording::at(const ItemPlace& place, const Take& take) const {
    File& file = *files_.at(place.file);
    const McapChunk& chunk = file.reader.chunks().at(place.chunk);
    const auto records = file.keep(place.chunk);
    if (!records) return Unexpected(records.error());
    file.places.images.clear();
    for (const std::uint32_t offset : {place.image, place.item}) {
        if (offset >= records->size()) continue;
        const McapChunk rest{chunk.offset, chunk.records_offset + offset, 0, 0, {}};
        auto read = file.reader.for_each(
            rest, records->subspan(offset), [&](const McapRecord& record) -> Expected<bool> {
                auto taken = file.visit(file.places, place.chunk, record, take, true);
                if (!taken) return taken;
                return false;  // only this record
            });
        if (!read) return read;
    }
    return {};
}

void Recording::File::add_gaps(std::vector<RecordedGap>& gaps) const {
    for (std::uint32_t chunk = 0; chunk < reader.chunks().size(); ++chunk)
        each_record(chunk, false, [&](const McapRecord& record) -> Expected<bool> {
            const auto message =
                record.opcode == McapOpcode::message ? parse_message(record.content) : std::nullopt;
            if (!message) return true;
            const auto part = parts.find(message->channel);
            if (part == parts.end() || part->second.role != Role::gap) return true;
            const auto gap =
                part->second.old ? parse_old_gap(message->data) : parse_gap_message(message->data);
            if (!gap) return reader.damaged(record.offset, "a gap is damaged");
            gaps.push_back({part->second.stream,
                            gap->reason,
                            gap->items,
                            {static_cast<std::int64_t>(message->log_time)}});
            return true;
        });
}

Expected<std::vector<RecordedGap>> Recording::gaps() const {
    std::vector<RecordedGap> gaps;
    for (const auto& file : files_) file->add_gaps(gaps);
    return gaps;
}

void Recording::check() const {
    for (const auto& file : files_) file->check();
}

std::vector<std::string> Recording::damages() const {
    std::vector<std::string> all;
    for (const auto& file : files_)
        for (const auto& [offset, what] : file->damages)
            all.push_back(
                files_.size() == 1
                    ? what
                    : fmt::format("{}: {}",
                                  std::filesystem::path(file->reader.path()).filename().string(),
                                  what));
    return all;
}

}  // namespace versavis::client
