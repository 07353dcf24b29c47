// SPDX-License-Identifier: BSD-3-Clause
#include "recording/repair.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "base/byte_cursor.hpp"
#include "posix/file.hpp"
#include "recording/mcap_reader.hpp"
#include "recording/mcap_record.hpp"
#include "recording/mcap_summary.hpp"
#include "recording/salvage.hpp"

namespace versavis::client {

namespace {

/// What is copied at a time. More would not be faster.
constexpr std::size_t copy_size = 1 << 20U;

std::string reason_of(int error) { return std::generic_category().message(error); }

/// Reads what the file holds once more, and says what its end must be.
class Stock {
 public:
    Stock(const McapReader& reader, std::uint64_t end) : reader_(reader), end_(end) {}

    /// What lies before the end.
    Expected<> take() {
        for (const McapChunk& chunk : reader_.chunks()) {
            if (chunk.offset >= end_) break;
            if (auto taken = take_chunk(chunk); !taken) {
                if (chunk.compression.empty()) damaged_at_ = chunk.offset;
                return taken;
            }
        }
        return reader_.top_level([this](const McapRecord& record) { return place(record); });
    }

    /// After take() failed: the chunk that it failed by.
    std::optional<std::uint64_t> damaged_at() const { return damaged_at_; }

    /// What is kept of the old file ends here.
    std::uint64_t kept() const { return kept_; }

    /// What follows it.
    std::string end() const {
        return missing_indexes_ + mcap_end(summary_, kept_ + missing_indexes_.size());
    }

    /// After take(): the last chunk may be there without all its indexes.
    void complete() {
        kept_ = end_;
        if (summary_.chunks.empty()) return;
        SummaryChunk& last = summary_.chunks.back();
        if (last.indexes.size() == last_.size()) return;
        const std::uint64_t begin = last.offset + last.length;
        kept_ = begin;
        last.indexes.clear();
        for (const auto& [channel, messages] : last_) {
            last.indexes[channel] = begin + missing_indexes_.size();
            missing_indexes_ += message_index(channel, messages);
        }
        last.indexes_length = missing_indexes_.size();
    }

    std::uint64_t chunks() const { return summary_.chunks.size(); }

    std::uint64_t messages() const {
        std::uint64_t all = 0;
        for (const auto& [channel, count] : summary_.messages) all += count;
        return all;
    }

 private:
    Expected<> take_chunk(const McapChunk& chunk) {
        const auto records = reader_.load(chunk, buffer_);
        if (!records) return Unexpected(records.error());
        last_.clear();
        SummaryChunk one{};
        one.offset = chunk.offset;
        one.length = chunk.end() - chunk.offset;
        one.records_size = chunk.unpacked;
        one.packed_size = chunk.records_size;
        one.compression = chunk.compression;
        auto read = reader_.for_each(chunk, *records, [&](const McapRecord& record) {
            return take_record(chunk, record, one);
        });
        summary_.chunks.push_back(std::move(one));
        return read;
    }

    Expected<bool> take_record(const McapChunk& chunk, const McapRecord& record,
                               SummaryChunk& one) {
        ByteCursor cursor(record.content);
        const auto id = cursor.number<std::uint16_t>();
        if (!cursor.good()) return reader_.damaged(record.offset, "a record is too short");
        if (record.opcode == McapOpcode::schema)
            summary_.schemas.insert_or_assign(id, std::string(as_text(record.content)));
        if (record.opcode == McapOpcode::channel)
            summary_.channels.insert_or_assign(id, std::string(as_text(record.content)));
        if (record.opcode != McapOpcode::message) return true;
        const auto message = parse_message(record.content);
        if (!message) return reader_.damaged(record.offset, "a message is too short");
        if (summary_.channels.count(id) == 0)
            return reader_.damaged(record.offset, "a message of an undeclared channel");
        if (last_.empty()) one.start_time = message->log_time;
        one.start_time = std::min(one.start_time, message->log_time);
        one.end_time = std::max(one.end_time, message->log_time);
        if (summary_.messages.empty()) summary_.start_time = message->log_time;
        summary_.start_time = std::min(summary_.start_time, message->log_time);
        summary_.end_time = std::max(summary_.end_time, message->log_time);
        ++summary_.messages[id];
        last_[id].push_back({message->log_time, record.offset - chunk.records_offset});
        return true;
    }

