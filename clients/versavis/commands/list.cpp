// SPDX-License-Identifier: BSD-3-Clause
#include "list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "recording/kind_name.hpp"
#include "versavis/ring_path.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::client {

namespace {

/// Whatever bytes a name has.
std::string as_text(const nlohmann::json& document) {
    return document.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
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
        if (!reader) {  // it may just have ended, or not be one: the others are listed all the same
            document.push_back(
                {{"name", path.filename().string()}, {"error", reader.error().message()}});
            text += fmt::format("{:<12} {}\n", path.filename().string(), reader.error().message());
            continue;
        }
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
    return as_json ? as_text(document) + "\n" : text;
}

}  // namespace versavis::client
