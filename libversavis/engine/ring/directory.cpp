// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/directory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <system_error>
#include <utility>

#include "client/process.hpp"
#include "client/segment.hpp"
#include "client/trust.hpp"
#include "engine/ring/foreign_segments.hpp"
#include "engine/ring/segment_lifecycle.hpp"

namespace versavis::ring {

namespace {

// A reader could lock a segment through its read-only descriptor; only the owner can open this
// file.
constexpr auto lock_name = ".lock";

std::string errno_text() { return std::generic_category().message(errno); }

/// The directory itself: no link to another one is followed.
Expected<FileDescriptor> open_directory(const std::filesystem::path& path) {
    FileDescriptor directory(::open(path.c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (directory) return directory;
    if (errno == ENOTDIR || errno == ELOOP)
        return failure(path.string(), "is not a directory", "remove it");
    return failure(path.string(), fmt::format("cannot be opened: {}", errno_text()),
                   "run the service as the user that owns it");
}

/// Nobody else can put a ring there or take one away, from there or with the whole directory.
Expected<> check_trust(const FileDescriptor& opened, const std::filesystem::path& path) {
    struct stat directory {};
    struct stat parent {};
    ::fstat(opened.get(), &directory);
    if (directory.st_uid != ::geteuid())
        return failure(path.string(),
                       fmt::format("belongs to another user (uid {})", directory.st_uid),
                       "remove it, or run the service as that user");
    if ((directory.st_mode & (S_IWGRP | S_IWOTH)) != 0)
        return failure(path.string(), "can be written by others",
                       fmt::format("remove it, or 'chmod 0750 {}'", path.string()));
    const auto above = path.parent_path();
    ::stat(above.c_str(), &parent);  // it is there: `path` was found in it
    // Root and this user may always write, whatever VERSAVIS_OWNER says.
    if (parent.st_uid != 0 && parent.st_uid != ::geteuid() && !may_own(parent.st_uid, std::nullopt))
        return failure(above.string(),
                       fmt::format("belongs to another user (uid {}), who could put another "
                                   "directory in its place",
                                   parent.st_uid),
                       "remove it, or 'chown root' it");
    if ((parent.st_mode & S_IWOTH) != 0 && (parent.st_mode & S_ISVTX) == 0)
        return failure(above.string(), "can be written by everybody",
                       fmt::format("'chmod 0755 {}'", above.string()));
    return {};
}

/// Errors: it is no segment, or a sealed one whose process has ended.
Expected<Mapping> open_segment(const std::filesystem::path& path) {
    const auto file = open_trusted(path, ::geteuid());
    if (!file) return Unexpected(file.error());
    return Mapping::open(*file, path, Mapping::Access::read_only);
}

/// Another process that writes a ring there; 0: none. It is found even when somebody has removed
/// the file that it locked.
std::uint32_t living_writer(const std::filesystem::path& directory) {
    for (const ForeignSegment& segment : foreign_segments(directory, open_segment))
        if (segment.alive) return segment.mapping.constants().writer_pid;
    return 0;
}

/// The file that is locked. It is made if needed; whatever else has its name is refused, so that
/// neither a link nor another user's file is written to.
Expected<FileDescriptor> open_lock(const FileDescriptor& directory,
                                   const std::filesystem::path& path) {
    const auto file = (path / lock_name).string();
    FileDescriptor lock(::openat(directory.get(), lock_name,
                                 O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600));
    struct stat found {};
    if (!lock && errno == ELOOP)
        return failure(file, "is a link, not the lock of a service", "remove it");
    if (!lock || ::fstat(lock.get(), &found) != 0)
        return failure(file, fmt::format("cannot be opened: {}", errno_text()),
                       "remove it, or run the service as the user that owns it");
    if (!S_ISREG(found.st_mode))
        return failure(file, "is not a file, as the lock of a service is", "remove it");
    if (found.st_uid != ::geteuid())
        return failure(file, fmt::format("belongs to another user (uid {})", found.st_uid),
                       "remove it, or run the service as that user");
    return lock;
}

Unexpected<Error> served(const std::filesystem::path& path, std::uint32_t process) {
    const std::string name = process == 0 ? "" : fmt::format(" (process {})", process);
    return failure(path.string(), "another versavisd serves this instance" + name,
                   "stop it, or choose another name for 'instance'");
}

}  // namespace

Expected<OwnedDirectory> OwnedDirectory::claim(const std::filesystem::path& path) {
    std::error_code error;
    const auto parent = path.parent_path();
    if (std::filesystem::create_directories(parent, error)) ::chmod(parent.c_str(), 0755);
    if (!error && ::mkdir(path.c_str(), 0750) == 0)
        ::chmod(path.c_str(), 0750);  // whatever umask says
    else if (!error && errno != EEXIST)
        error = {errno, std::generic_category()};
    if (error)
        return failure(path.string(), fmt::format("cannot be created: {}", error.message()),
                       "run the service as the user that owns it");
    const auto directory = open_directory(path);
    if (!directory) return Unexpected(directory.error());
    if (auto trusted = check_trust(*directory, path); !trusted) return Unexpected(trusted.error());
    auto lock = open_lock(*directory, path);
    if (!lock) return Unexpected(lock.error());
    if (::flock(lock->get(), LOCK_EX | LOCK_NB) != 0) return served(path, living_writer(path));
    OwnedDirectory owned(path, std::move(*lock));
    if (const std::uint32_t process = living_writer(path); process != 0)
        return served(path, process);
    return owned;
}

void OwnedDirectory::remove_stale(const std::vector<std::string>& keep) const {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(path_, error)) {
        const std::string name = entry.path().filename();
        if (name == lock_name || std::find(keep.begin(), keep.end(), name) != keep.end()) continue;
        const auto found = open_segment(entry.path());
        if (found && is_own(found->constants())) continue;
        auto segment = Mapping::open(entry.path(), Mapping::Access::read_write);
        std::filesystem::remove(entry.path(), error);
        if (segment) end(segment->header());
    }
}

}  // namespace versavis::ring
