// SPDX-License-Identifier: BSD-3-Clause
#include "recording/salvage.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <map>

#include "base/byte_cursor.hpp"
#include "recording/mcap_writer.hpp"

namespace versavis::client {

namespace {

constexpr std::uint64_t salvaged_chunk = 4 << 20U;

class Salvager {
 public:
    Salvager(const McapReader& from, McapWriter to) : from_(from), to_(std::move(to)) {
        schemas_ = from.schemas();
        for (const McapChannel& channel : from.channels()) channels_[channel.id].channel = channel;
        for (const McapDamage& one : from.damages()) result_.left_out.push_back(one.what);
    }

    Expected<Salvage> run() {
        for (const McapMetadata& one : from_.metadata())
            if (auto added = to_.add_metadata(one.name, one.values); !added)
                return Unexpected(added.error());
        for (const McapAttachment& one : from_.attachments())
            if (auto added = to_.attach(one.name, one.media_type, one.content, 0); !added)
                return Unexpected(added.error());
        // What lies outside of chunks may be declared behind those, and the other way round.
        std::size_t loose = 0;
        for (const McapChunk& chunk : from_.chunks()) {
            if (auto taken = take_loose(loose, chunk.offset); !taken)
                return Unexpected(taken.error());
            if (auto taken = take_chunk(chunk); !taken) return Unexpected(taken.error());
        }
        if (auto taken = take_loose(loose, UINT64_MAX); !taken) return Unexpected(taken.error());
        if (undeclared_ > 0)
            result_.left_out.push_back(
                fmt::format("{} messages of channels whose definition is lost", undeclared_));
        if (auto closed = to_.close(); !closed) return Unexpected(closed.error());
        return std::move(result_);
    }

 private:
    struct Known {
        McapChannel channel;
        std::uint16_t id = 0;  ///< in the new file; 0: it has no message yet
    };

    Expected<> take_loose(std::size_t& next, std::uint64_t until) {
        const auto& loose = from_.loose();
        for (; next < loose.size() && loose[next] < until; ++next) {
            const auto record = from_.loose_record(loose[next], content_);
            if (!record) {
                result_.left_out.push_back(record.error().what);
                continue;
            }
            if (auto taken = take(*record); !taken) return taken;
        }
        return {};
    }

    Expected<> take_chunk(const McapChunk& chunk) {
        const auto records = from_.load(chunk, buffer_);
        if (!records) {
            result_.left_out.push_back(records.error().what);
            return {};
        }
        Expected<> written;
        const auto read =
            from_.for_each(chunk, *records, [&](const McapRecord& record) -> Expected<bool> {
                written = take(record);
                return written.has_value();
            });
        if (!read) result_.left_out.push_back(read.error().what);
        return written;
    }

    Expected<> take(const McapRecord& record) {
        ByteCursor cursor(record.content);
        if (record.opcode == McapOpcode::schema) {
            const auto id = cursor.number<std::uint16_t>();
            McapSchema schema{std::string(cursor.text()), std::string(cursor.text()), {}};
            schema.data = as_text(cursor.bytes(cursor.number<std::uint32_t>()));
            if (cursor.good()) schemas_.insert_or_assign(id, std::move(schema));
        }
        if (record.opcode == McapOpcode::channel)
            if (auto channel = parse_channel(record.content))
                channels_[channel->id].channel = std::move(*channel);
        if (record.opcode != McapOpcode::message) return {};
        const auto message = parse_message(record.content);
        if (!message) {
            result_.left_out.push_back(
                fmt::format("damaged at byte {}: a message is too short", record.offset));
            return {};
        }
        return put(*message);
    }

    Expected<> put(const McapMessage& message) {
        const auto found = channels_.find(message.channel);
        if (found == channels_.end()) {
            ++undeclared_;
            return {};
        }
        Known& known = found->second;
        if (known.id == 0) {
            const McapSchema& schema = schemas_[known.channel.schema];
            known.id = to_.add({known.channel.topic, known.channel.encoding, schema.name,
                                schema.encoding, schema.data, known.channel.metadata});
        }
        if (to_.chunk_size() == 0) ++result_.chunks;
        ++result_.messages;
        auto written =
            to_.write({known.id, message.sequence, static_cast<std::int64_t>(message.log_time),
                       message.publish_time},
                      {}, message.data);
        if (!written || to_.chunk_size() < salvaged_chunk) return written;
        return to_.end_chunk();
    }

    const McapReader& from_;
    McapWriter to_;
    std::map<std::uint16_t, McapSchema> schemas_;
    std::map<std::uint16_t, Known> channels_;
    std::uint64_t undeclared_ = 0;
    McapBuffer buffer_;
    std::vector<std::byte> content_;
    Salvage result_;
};

}  // namespace

Expected<Salvage> salvage(const McapReader& from, const std::string& path) {
    for (const McapChunk& chunk : from.chunks())
        if (auto readable = from.check_readable(chunk); !readable)
            return Unexpected(readable.error());
    auto file = McapWriter::create(path, from.library(), from.profile());
    if (!file) return Unexpected(file.error());
    auto saved = Salvager(from, std::move(*file)).run();
    if (!saved) ::unlink(path.c_str());
    return saved;
}

}  // namespace versavis::client
