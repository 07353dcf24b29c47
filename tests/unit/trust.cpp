// SPDX-License-Identifier: BSD-3-Clause
#include "client/trust.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <optional>
#include <string>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

constexpr uid_t stranger = 12345;

struct TrustedInstance {
    test::TemporaryDirectory directory{"/dev/shm"};
    Writer writer = *Writer::create(directory.path(), {"events", StreamKind::events, 8});

    std::filesystem::path path() const { return directory.path() / "events"; }

    /// Why a reader is refused, without the path; empty: it may read.
    std::string refusal(const Options& options = {}, const std::string& name = "events") const {
        const auto reader = Reader::open(directory.path() / name, options);
        return reader ? "" : reader.error().message().substr(directory.path().string().size() + 1);
    }

    /// The same for another user, compared in another process.
    bool refuses_stranger(const std::string& message) const {
        return test::in_process([&] {
            return ::setegid(stranger) == 0 && ::seteuid(stranger) == 0 && refusal() == message;
        });
    }

    void give_to(uid_t user) const {
        REQUIRE(::chown(directory.path().c_str(), user, user) == 0);
        REQUIRE(::chown(path().c_str(), user, user) == 0);
    }
};

bool is_root() { return ::geteuid() == 0; }

}  // namespace

TEST_CASE_METHOD(TrustedInstance, "trust: a missing permission is named, with the cure") {
    if (!is_root()) return;  // only root can become somebody else
    for (const mode_t mode : {0755U, 0750U}) {
        REQUIRE(::chmod(directory.path().c_str(), mode) == 0);
        CHECK(
            refuses_stranger("events: permission denied; join the group that may read streams "
                             "(usually 'versavis')"));
    }
}

TEST_CASE_METHOD(TrustedInstance, "trust: root's streams are read by everybody whom modes let") {
    if (!is_root()) return;
    // To know the name is enough, where the directory is not to be listed.
    for (const mode_t mode : {0755U, 0711U}) {
        REQUIRE(::chmod(directory.path().c_str(), mode) == 0);
        REQUIRE(::chmod(path().c_str(), 0644) == 0);
        CHECK(refuses_stranger(""));
    }
}

TEST_CASE_METHOD(TrustedInstance, "trust: a directory that a stranger made first is not trusted") {
    if (!is_root()) return;
    const std::string cure =
        "; if the service runs as that user, give its name or number in VERSAVIS_OWNER, or as "
        "owner";
    give_to(stranger);
    CHECK(refusal() ==
          "events: belongs to user 12345, who is neither root, nor you, nor 'versavis'" + cure);
    Options named;
    named.owner = stranger;
    CHECK(refusal(named).empty());
    CHECK(refuses_stranger(""));  // to whom it is his own
    Options other;
    other.owner = stranger + 1;
    CHECK(refusal(other) == "events: belongs to user 12345, not to user 12346" + cure);
}

TEST_CASE_METHOD(TrustedInstance, "trust: the environment names an owner") {
    CHECK(test::in_process([&] {
        ::setenv("VERSAVIS_OWNER", "root", 1);
        const bool root_owns = refusal().empty() == is_root();
        ::setenv("VERSAVIS_OWNER", "no such user", 1);
        const bool nobody_owns = !refusal().empty();
        ::setenv("VERSAVIS_OWNER", "", 1);
        return root_owns && nobody_owns && refusal().empty();
    }));
}

TEST_CASE("trust: an owner in the environment may be a number") {
    CHECK(test::in_process([] {
        const auto owned = [](const char* name, std::uint32_t user) {
            ::setenv("VERSAVIS_OWNER", name, 1);
            return may_own(user, std::nullopt);
        };
        // 4294967296 and 8589939303 are 0 and 4711 in 32 bits.
        return owned("4711", 4711) && !owned("4711", 4712) && !owned("4711", ::geteuid()) &&
               owned("0", 0) && owned("04711", 4711) && owned("4294967295", UINT32_MAX) &&
               !owned("4294967296", 0) && !owned("4294967296", UINT32_MAX) &&
               !owned("8589939303", 4711) && !owned("4711x", 4711) && !owned("-4711", 4711) &&
               !owned("+4711", 4711) && !owned(" 4711", 4711) && !owned("0x10", 16);
    }));
}

