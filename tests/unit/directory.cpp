// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/directory.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring/reader.hpp"

using namespace versavis;
using namespace versavis::ring;

TEST_CASE("directory: one owner at a time, readable for its group only") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    {
        auto first = OwnedDirectory::claim(path);
        REQUIRE(first);
        struct stat info {};
        REQUIRE(stat(path.c_str(), &info) == 0);
        CHECK((info.st_mode & 0777U) == 0750U);
        CHECK_THAT(OwnedDirectory::claim(path).error().message(),
                   Catch::Contains("another versavisd"));
    }
    CHECK(OwnedDirectory::claim(path));
}

TEST_CASE("directory: segments of a dead owner are retired, our own are kept") {
    test::TemporaryDirectory parent("/dev/shm");
    auto directory = OwnedDirectory::claim(parent.path() / "instance");
    REQUIRE(directory);
    auto own = Writer::create(directory->path(), {"own", StreamKind::events, 8});
    REQUIRE(own);
    // A copy is a segment whose writer never closed it; another process id makes it a stranger's.
    const auto stranger = directory->path() / "stranger";
    std::filesystem::copy_file(directory->path() / "own", stranger);
    {
        std::fstream file(stranger, std::ios::in | std::ios::out | std::ios::binary);
        const std::uint32_t pid = 1;
        file.seekp(offsetof(Header, writer_pid))
            .write(reinterpret_cast<const char*>(&pid), sizeof pid);
    }
    auto reader = Reader::open(stranger);
    REQUIRE(reader);
    std::filesystem::copy_file(stranger, directory->path() / "kept");
    directory->remove_stale({"kept"});
    CHECK(std::filesystem::exists(directory->path() / "kept"));
    CHECK(std::filesystem::exists(directory->path() / "own"));
    CHECK_FALSE(std::filesystem::exists(stranger));
    CHECK(reader->next().found == Found::gone);
}

TEST_CASE("directory: one that others may write to is refused, with the cure") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    REQUIRE(::mkdir(path.c_str(), 0700) == 0);
    for (const mode_t mode : {0777U, 0770U, 01777U}) {
        REQUIRE(::chmod(path.c_str(), mode) == 0);
        CHECK_THAT(OwnedDirectory::claim(path).error().message(),
                   Catch::Contains("can be written by others") && Catch::Contains("chmod 0750"));
    }
    REQUIRE(::chmod(path.c_str(), 0750) == 0);
    CHECK(OwnedDirectory::claim(path));
    REQUIRE(::chmod(parent.path().c_str(), 0777) == 0);
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains("chmod 0755"));
}

TEST_CASE("directory: a link or another's directory is refused") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    std::filesystem::create_directory_symlink(parent.path(), path);
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains("not a directory"));
    const std::filesystem::path foreign = ::geteuid() == 0 ? parent.path() / "foreign" : "/proc";
    if (::geteuid() == 0) {
        REQUIRE(::mkdir(foreign.c_str(), 0750) == 0);
        REQUIRE(::chown(foreign.c_str(), 12345, 12345) == 0);
    }
    CHECK_THAT(OwnedDirectory::claim(foreign).error().message(), Catch::Contains("another user"));
}
