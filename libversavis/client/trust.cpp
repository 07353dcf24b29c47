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
#include <system_error>
#include <utility>

#include "client/sealed.hpp"

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

Unexpected<> not_opened(const std::filesystem::path& path) {
    if (errno == EACCES)
        return failure(path.string(), "permission denied",
                       "join the group that may read streams (usually 'versavis')");
    if (errno == ELOOP) return failure(path.string(), "is a link, not a stream", "remove it");
    if (errno == ENOENT || errno == ENOTDIR)
        return failure(path.string(), "no such stream",
                       "is the service running? 'versavis list' shows the streams");
    return failure(path.string(), "cannot be opened: " +
                                      std::error_code(errno, std::generic_category()).message());
}

}  // namespace

bool may_own(std::uint32_t user, std::optional<std::uint32_t> named) {
    if (named) return user == *named;
    const char* name = std::getenv("VERSAVIS_OWNER");
    if (name != nullptr && *name != '\0') return user_id(name) == user;
    return user == 0 || user == ::geteuid() || user == user_id(service_user);
}

Expected<NamedFile> open_trusted(const std::filesystem::path& path,
                                 std::optional<std::uint32_t> owner) {
    const auto parent = path.parent_path();
    const auto name = path.filename();
    constexpr int itself = O_NOFOLLOW | O_CLOEXEC;
    const FileDescriptor directory(::open(parent.c_str(), O_PATH | O_CLOEXEC));
    if (!directory) return not_opened(path);
    FileDescriptor file(::openat(directory.get(), name.c_str(), O_RDONLY | O_NONBLOCK | itself));
    const bool sealed = !file && errno == ENXIO;  // it is a socket
    if (sealed) file = FileDescriptor(::openat(directory.get(), name.c_str(), O_PATH | itself));
    if (!file) return not_opened(path);
    struct stat of_file {};
    struct stat of_directory {};
    if (::fstat(file.get(), &of_file) != 0 || ::fstat(directory.get(), &of_directory) != 0)
        return not_opened(path);
    if (of_file.st_uid != of_directory.st_uid || (of_directory.st_mode & S_IWOTH) != 0)
        return failure(path.string(), "does not belong to the owner of its directory",
                       "somebody else may have put it there: remove it");
    if (!may_own(of_file.st_uid, owner))
        return failure(path.string(),
                       "belongs to user " + std::to_string(of_file.st_uid) +
                           (owner ? ", not to user " + std::to_string(*owner)
                                  : ", who is neither root, nor you, nor 'versavis'"),
                       "if the service runs as that user, name it in VERSAVIS_OWNER, or as owner");
    const FileId id{of_file.st_dev, of_file.st_ino};
    if (!sealed) return NamedFile{std::move(file), id};
    auto segment = fetch_sealed(file.get(), path, of_file.st_uid);
    if (!segment) return Unexpected(segment.error());
    return NamedFile{std::move(*segment), id};
}

}  // namespace versavis::ring
