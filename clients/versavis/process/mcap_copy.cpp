// SPDX-License-Identifier: BSD-3-Clause
#include "process/mcap_copy.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "base/byte_cursor.hpp"
#include "posix/file.hpp"
#include "recording/mcap_record.hpp"
#include "recording/mcap_summary.hpp"

namespace versavis::client {

namespace {

template <class T>
void put(std::string& text, T value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void put_text(std::string& text, const std::string& value) {
    put(text, static_cast<std::uint32_t>(value.size()));
    text += value;
}

void put_record(std::string& text, McapOpcode opcode, std::string_view content) {
    put(text, static_cast<std::uint8_t>(opcode));
    put(text, static_cast<std::uint64_t>(content.size()));
    text += content;
}

std::uint32_t crc_of(std::string_view text) {
    return static_cast<std::uint32_t>(
        crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size()));
}

std::string attachment_record(const McapAttachment& attachment) {
    std::string content;
    put(content, std::uint64_t{0});
    put(content, std::uint64_t{0});
    put_text(content, attachment.name);
    put_text(content, attachment.media_type);
    put(content, static_cast<std::uint64_t>(attachment.content.size()));
    content += attachment.content;
    put(content, crc_of(content));
    std::string record;
    put_record(record, McapOpcode::attachment, content);
    return record;
}

class Copy {
 public:
    Copy(const McapReader& from, WholeFile to, std::string path, const McapCopySettings& settings)
        : from_(from), to_(std::move(to)), path_(std::move(path)), settings_(settings) {}

    Expected<> run() {
        static constexpr char magic[] = "\x89MCAP0\r\n";
        if (auto put = append({magic, 8}); !put) return put;
        auto copied = from_.top_level([this](const McapRecord& record) { return take(record); });
        if (!copied) return copied;
        if (auto added = add_attachment(); !added) return added;
        if (auto ended = append(mcap_end(summary_, at_)); !ended) return ended;
        return to_.finish();
    }

 private:
    Expected<bool> take(const McapRecord& record) {
        if (!settings_.go_on(static_cast<double>(record.offset) /
                             static_cast<double>(from_.size())))
            return failure(path_, "stopped before the end of the recording");
        Expected<> done;
        switch (record.opcode) {
            case McapOpcode::data_end: return false;  // the summary is rebuilt
            case McapOpcode::message_index: return true;
            case McapOpcode::chunk: done = chunk_at(record.offset); break;
            case McapOpcode::attachment:
            case McapOpcode::metadata: note(record); [[fallthrough]];
            default: done = whole(record); break;
        }
        if (!done) return Unexpected(done.error());
        return true;
    }

    /// A record as it is, block by block.
    Expected<> whole(const McapRecord& record) {
        std::vector<std::byte> block(1 << 20U);
        for (std::uint64_t at = record.offset; at < record.end();) {
            const auto part =
                std::span(block).first(std::min<std::uint64_t>(block.size(), record.end() - at));
            if (auto got = from_.read(at, part); !got) return got;
            if (auto put = append(as_text(part)); !put) return put;
            at += part.size();
        }
        return {};
    }

    void note(const McapRecord& record) {
        ByteCursor cursor(record.content);
        const std::uint64_t length = record.end() - record.offset;
        if (record.opcode == McapOpcode::metadata) {
            summary_.metadata.push_back({at_, length, std::string(cursor.text())});
            return;
        }
        const auto log = cursor.number<std::uint64_t>();
        const auto created = cursor.number<std::uint64_t>();
        const std::string name(cursor.text());
        const std::string type(cursor.text());
        summary_.attachments.push_back(
            {at_, length, log, created, cursor.number<std::uint64_t>(), name, type});
    }

    Expected<> add_attachment() {
        const McapAttachment& added = settings_.added;
        if (added.name.empty()) return {};
        const std::string record = attachment_record(added);
        summary_.attachments.push_back(
            {at_, record.size(), 0, 0, added.content.size(), added.name, added.media_type});
        return append(record);
    }

    Expected<> chunk_at(std::uint64_t offset) {
        const auto& chunks = from_.chunks();
        const auto found = std::lower_bound(
            chunks.begin(), chunks.end(), offset,
            [](const McapChunk& chunk, std::uint64_t at) { return chunk.offset < at; });
        if (found == chunks.end() || found->offset != offset) return {};  // one that is not whole
        return copy_chunk(*found);
    }

    Expected<> copy_chunk(const McapChunk& chunk) {
        const auto records = from_.load(chunk, buffer_);
        if (!records) {
            settings_.damaged(records.error());
            return {};
        }
        records_.clear();
        places_.clear();
        SummaryChunk one{};
        if (auto looked = from_.for_each(chunk, *records,
                                         [&](const McapRecord& record) { return look_at(record); });
            !looked)
            return looked;
        auto read = from_.for_each(
            chunk, *records, [&](const McapRecord& record) { return take_record(record, one); });
        if (!read) return read;
        one.offset = at_;
        one.records_size = records_.size();
        if (auto written = write_chunk(one); !written) return written;
        summary_.chunks.push_back(std::move(one));
        return {};
    }