    Expected<bool> place(const McapRecord& record) {
        if (record.offset >= end_ || record.opcode == McapOpcode::data_end) return false;
        ByteCursor cursor(record.content);
        if (record.opcode == McapOpcode::chunk) {
            current_ = chunk_at(record.offset);
            if (current_ != nullptr) take_times(cursor);
        } else if (record.opcode == McapOpcode::message_index) {
            if (current_ == nullptr) return true;
            current_->indexes[cursor.number<std::uint16_t>()] = record.offset;
            current_->indexes_length += record.end() - record.offset;
        } else if (record.opcode == McapOpcode::attachment) {
            const auto log = cursor.number<std::uint64_t>();
            const auto created = cursor.number<std::uint64_t>();
            const std::string name(cursor.text());
            const std::string type(cursor.text());
            summary_.attachments.push_back({record.offset, record.end() - record.offset, log,
                                            created, cursor.number<std::uint64_t>(), name, type});
        } else if (record.opcode == McapOpcode::metadata) {
            summary_.metadata.push_back(
                {record.offset, record.end() - record.offset, std::string(cursor.text())});
        }
        return true;
    }

    SummaryChunk* chunk_at(std::uint64_t offset) {
        const auto found = std::lower_bound(
            summary_.chunks.begin(), summary_.chunks.end(), offset,
            [](const SummaryChunk& one, std::uint64_t place) { return one.offset < place; });
        return found != summary_.chunks.end() && found->offset == offset ? &*found : nullptr;
    }

    /// The chunk's own words count.
    void take_times(ByteCursor& cursor) {
        current_->start_time = cursor.number<std::uint64_t>();
        current_->end_time = cursor.number<std::uint64_t>();
    }

