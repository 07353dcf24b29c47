// SPDX-License-Identifier: BSD-3-Clause
#include "export/export_directory.hpp"

#include <system_error>
#include <utility>

namespace versavis::client {

namespace fs = std::filesystem;

ExportDirectory::ExportDirectory(fs::path path) : path_(std::move(path)), part_(path_) {
    part_ += ".part";
}

ExportDirectory::ExportDirectory(ExportDirectory&& other) noexcept
    : path_(std::move(other.path_)), part_(std::exchange(other.part_, {})) {}

ExportDirectory::~ExportDirectory() {
    std::error_code ignored;
    if (!part_.empty()) fs::remove_all(part_, ignored);
}

Expected<ExportDirectory> ExportDirectory::create(const fs::path& path) {
    std::error_code error;
    fs::path plain = path.lexically_normal();
    if (!plain.has_filename()) plain = plain.parent_path();  // "there/"
    if (fs::exists(plain, error) && !(fs::is_directory(plain, error) && fs::is_empty(plain, error)))
        return failure(path.string(), "exists, and is not an empty directory",
                       "name another, or remove it");
    ExportDirectory directory(plain);
    const fs::path part = directory.part_;
    if (fs::exists(part, error)) {
        directory.part_.clear();  // it is not ours
        return failure(part.string(), "belongs to an export that did not finish, or is running",
                       "remove it");
    }
    if (!fs::create_directories(part, error)) {
        directory.part_.clear();
        return failure(part.string(), "cannot be created: " + error.message());
    }
    return directory;
}

Expected<> ExportDirectory::finish() {
    std::error_code error;
    fs::rename(part_, path_, error);
    if (error) return failure(path_.string(), "cannot be renamed: " + error.message());
    part_.clear();
    return {};
}

}  // namespace versavis::client
