// SPDX-License-Identifier: BSD-3-Clause
// A text file that is written line by line; what the disk refuses is told at its end.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "versavis/error.hpp"

namespace versavis::client {

class TextFile {
 public:
    /// Error: cannot be created.
    static Expected<TextFile> create(const std::string& path);

    void write(std::string_view text);

    /// Error: not all of it could be written.
    Expected<> close();

 private:
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };

    TextFile(std::string path, std::FILE* file) : path_(std::move(path)), file_(file) {}

    std::string path_;
    std::unique_ptr<std::FILE, Close> file_;
};

/// A file of this content.
Expected<> write_text(const std::string& path, std::string_view text);

}  // namespace versavis::client
