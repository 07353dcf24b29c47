// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/host_files.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <system_error>

namespace versavis::client {

std::optional<std::int64_t> number_in(const std::string& text) {
    std::int64_t value = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
    return read.ec == std::errc{} ? std::optional(value) : std::nullopt;
}

std::filesystem::path HostFiles::path(const std::string& absolute) const {
    return root_ / std::filesystem::path(absolute).relative_path();
}

std::optional<std::string> HostFiles::text(const std::string& absolute) const {
    std::ifstream file(path(absolute));
    if (!file) return std::nullopt;
    std::string text{std::istreambuf_iterator<char>(file), {}};
    if (file.bad()) return std::nullopt;  // some files of /sys open, and refuse to be read
    return text.substr(0, text.find_last_not_of(" \t\n") + 1);
}

std::optional<std::int64_t> HostFiles::number(const std::string& absolute) const {
    const auto found = text(absolute);
    return found ? number_in(*found) : std::nullopt;
}

std::vector<std::string> HostFiles::list(const std::string& absolute) const {
    std::error_code error;
    std::vector<std::string> names;
    // Processes end while their folders are read.
    std::filesystem::directory_iterator entry(path(absolute), error);
    for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error))
        names.push_back(entry->path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
}

bool HostFiles::exists(const std::string& absolute) const {
    std::error_code error;
    return std::filesystem::exists(path(absolute), error);
}

std::vector<int> HostFiles::processes(const std::string& name) const {
    std::vector<int> found;
    for (const std::string& entry : list("/proc")) {
        int pid = 0;
        const char* end = entry.data() + entry.size();
        if (std::from_chars(entry.data(), end, pid).ptr != end || pid <= 0) continue;
        if (text("/proc/" + entry + "/comm") == name.substr(0, 15)) found.push_back(pid);
    }
    return found;
}

}  // namespace versavis::client
