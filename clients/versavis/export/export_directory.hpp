// SPDX-License-Identifier: BSD-3-Clause
// The directory of an export: it appears under its name when it is complete, and not before.
#pragma once

#include <filesystem>

#include "versavis/error.hpp"

namespace versavis::client {

class ExportDirectory {
 public:
    /// Makes `path`.part to write into. Errors: `path` is there and not empty, `path`.part is left
    /// from an export that was killed, no permission.
    static Expected<ExportDirectory> create(const std::filesystem::path& path);

    ExportDirectory(ExportDirectory&& other) noexcept;
    ExportDirectory& operator=(ExportDirectory&&) = delete;
    ~ExportDirectory();  ///< removes what was written, unless it was finished

    const std::filesystem::path& part() const { return part_; }

    Expected<> finish();

 private:
    explicit ExportDirectory(std::filesystem::path path);

    std::filesystem::path path_;
    std::filesystem::path part_;
};

}  // namespace versavis::client
