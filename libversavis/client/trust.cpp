// SPDX-License-Identifier: BSD-3-Clause
#include "client/trust.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "client/error_code.hpp"
#include "client/sealed.hpp"

namespace versavis::ring {

namespace {

constexpr auto service_user = "versavis";

/// Users of containers often have no name. No name consists of digits alone.
std::optional<std::uint32_t> number_in(std::string_view text) {
    std::uint32_t number{};
    const char* end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, number);
    return error == std::errc{} && rest == end ? std::optional(number) : std::nullopt;
}

std::optional<std::uint32_t> user_id(const char* name) {
    if (std::string_view(name).find_first_not_of("0123456789") == std::string_view::npos)
        return number_in(name);
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, 4096> text{};
    if (::getpwnam_r(name, &entry, text.data(), text.size(), &found) != 0 || found == nullptr)
        return std::nullopt;
    return found->pw_uid;
}

/// The kernel's name for users whom a user namespace does not map.
constexpr std::uint32_t unmapped_user = 65534;

/// True where all users are mapped, each to itself. A namespace whose map is not written yet, and
/// is empty, maps nobody.
bool maps_all_users() {
    std::ifstream map("/proc/self/uid_map");
    if (!map.is_open()) return true;
    std::uint64_t inside{};
    std::uint64_t outside{};
    std::uint64_t count{};
    return map >> inside >> outside >> count && inside == 0 && outside == 0 && count == UINT32_MAX;
}

Unexpected<> not_trusted(const std::filesystem::path& path, std::uint32_t user,
                         std::optional<std::uint32_t> owner) {
    if (user == unmapped_user && !maps_all_users())
        return failure(ErrorCode::not_trusted, path.string(),
                       "belongs to a user that this container does not map",
                       "map the service's user in it; or, if all users outside are trusted, set "
                       "VERSAVIS_OWNER=" +
                           std::to_string(unmapped_user));
    return failure(ErrorCode::not_trusted, path.string(),
                   "belongs to user " + std::to_string(user) +
                       (owner ? ", not to user " + std::to_string(*owner)
                              : ", who is neither root, nor you, nor 'versavis'"),
                   "if the service runs as that user, give its name or number in VERSAVIS_OWNER, "
                   "or as owner");
}

Unexpected<> not_opened(const std::filesystem::path& path) {
    if (errno == EACCES)
        return failure(ErrorCode::forbidden, path.string(), "permission denied",
                       "join the group that may read streams (usually 'versavis')");
    if (errno == ELOOP)
        return failure(ErrorCode::not_trusted, path.string(), "is a link, not a stream",
                       "remove it");
    if (errno == ENOENT || errno == ENOTDIR)
        return failure(ErrorCode::absent, path.string(), "no such stream",
                       "is the service running? 'versavis list' shows the streams");
    return failure(
        code_of(errno), path.string(),
        "cannot be opened: " + std::error_code(errno, std::generic_category()).message());
}

}  // namespace

bool may_own(std::uint32_t user, std::optional<std::uint32_t> named) {
    if (named) return user == *named;
    const char* name = std::getenv("VERSAVIS_OWNER");
    if (name != nullptr && *name != '\0') return user_id(name) == user;
    // An unmapped user may be anybody, also where this process itself is not mapped.
    if (user == unmapped_user && !maps_all_users()) return false;
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
        return failure(ErrorCode::not_trusted, path.string(),
                       "does not belong to the owner of its directory",
                       "somebody else may have put it there: remove it");
    if (!may_own(of_file.st_uid, owner)) return not_trusted(path, of_file.st_uid, owner);
    const FileId id{of_file.st_dev, of_file.st_ino};
    if (!sealed) return NamedFile{std::move(file), id};
    auto segment = fetch_sealed(file.get(), path, of_file.st_uid);
    if (!segment) return Unexpected(segment.error());
    return NamedFile{std::move(*segment), id};
}

}  // namespace versavis::ring
