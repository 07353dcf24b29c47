// SPDX-License-Identifier: BSD-3-Clause
#include "client/trust.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <string>

namespace versavis::ring {

namespace {

constexpr auto service_user = "versavis";

std::optional<std::uint32_t> user_id(const char* name) {
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, 4096> text{};
    if (::getpwnam_r(name, &entry, text.data(), text.size(), &found) != 0 || found == nullptr)
        return std::nullopt;
    return found->pw_uid;
}

bool may_own(std::uint32_t user, std::optional<std::uint32_t> named) {
    if (named) return user == *named;
    const char* name = std::getenv("VERSAVIS_OWNER");
    if (name != nullptr && *name != '\0') return user_id(name) == user;
    return user == 0 || user == ::geteuid() || user == user_id(service_user);
}

Unexpected<> not_opened(const std::filesystem::path& path) {
    if (errno == EACCES)
        return failure(path.string(), "permission denied",
                       "join the group that may read streams (usually 'versavis')");
    if (errno == ELOOP) return failure(path.string(), "is a link, not a stream", "remove it");
    return failure(path.string(), "no such stream",
                   "is the service running? 'versavis list' shows the streams");
}

}  // namespace

Expected<File> open_trusted(const std::filesystem::path& path, std::optional<std::uint32_t> owner) {
    const auto parent = path.parent_path();
    const File directory(::open(parent.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (!directory) return not_opened(path);
    File file(::openat(directory.descriptor(), path.filename().c_str(),
                       O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (!file) return not_opened(path);
    struct stat of_file {};
    struct stat of_directory {};
    if (::fstat(file.descriptor(), &of_file) != 0 ||
        ::fstat(directory.descriptor(), &of_directory) != 0)
        return not_opened(path);
    if (of_file.st_uid != of_directory.st_uid || (of_directory.st_mode & S_IWOTH) != 0)
        return failure(path.string(), "does not belong to the owner of its directory",
                       "somebody else may have put it there: remove it");
    if (!may_own(of_file.st_uid, owner))
        return failure(path.string(),
                       "belongs to user " + std::to_string(of_file.st_uid) +
                           ", who is neither root, nor you, nor 'versavis'",
                       "if the service runs as that user, name it in VERSAVIS_OWNER");
    return file;
}

}  // namespace versavis::ring