    Expected<> write_chunk(SummaryChunk& one) {
        std::string head;
        put(head, one.start_time);
        put(head, one.end_time);
        put(head, static_cast<std::uint64_t>(records_.size()));
        put(head, crc_of(records_));
        put_text(head, "");
        put(head, static_cast<std::uint64_t>(records_.size()));
        std::string opening;
        put(opening, static_cast<std::uint8_t>(McapOpcode::chunk));
        put(opening, static_cast<std::uint64_t>(head.size() + records_.size()));
        one.length = opening.size() + head.size() + records_.size();
        for (const std::string* part : {&opening, &head, &records_})
            if (auto put = append(*part); !put) return put;
        const std::uint64_t begin = at_;
        for (const auto& [channel, messages] : places_) {
            one.indexes[channel] = at_;
            if (auto put = append(message_index(channel, messages)); !put) return put;
        }
        one.indexes_length = at_ - begin;
        return {};
    }

    Expected<bool> look_at(const McapRecord& record) {
        ByteCursor cursor(record.content);
        const auto id = cursor.number<std::uint16_t>();
        if (record.opcode == McapOpcode::schema)
            schemas_.insert_or_assign(id, std::string(as_text(record.content)));
        if (record.opcode == McapOpcode::channel) {
            const auto channel = parse_channel(record.content);
            if (!channel) return from_.damaged(record.offset, "a damaged channel");
            channels_.insert_or_assign(id, *channel);
        }
        if (record.opcode != McapOpcode::message) return true;
        const auto message = parse_message(record.content);
        const auto channel = channels_.find(id);
        if (message && channel != channels_.end()) settings_.look(channel->second, *message);
        return true;
    }

    Expected<bool> take_record(const McapRecord& record, SummaryChunk& one) {
        ByteCursor cursor(record.content);
        const auto id = cursor.number<std::uint16_t>();
        if (!cursor.good()) return from_.damaged(record.offset, "a record is too short");
        if (record.opcode == McapOpcode::message) return take_message(record, one);
        if (record.opcode == McapOpcode::channel) put_channel(id, as_text(record.content));
        return true;
    }

    /// A schema stands before the first channel that uses it; one that none uses is left out.
    void put_channel(std::uint16_t id, std::string_view content) {
        const McapChannel& channel = channels_.at(id);
        if (const auto topic = settings_.convert(channel)) {
            const auto made = converted_.try_emplace(
                id, static_cast<std::uint16_t>(UINT16_MAX - converted_.size()));
            const std::uint16_t schema = made.first->second;
            put_schema(schema, mcap_schema(schema, *topic));
            put_definition(McapOpcode::channel, summary_.channels, id,
                           mcap_channel(id, schema, *topic));
            return;
        }
        if (const auto known = schemas_.find(channel.schema); known != schemas_.end())
            put_schema(known->first, known->second);
        put_definition(McapOpcode::channel, summary_.channels, id, std::string(content));
    }

    void put_schema(std::uint16_t id, const std::string& content) {
        put_definition(McapOpcode::schema, summary_.schemas, id, content);
    }

    void put_definition(McapOpcode opcode, std::map<std::uint16_t, std::string>& known,
                        std::uint16_t id, const std::string& content) {
        known.insert_or_assign(id, content);
        put_record(records_, opcode, content);
    }

    Expected<bool> take_message(const McapRecord& record, SummaryChunk& one) {
        const auto message = parse_message(record.content);
        if (!message) return from_.damaged(record.offset, "a message is too short");
        const auto channel = channels_.find(message->channel);
        if (channel == channels_.end())
            return from_.damaged(record.offset, "a message of an undeclared channel");
        const std::uint64_t place = records_.size();
        const auto changed = settings_.change(channel->second, *message);
        if (changed && changed->dropped) return true;
        const std::uint64_t log_time = changed ? changed->log_time : message->log_time;
        if (changed) {
            std::string content;
            put(content, message->channel);
            put(content, message->sequence);
            put(content, changed->log_time);
            put(content, changed->publish_time);
            content += changed->data;
            put_record(records_, McapOpcode::message, content);
        } else {
            put_record(records_, McapOpcode::message, as_text(record.content));
        }
        if (places_.empty()) one.start_time = log_time;
        one.start_time = std::min(one.start_time, log_time);
        one.end_time = std::max(one.end_time, log_time);
        if (summary_.messages.empty()) summary_.start_time = log_time;
        summary_.start_time = std::min(summary_.start_time, log_time);
        summary_.end_time = std::max(summary_.end_time, log_time);
        ++summary_.messages[message->channel];
        places_[message->channel].push_back({log_time, place});
        return true;
    }

    Expected<> append(std::string_view text) {
        at_ += text.size();
        return to_.write(text);
    }

    const McapReader& from_;
    WholeFile to_;
    std::string path_;
    const McapCopySettings& settings_;
    McapBuffer buffer_;
    std::uint64_t at_ = 0;
    std::string records_;
    std::map<std::uint16_t, McapChannel> channels_;
    std::map<std::uint16_t, std::string> schemas_;      ///< of the old file
    std::map<std::uint16_t, std::uint16_t> converted_;  ///< of each converted channel its schema
    std::map<std::uint16_t, std::vector<MessagePlace>> places_;
    McapSummary summary_;
};

}  // namespace

Expected<> copy_mcap(const McapReader& from, const std::string& path,
                     const McapCopySettings& settings) {
    std::error_code error;
    if (std::filesystem::exists(path, error)) return not_written(path, EEXIST);
    auto file = WholeFile::create(path);
    if (!file) return Unexpected(file.error());
    return Copy(from, std::move(*file), path, settings).run();
}

}  // namespace versavis::client
