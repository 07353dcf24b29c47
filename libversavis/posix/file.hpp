// SPDX-License-Identifier: BSD-3-Clause
// How files are written: new ones, which take no other's place, and whole ones, which are there
// completely or not at all. Each error names the path, the cause and the cure.
#pragma once

#include <sys/types.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"

namespace versavis {

/// Why `path` is not written, by errno.
Unexpected<> not_written(const std::string& path, int error = errno);

/// Error: it exists, or cannot be created.
Expected<FileDescriptor> create_file(const std::string& path, int access);

Expected<> write_all(const FileDescriptor& file, const std::string& path, std::string_view bytes);

/// Returns when what was written is on the disk.
Expected<> sync_file(const FileDescriptor& file, const std::string& path);

/// A new file, written in small pieces. What the disk refuses is reported by close().
class NewFile {
 public:
    static Expected<NewFile> create(const std::string& path);

    void write(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stream()); }
    std::FILE* stream() const { return stream_.get(); }
    Expected<> close();

 private:
    struct Close {
        void operator()(std::FILE* stream) const { std::fclose(stream); }
    };
    NewFile(std::string path, std::FILE* stream) : path_(std::move(path)), stream_(stream) {}

    std::string path_;
    std::unique_ptr<std::FILE, Close> stream_;
};

/// A new file of this content.
Expected<> write_new_file(const std::string& path, std::string_view text);

/// Written beside `path`; takes its name, and the place of a file that has it, when it is complete
/// and on the disk. Devices and pipes are written as they are.
class WholeFile {
 public:
    static Expected<WholeFile> create(const std::string& path, mode_t mode = 0644);
    WholeFile(WholeFile&& other) noexcept = default;
    ~WholeFile();  ///< without finish(), nothing is left of it

    Expected<> write(std::string_view bytes) { return write_all(file_, path_, bytes); }
    Expected<> finish();

 private:
    WholeFile(std::string path, std::string part, FileDescriptor file)
        : path_(std::move(path)), part_(std::move(part)), file_(std::move(file)) {}

    std::string path_;
    std::string part_;     ///< its name until it is whole
    FileDescriptor file_;  ///< none when it is finished or moved away
};

Expected<> write_whole_file(const std::string& path, std::string_view text, mode_t mode = 0644);

}  // namespace versavis