namespace {

/// From here on, this process sees no user but itself: others are 65534 to it.
bool enter_namespace_of_one_user() {
    const auto user = ::geteuid();
    return ::unshare(CLONE_NEWUSER) == 0 &&
           static_cast<bool>(std::ofstream("/proc/self/uid_map")
                             << user << ' ' << user << " 1" << std::flush);
}

}  // namespace

TEST_CASE_METHOD(TrustedInstance, "trust: an owner whom a container does not map is named so") {
    if (!is_root() || !test::in_process(enter_namespace_of_one_user)) {
        WARN("not tested: this machine lets nobody make a user namespace");
        return;
    }
    give_to(stranger);
    REQUIRE(::chmod(directory.path().c_str(), 0755) == 0);
    REQUIRE(::chmod(path().c_str(), 0644) == 0);
    CHECK(test::in_process([&] {
        return enter_namespace_of_one_user() &&
               refusal() ==
                   "events: belongs to a user that this container does not map; map the service's "
                   "user in it; or, if all users outside are trusted, set VERSAVIS_OWNER=65534";
    }));
    CHECK(test::in_process([&] {
        ::setenv("VERSAVIS_OWNER", "65534", 1);
        return enter_namespace_of_one_user() && refusal().empty();
    }));
    CHECK(test::in_process([&] {  // not even itself: it is 65534, too
        return ::unshare(CLONE_NEWUSER) == 0 && ::geteuid() == 65534 &&
               refusal().find("belongs to a user that this container does not map") !=
                   std::string::npos;
    }));
    give_to(65534);  // a user of that number, where all are mapped
    CHECK_THAT(refusal(), Catch::Contains("belongs to user 65534, who is neither root"));
}

TEST_CASE_METHOD(TrustedInstance, "trust: a file that somebody else may have made is refused") {
    const std::string message =
        "events: does not belong to the owner of its directory; somebody else may have put it "
        "there: remove it";
    SECTION("a file of another owner than its directory") {
        if (!is_root()) return;
        REQUIRE(::chown(path().c_str(), stranger, stranger) == 0);
        CHECK(refusal() == message);
        Options named;
        named.owner = stranger;
        CHECK(refusal(named) == message);
    }
    SECTION("a directory that everybody can write") {
        REQUIRE(::chmod(directory.path().c_str(), 0777) == 0);
        CHECK(refusal() == message);
    }
}

TEST_CASE_METHOD(TrustedInstance, "trust: a lack of descriptors is named") {
    CHECK(test::in_process([&] {
        const rlimit none{0, 0};
        return ::setrlimit(RLIMIT_NOFILE, &none) == 0 &&
               refusal() == "events: cannot be opened: Too many open files";
    }));
}

TEST_CASE_METHOD(TrustedInstance,
                 "trust: links and pipes are not streams, and nobody waits for them") {
    const std::string none =
        ": no such stream; is the service running? 'versavis list' shows the streams";
    std::filesystem::create_symlink("events", directory.path() / "link");
    REQUIRE(::mkfifo((directory.path() / "pipe").c_str(), 0600) == 0);
    CHECK(refusal({}, "link") == "link: is a link, not a stream; remove it");
    CHECK(refusal({}, "pipe") == "pipe: is not a VersaVIS ring");
    CHECK(refusal({}, "none/events") == "none/events" + none);
    CHECK(refusal({}, "events/events") == "events/events" + none);
    CHECK(Reader::open(directory.path()).error().message() ==
          directory.path().string() +
              ": does not belong to the owner of its directory; somebody else may have put it "
              "there: remove it");
}

TEST_CASE_METHOD(TrustedInstance, "trust: what waits under a new ring's name is not written to") {
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

TEST_CASE_METHOD(TrustedInstance, "trust: whatever the umask, the group may read") {
    const mode_t before = ::umask(0077);
    const auto made = Writer::create(directory.path(), {"cam0", StreamKind::events, 8});
    ::umask(before);
    REQUIRE(made);
    struct stat file {};
    REQUIRE(::stat((directory.path() / "cam0").c_str(), &file) == 0);
    CHECK((file.st_mode & 0777) == 0640);
}
