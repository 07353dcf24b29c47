// SPDX-License-Identifier: BSD-3-Clause
#include "stream/list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "versavis/ring/path.hpp"
#include "versavis/ring/reader.hpp"

namespace versavis::client {

namespace {

const char* kind_name(ring::StreamKind kind) {
    switch (kind) {
        case ring::StreamKind::frames: return "frames";
        case ring::StreamKind::imu: return "imu";
        case ring::StreamKind::events: return "events";
        case ring::StreamKind::status: return "status";
        case ring::StreamKind::evidence: return "evidence";
        case ring::StreamKind::clock: return "clock";
    }
    return "unknown";
}

}  // namespace

Expected<std::string> list_streams(const std::string& instance, bool as_json) {
    const auto directory = instance_directory(instance);
    std::error_code error;
    std::vector<std::filesystem::path> paths;
    for (const auto& entry : std::filesystem::directory_iterator(directory, error))
        if (entry.path().filename().string().front() != '.') paths.push_back(entry.path());
    if (error)
        return failure(directory.string(), error.message(),
                       "is versavisd running? --instance selects another instance");
    std::sort(paths.begin(), paths.end());
    nlohmann::json document = nlohmann::json::array();
    std::string text;
    for (const auto& path : paths) {
        auto reader = ring::Reader::open(path);
        if (!reader) return Unexpected(reader.error());
        const bool alive = reader->writer_alive();
        document.push_back({{"name", reader->name()},
                            {"kind", kind_name(reader->kind())},
                            {"items", reader->head()},
                            {"retained", reader->retained()},
                            {"alive", alive}});
        text += fmt::format("{:<12} {:<7} {:>10} items, {:>6} retained{}\n", reader->name(),
                            kind_name(reader->kind()), reader->head(), reader->retained(),
                            alive ? "" : ", writer gone");
    }
    return as_json ? document.dump() + "\n" : text;
}

}  // namespace versavis::client
