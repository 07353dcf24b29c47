// SPDX-License-Identifier: BSD-3-Clause
#include "export/text_file.hpp"

#include <cerrno>
#include <system_error>

namespace versavis::client {

namespace {

std::string reason() { return std::generic_category().message(errno); }

}  // namespace

Expected<TextFile> TextFile::create(const std::string& path) {
    std::FILE* file = std::fopen(path.c_str(), "wxe");
    if (file == nullptr) return failure(path, "cannot be created: " + reason());
    return TextFile(path, file);
}

void TextFile::write(std::string_view text) {
    std::fwrite(text.data(), 1, text.size(), file_.get());
}

Expected<> TextFile::close() {
    const bool failed = std::ferror(file_.get()) != 0;
    if (std::fclose(file_.release()) != 0 || failed)
        return failure(path_, "cannot be written: " + reason(), "is the disk full?");
    return {};
}

Expected<> write_text(const std::string& path, std::string_view text) {
    auto file = TextFile::create(path);
    if (!file) return Unexpected(file.error());
    file->write(text);
    return file->close();
}

}  // namespace versavis::client