    const McapReader& reader_;
    std::uint64_t end_;
    std::optional<std::uint64_t> damaged_at_;
    McapBuffer buffer_;
    McapSummary summary_;
    SummaryChunk* current_ = nullptr;  ///< the chunk whose message indexes follow
    std::map<std::uint16_t, std::vector<MessagePlace>> last_;
    std::uint64_t kept_ = 0;
    std::string missing_indexes_;
};

Expected<> copy(const McapReader& from, std::uint64_t begin, std::uint64_t end,
                const FileDescriptor& to, const std::string& path) {
    std::vector<std::byte> block(copy_size);
    for (std::uint64_t at = begin; at < end;) {
        const auto part = std::span(block).first(std::min<std::uint64_t>(copy_size, end - at));
        if (auto got = from.read(at, part); !got) return got;
        const auto* text = reinterpret_cast<const char*>(part.data());
        if (auto put = write_all(to, path, {text, part.size()}); !put) return put;
        at += part.size();
    }
    return sync_file(to, path);
}

/// Error: somebody else, the recorder most likely, holds the file.
Expected<FileDescriptor> lock(const std::string& path, bool in_place) {
    FileDescriptor file(::open(path.c_str(), (in_place ? O_RDWR : O_RDONLY) | O_CLOEXEC));
    if (!file)
        return failure(
            path,
            std::string(in_place ? "cannot be written: " : "cannot be read: ") + reason_of(errno),
            in_place ? "repair it into a new file with -o" : "");
    if (::flock(file.get(), (in_place ? LOCK_EX : LOCK_SH) | LOCK_NB) != 0)
        return failure(path, "is being written by another process",
                       "stop the recorder, then check whether the file is complete");
    return file;
}

Error not_moved(const std::string& path) {
    return {path, "cannot be renamed: " + reason_of(errno), "check the permissions of its folder"};
}

Expected<> append_end(const FileDescriptor& file, const std::string& path, const Stock& stock) {
    ::lseek(file.get(), static_cast<off_t>(stock.kept()), SEEK_SET);
    if (auto written = write_all(file, path, stock.end()); !written) {
        [[maybe_unused]] const int back = ::ftruncate(file.get(), static_cast<off_t>(stock.kept()));
        return written;
    }
    return sync_file(file, path);
}

Expected<> repair_in_place(const FileDescriptor& file, const McapReader& reader, const Stock& stock,
                           RepairReport& report) {
    if (report.cut_bytes > 0) {
        report.cut_file = reader.path() + ".cut";
        const auto cut = create_file(report.cut_file, O_WRONLY);
        if (!cut) return Unexpected(cut.error());
        if (auto kept = copy(reader, stock.kept(), reader.size(), *cut, report.cut_file); !kept) {
            ::unlink(report.cut_file.c_str());
            return kept;
        }
    }
    if (::ftruncate(file.get(), static_cast<off_t>(stock.kept())) != 0)
        return not_written(reader.path());
    return append_end(file, reader.path(), stock);
}

Expected<> repair_into(const std::string& output, const McapReader& reader, const Stock& stock) {
    const auto file = create_file(output, O_WRONLY);
    if (!file) return Unexpected(file.error());
    auto written = copy(reader, 0, stock.kept(), *file, output);
    if (written) written = append_end(*file, output, stock);
    if (!written) ::unlink(output.c_str());
    return written;
}

/// Of a file with a summary: whether it can be read without that, from record to record.
bool is_one_chain(const McapReader& reader) {
    bool ends = false;
    const auto walked = reader.top_level([&](const McapRecord& record) -> Expected<bool> {
        if (record.opcode != McapOpcode::footer) return true;
        ends = record.end() + mcap_magic.size() == reader.size();
        return false;
    });
    return walked && ends;
}

/// All that can be read, into a new file.
Expected<RepairReport> save(const McapReader& reader, const std::string& output,
                            RepairReport report) {
    const std::string& path = reader.path();
    report.old_file = output.empty() ? path + ".damaged" : "";
    std::error_code error;
    if (output.empty() && std::filesystem::exists(report.old_file, error))
        return not_written(report.old_file, EEXIST);
    const std::string made = output.empty() ? path + ".repaired" : output;
    auto saved = salvage(reader, made);
    if (!saved) return Unexpected(saved.error());
    report.was_whole = false;
    report.chunks = saved->chunks;
    report.messages = saved->messages;
    report.left_out = std::move(saved->left_out);
    if (report.defect.empty()) report.defect = "it is damaged";
    if (!output.empty()) return report;
    if (std::rename(path.c_str(), report.old_file.c_str()) != 0) return Unexpected(not_moved(path));
    if (std::rename(made.c_str(), path.c_str()) != 0) return Unexpected(not_moved(made));
    return report;
}

}  // namespace

Expected<RepairReport> repair(const std::string& path, const std::string& output, bool cut) {
    const auto file = lock(path, output.empty());
    if (!file) return Unexpected(file.error());
    const auto reader = McapReader::open(path);
    if (!reader) return Unexpected(reader.error());
    RepairReport report;
    report.file = output.empty() ? path : output;
    report.defect = reader->defect();
    report.chunks = reader->chunks().size();
    report.was_whole = report.defect.empty() && reader->damages().empty();
    const bool in_place = reader->damages().empty() && reader->loose().empty() &&
                          (!report.was_whole || is_one_chain(*reader));
    if (!in_place && !cut) return save(*reader, output, std::move(report));
    std::optional<Stock> stock(std::in_place, *reader, reader->good_end());
    if (auto taken = stock->take(); !taken) {
        auto end = stock->damaged_at();
        if (!cut) return save(*reader, output, std::move(report));
        for (const McapDamage& one : reader->damages())
            end = std::min(end.value_or(one.offset), one.offset);
        if (!end) return Unexpected(taken.error());
        report.defect += (report.defect.empty() ? "" : ", and ") + taken.error().what;
        report.was_whole = false;
        stock.emplace(*reader, *end);
        if (auto again = stock->take(); !again) return Unexpected(again.error());
    }
    if (report.was_whole) {
        report.file = path;
        return report;
    }
    stock->complete();
    report.chunks = stock->chunks();
    report.messages = stock->messages();
    report.cut_bytes = reader->size() - stock->kept();
    auto repaired = output.empty() ? repair_in_place(*file, *reader, *stock, report)
                                   : repair_into(output, *reader, *stock);
    if (!repaired) return Unexpected(repaired.error());
    return report;
}

std::string to_text(const RepairReport& report, bool json) {
    if (json)
        return nlohmann::json{{"file", report.file},         {"was_whole", report.was_whole},
                              {"defect", report.defect},     {"chunks", report.chunks},
                              {"messages", report.messages}, {"cut_bytes", report.cut_bytes},
                              {"cut_file", report.cut_file}, {"left_out", report.left_out},
                              {"old_file", report.old_file}}
                   .dump() +
               "\n";
    if (report.was_whole) return fmt::format("{}: is complete, nothing was changed\n", report.file);
    std::string text = fmt::format("{}: {}; it is complete now, with {} messages in {} chunks\n",
                                   report.file, report.defect, report.messages, report.chunks);
    for (const std::string& one : report.left_out) text += "left out: " + one + "\n";
    if (!report.old_file.empty())
        text += fmt::format("the file as it was is {}\n", report.old_file);
    if (!report.cut_file.empty())
        text +=
            fmt::format("the {} bytes after that are in {}\n", report.cut_bytes, report.cut_file);
    else if (report.cut_bytes > 0)
        text += fmt::format("the {} bytes after that are left out\n", report.cut_bytes);
    return text;
}

}  // namespace versavis::client
