// SPDX-License-Identifier: BSD-3-Clause
#include "posix/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <filesystem>
#include <system_error>

namespace versavis {

namespace {

const char* cure_of(int error) {
    switch (error) {
        case EEXIST: return "name another file, or move it away; none is overwritten";
        case ENOSPC:
        case EDQUOT:
        case EFBIG: return "free some of the disk, or write to another one";
        case EACCES:
        case EPERM:
        case EROFS: return "write where you may, or get the permission to write there";
        case ENOENT:
        case ENOTDIR: return "make its directory first";
        default: return "is the disk there and well?";
    }
}

bool is_special(const std::string& path) {
    struct stat found {};
    return ::stat(path.c_str(), &found) == 0 && !S_ISREG(found.st_mode);
}

}  // namespace

Unexpected<> not_written(const std::string& path, int error) {
    return failure(path, "cannot be written: " + std::generic_category().message(error),
                   cure_of(error));
}

Expected<FileDescriptor> create_file(const std::string& path, int access) {
    FileDescriptor file(::open(path.c_str(), O_CREAT | O_EXCL | O_CLOEXEC | access, 0644));
    if (!file) return not_written(path);
    return file;
}

Expected<> write_all(const FileDescriptor& file, const std::string& path, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(file.get(), bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return not_written(path);
        bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    return {};
}

Expected<> sync_file(const FileDescriptor& file, const std::string& path) {
    if (::fsync(file.get()) != 0) return not_written(path);
    return {};
}

Expected<NewFile> NewFile::create(const std::string& path) {
    std::FILE* stream = std::fopen(path.c_str(), "wxe");
    if (stream == nullptr) return not_written(path);
    return NewFile(path, stream);
}

Expected<> NewFile::close() {
    const bool failed = std::ferror(stream()) != 0;
    if (std::fclose(stream_.release()) != 0 || failed) return not_written(path_);
    return {};
}

Expected<> write_new_file(const std::string& path, std::string_view text) {
    auto file = NewFile::create(path);
    if (!file) return Unexpected(file.error());
    file->write(text);
    return file->close();
}

Expected<WholeFile> WholeFile::create(const std::string& path, mode_t mode) {
    const bool special = is_special(path);
    const std::string part = special ? path : path + "." + std::to_string(::getpid()) + ".part";
    if (!special) ::unlink(part.c_str());  // left by a process that had the same number
    const int how = special ? 0 : O_CREAT | O_EXCL;
    FileDescriptor file(::open(part.c_str(), how | O_WRONLY | O_CLOEXEC, mode));
    if (!file) return not_written(path);
    return WholeFile(path, part, std::move(file));
}

WholeFile::~WholeFile() {
    if (file_ && part_ != path_) ::unlink(part_.c_str());
}

Expected<> WholeFile::finish() {
    if (part_ != path_) {
        if (auto synced = sync_file(file_, path_); !synced) return synced;
        if (std::rename(part_.c_str(), path_.c_str()) != 0) return not_written(path_);
        // So that the name, too, outlives a machine that loses power; not every file system can.
        const auto folder = std::filesystem::path(path_).parent_path();
        const FileDescriptor directory(
            ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
        ::fsync(directory.get());
    }
    file_ = {};
    return {};
}

Expected<> write_whole_file(const std::string& path, std::string_view text, mode_t mode) {
    auto file = WholeFile::create(path, mode);
    if (!file) return Unexpected(file.error());
    if (auto written = file->write(text); !written) return written;
    return file->finish();
}

}  // namespace versavis
