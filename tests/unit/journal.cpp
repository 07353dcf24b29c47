// SPDX-License-Identifier: BSD-3-Clause
#include "posix/journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "posix/file_descriptor.hpp"

using namespace versavis;

TEST_CASE("journal: only the stream that systemd names is it") {
    const test::TemporaryDirectory directory;
    const auto open = [&](const char* name) {
        return FileDescriptor(::open(directory.write(name, "").c_str(), O_WRONLY | O_CLOEXEC));
    };
    const FileDescriptor stream = open("stream");
    const FileDescriptor other = open("other");
    struct stat file {};
    REQUIRE(::fstat(stream.get(), &file) == 0);
    ::setenv("JOURNAL_STREAM", fmt::format("{}:{}", file.st_dev, file.st_ino).c_str(), 1);
    CHECK(is_journal(stream.get()));
    CHECK_FALSE(is_journal(other.get()));
    CHECK_FALSE(is_journal(-1));
    ::unsetenv("JOURNAL_STREAM");
    CHECK_FALSE(is_journal(stream.get()));
}
