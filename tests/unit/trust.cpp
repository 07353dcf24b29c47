// SPDX-License-Identifier: BSD-3-Clause
#include "client/trust.hpp"

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <functional>
#include <string>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

constexpr uid_t stranger = 12345;

struct Instance {
    test::TemporaryDirectory directory{"/dev/shm"};
    Writer writer = *Writer::create(directory.path(), {"events", StreamKind::events, 8});

    std::filesystem::path path() const { return directory.path() / "events"; }

    /// What a reader is told; empty: it may read.
    std::string refusal(const Options& options = {}) const {
        const auto reader = Reader::open(path(), options);
        return reader ? "" : reader.error().message();
    }

    /// As another user, who is told `words`, or may read when they are empty.
    bool told_as_stranger(const std::string& words, const Options& options = {}) const {
        return test::in_process([&] {
            if (::setegid(stranger) != 0 || ::seteuid(stranger) != 0) return false;
            const std::string told = refusal(options);
            return words.empty() ? told.empty() : told.find(words) != std::string::npos;
        });
    }

    void give_to(uid_t user) const {
        REQUIRE(::chown(directory.path().c_str(), user, user) == 0);
        REQUIRE(::chown(path().c_str(), user, user) == 0);
    }
};

bool is_root() { return ::geteuid() == 0; }

}  // namespace

TEST_CASE_METHOD(Instance, "trust: a missing permission is named, with the cure") {
    if (!is_root()) return;  // only root can become somebody else
    REQUIRE(::chmod(directory.path().c_str(), 0755) == 0);
    CHECK(told_as_stranger("permission denied; join the group"));
    REQUIRE(::chmod(directory.path().c_str(), 0750) == 0);
    CHECK(told_as_stranger("permission denied; join the group"));
}

TEST_CASE_METHOD(Instance, "trust: root's streams are read by everybody whom modes let") {
    if (!is_root()) return;
    // To know the name is enough, where the directory is not to be listed.
    for (const mode_t mode : {0755U, 0711U}) {
        REQUIRE(::chmod(directory.path().c_str(), mode) == 0);
        REQUIRE(::chmod(path().c_str(), 0644) == 0);
        CHECK(told_as_stranger(""));
    }
}

TEST_CASE_METHOD(Instance, "trust: a directory that a stranger made first is not believed") {
    if (!is_root()) return;
    give_to(stranger);
    CHECK_THAT(refusal(),
               Catch::Contains("belongs to user 12345") && Catch::Contains("VERSAVIS_OWNER"));
    Options named;
    named.owner = stranger;
    CHECK(refusal(named).empty());
    CHECK(told_as_stranger(""));  // to whom it is his own
    Options other;
    other.owner = stranger + 1;
    CHECK_THAT(refusal(other), Catch::Contains("belongs to user 12345, not to user 12346"));
}

TEST_CASE_METHOD(Instance, "trust: the environment names an owner") {
    CHECK(test::in_process([&] {
        ::setenv("VERSAVIS_OWNER", "root", 1);
        const bool root_owns = refusal().empty() == is_root();
        ::setenv("VERSAVIS_OWNER", "no such user", 1);
        const bool nobody_owns = !refusal().empty();
        ::setenv("VERSAVIS_OWNER", "", 1);
        return root_owns && nobody_owns && refusal().empty();
    }));
}

TEST_CASE_METHOD(Instance, "trust: a file of somebody else in a good directory is refused") {
    if (!is_root()) return;
    REQUIRE(::chown(path().c_str(), stranger, stranger) == 0);
    CHECK_THAT(refusal(), Catch::Contains("does not belong"));
    Options named;
    named.owner = stranger;
    CHECK_THAT(refusal(named), Catch::Contains("does not belong"));
}

TEST_CASE_METHOD(Instance, "trust: a directory that everybody can write is refused") {
    REQUIRE(::chmod(directory.path().c_str(), 0777) == 0);
    CHECK_THAT(refusal(), Catch::Contains("does not belong"));
}

TEST_CASE_METHOD(Instance, "trust: where no descriptor is left, that is what is told") {
    CHECK(test::in_process([&] {
        const rlimit none{0, 0};
        return ::setrlimit(RLIMIT_NOFILE, &none) == 0 &&
               refusal().find("cannot be opened: Too many open files") != std::string::npos;
    }));
}

TEST_CASE_METHOD(Instance, "trust: links and pipes are not streams, and nobody waits for them") {
    std::filesystem::create_symlink("events", directory.path() / "link");
    CHECK_THAT(Reader::open(directory.path() / "link").error().message(),
               Catch::Contains("is a link"));
    REQUIRE(::mkfifo((directory.path() / "pipe").c_str(), 0600) == 0);
    CHECK_THAT(Reader::open(directory.path() / "pipe").error().message(),
               Catch::Contains("is not a VersaVIS ring"));
    CHECK_THAT(Reader::open(directory.path()).error().message(), Catch::Contains("not"));
    for (const char* name : {"none", "events"})
        CHECK_THAT(Reader::open(directory.path() / name / "events").error().message(),
                   Catch::Contains("no such stream"));
}

TEST_CASE_METHOD(Instance, "trust: what waits under a new ring's name is not written to") {
    directory.write("victim", "precious");
    for (const char* name : {".cam0.new", "cam0"}) {
        std::filesystem::create_symlink("victim", directory.path() / name);
        const auto made = Writer::create(directory.path(), {"cam0", StreamKind::events, 8});
        CHECK(made);
        CHECK(std::filesystem::file_size(directory.path() / "victim") == 8);
        struct stat file {};
        REQUIRE(::lstat((directory.path() / "cam0").c_str(), &file) == 0);
        CHECK(S_ISREG(file.st_mode));
    }
}

TEST_CASE_METHOD(Instance, "trust: whatever the umask, the group may read") {
    const mode_t before = ::umask(0077);
    const auto made = Writer::create(directory.path(), {"cam0", StreamKind::events, 8});
    ::umask(before);
    REQUIRE(made);
    struct stat file {};
    REQUIRE(::stat((directory.path() / "cam0").c_str(), &file) == 0);
    CHECK((file.st_mode & 0777) == 0640);
}
