// SPDX-License-Identifier: BSD-3-Clause
#include "export/csv_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/shallow_json.hpp"
#include "clock/clock_json.hpp"
#include "engine/clock/recording.hpp"
#include "engine/pairing/recording.hpp"
#include "export/metadata_csv.hpp"
#include "pairing/evidence_json.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// Items between two looks at the progress line.
constexpr std::uint64_t progress_step = 4096;

/// As `versavis tail --json` prints it, so that `versavis pair replay` reads it.
std::string json_line(const RecordedItem& item) {
    json line{{"number", item.number}, {"time_ns", item.time.ns}};
    if (item.kind == ring::StreamKind::evidence) {
        const auto input = pairing::from_metadata(unpack<pairing::EvidenceMetadata>(item.metadata));
        line.update(input ? to_json(*input) : json{{"evidence", "unknown"}});
    } else if (item.kind == ring::StreamKind::clock) {
        const auto input = clock::from_metadata(unpack<clock::ClockMetadata>(item.metadata));
        line.update(input ? to_json(*input) : json{{"clock", "unknown"}});
    } else {
        line["status"] = parse_shallow_json(
            {reinterpret_cast<const char*>(item.payload.data()), item.payload.size()});
        if (line["status"].is_discarded()) line["status"] = nullptr;
    }
    return line.dump(-1, ' ', false, json::error_handler_t::replace);
}

struct Output {
    NewFile file;
    std::string name;
    bool rows;  ///< else lines of JSON
    std::uint64_t count = 0;
};

Expected<std::map<std::string, Output>> open_files(const Recording& recording,
                                                   const std::vector<std::string>& streams,
                                                   const std::filesystem::path& directory) {
    std::map<std::string, Output> outputs;
    for (const auto& stream : recording.streams()) {
        if (!streams.empty() &&
            std::find(streams.begin(), streams.end(), stream.name) == streams.end())
            continue;
        const std::string columns = csv_columns(stream.kind);
        const std::string name = stream.name + (columns.empty() ? ".jsonl" : ".csv");
        auto file = NewFile::create(directory / name);
        if (!file) return Unexpected(file.error());
        if (!columns.empty()) file->write(columns + "\n");
        outputs.emplace(stream.name, Output{std::move(*file), name, !columns.empty()});
    }
    for (const auto& stream : streams)
        if (outputs.count(stream) == 0)
            return failure(stream, "is not in the recording", "see 'versavis info'");
    return outputs;
}

Expected<> write_gaps(const Recording& recording, const std::filesystem::path& directory) {
    const auto gaps = recording.gaps();
    if (!gaps) return Unexpected(gaps.error());
    std::string text = "stream,time_ns,reason,items\n";
    for (const auto& gap : *gaps)
        text += fmt::format("{},{},{},{}\n", gap.stream, gap.time.ns, gap.reason, gap.items);
    return write_new_file(directory / "gaps.csv", text);
}

}  // namespace

Expected<std::vector<std::string>> export_csv(const Recording& recording,
                                              const std::vector<std::string>& streams,
                                              const std::filesystem::path& directory,
                                              const ExportWatch& watch) {
    auto outputs = open_files(recording, streams, directory);
    if (!outputs) return Unexpected(outputs.error());
    std::uint64_t all = 0;
    for (const auto& stream : recording.streams()) all += stream.items;
    std::uint64_t done = 0;
    auto read = recording.glance(streams, [&](const RecordedItem& item) {
        Output& output = outputs->at(item.stream);
        output.file.write((output.rows ? csv_row(item) : json_line(item)) + "\n");
        ++output.count;
        if (++done % progress_step == 0) watch.show("items", done, all);
        return !watch.stopped();
    });
    if (!read) return Unexpected(read.error());
    if (watch.stopped()) return stopped_error();
    std::vector<std::string> written;
    for (auto& [stream, output] : *outputs) {
        if (auto closed = output.file.close(); !closed) return Unexpected(closed.error());
        written.push_back(
            fmt::format("{}: {} {}", output.name, output.count, output.rows ? "rows" : "lines"));
    }
    if (auto gaps = write_gaps(recording, directory); !gaps) return Unexpected(gaps.error());
    return written;
}

}  // namespace versavis::client
