// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/memory_budget.hpp"

#include <fmt/format.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

namespace versavis::ring {

namespace {

/// Memory that a ring leaves to everything else, this service's own included. If lower, a machine
/// that is nearly full starts, and the kernel kills other programs later; if higher, a small
/// computer is restricted to smaller rings than necessary.
constexpr std::uint64_t memory_left = 64 << 20U;

constexpr const char* cure = "lower 'slots' or 'history_s'";

/// None: the file has no such line.
std::optional<std::uint64_t> available_memory(const std::filesystem::path& memory) {
    std::ifstream file(memory);
    std::string name;
    std::uint64_t kib{};
    while (file >> name >> kib) {
        if (name == "MemAvailable:") return kib << 10U;
        file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
    }
    return std::nullopt;
}

Error too_large(const std::filesystem::path& ring, std::uint64_t size, std::uint64_t free,
                const std::string& where, const std::string& more) {
    return {ring.string(),
            fmt::format("needs {} MiB, and {} MiB are free {}", (size + (1 << 20U) - 1) >> 20U,
                        free >> 20U, where),
            fmt::format("{}, or {}", cure, more)};
}

}  // namespace

Expected<> check_memory(const std::filesystem::path& ring, std::uint64_t size,
                        const std::filesystem::path& memory) {
    const auto available = available_memory(memory);
    if (available && size > *available - std::min(*available, memory_left))
        return Unexpected(too_large(ring, size, *available,
                                    "in this machine's memory, of which some is left to others",
                                    "close other programs"));
    return {};
}

Expected<> check_tmpfs_space(const std::filesystem::path& ring, std::uint64_t size,
                             const std::filesystem::path& memory) {
    struct statvfs system {};
    const std::filesystem::path directory = ring.parent_path();
    if (::statvfs(directory.c_str(), &system) == 0) {
        const std::uint64_t free = std::uint64_t{system.f_bavail} * system.f_frsize;
        // A tmpfs without a limit counts no blocks at all.
        if (system.f_blocks != 0 && size > free)
            return Unexpected(too_large(ring, size, free, "in its file system",
                                        "enlarge it: mount -o remount,size=SIZE /dev/shm"));
    }
    return check_memory(ring, size, memory);
}

}  // namespace versavis::ring
