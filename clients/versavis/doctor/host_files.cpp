// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/host_files.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <system_error>

namespace versavis::client {

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
    std::int64_t value = 0;
    if (!found || found->empty() ||
        std::from_chars(found->data(), found->data() + found->size(), value).ec != std::errc{})
        return std::nullopt;
    return value;
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
