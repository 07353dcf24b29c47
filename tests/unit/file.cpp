// SPDX-License-Identifier: BSD-3-Clause
#include "posix/file.hpp"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "../support/in_process.hpp"
#include "../support/small_disk.hpp"
#include "../support/temporary_directory.hpp"

using namespace versavis;
using Catch::Contains;
using test::content_of;

namespace {

std::size_t files_in(const std::filesystem::path& directory) {
    using Entries = std::filesystem::directory_iterator;
    return static_cast<std::size_t>(std::distance(Entries(directory), Entries()));
}

}  // namespace

TEST_CASE("file: a new one takes no other's place") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "file";
    REQUIRE(write_new_file(path, "first"));
    const auto again = write_new_file(path, "second");
    REQUIRE_FALSE(again);
    CHECK_THAT(again.error().message(),
               Contains(path + ": cannot be written: File exists") && Contains("name another"));
    CHECK(content_of(path) == "first");
}

TEST_CASE("file: a whole one takes the place of the old one when it is finished") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write("file", "old");
    {
        auto file = WholeFile::create(path);
        REQUIRE(file);
        REQUIRE(file->write("half of the new one"));
    }
    CHECK(content_of(path) == "old");
    CHECK(files_in(directory.path()) == 1);
    REQUIRE(write_whole_file(path, "new"));
    CHECK(content_of(path) == "new");
    CHECK(files_in(directory.path()) == 1);
}

TEST_CASE("file: a device is written as it is") {
    // By links, so that a fault replaces them and not the machine's devices.
    const test::TemporaryDirectory directory;
    for (const auto* name : {"null", "full"})
        std::filesystem::create_symlink(std::filesystem::path("/dev") / name,
                                        directory.path() / name);
    CHECK(write_whole_file(directory.path() / "null", "text"));
    CHECK(std::filesystem::is_character_file(directory.path() / "null"));
    const auto full = write_whole_file(directory.path() / "full", "text");
    REQUIRE_FALSE(full);
    CHECK_THAT(full.error().message(), Contains("No space left on device; free some of the disk"));
}

TEST_CASE("file: without its directory, the error says to make it") {
    for (const auto& written :
         {write_new_file("/nowhere/file", ""), write_whole_file("/nowhere/file", "")}) {
        REQUIRE_FALSE(written);
        CHECK_THAT(written.error().message(),
                   Contains("/nowhere/file: cannot be written") && Contains("make its directory"));
    }
}

TEST_CASE("file: on a full disk the old one stays, and nothing of the new one") {
    const test::TemporaryDirectory directory;
    CHECK(test::in_process([&] {
        if (!test::mount_small_disk(directory.path(), "64k")) return true;
        const std::string path = directory.write("file", "old");
        return !write_whole_file(path, std::string(1 << 20U, 'x')) && content_of(path) == "old" &&
               files_in(directory.path()) == 1;
    }));
}
