// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/memory_budget.hpp"

#include <catch2/catch.hpp>

#include "../support/in_process.hpp"
#include "../support/small_disk.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;
using namespace versavis::ring;
using Catch::Matchers::Contains;
using test::in_process;

namespace {

constexpr std::uint64_t mib = 1 << 20U;

struct MemoryMachine {
    test::TemporaryDirectory directory{"/dev/shm"};

    /// With so much memory available.
    Expected<> check(std::uint64_t size, const std::string& memory) const {
        return check_tmpfs_space(directory.path() / "cam0", size,
                                 directory.write("meminfo", memory));
    }
};

std::string meminfo_with(std::uint64_t available_mib) {
    return "MemTotal: 4194304 kB\nMemFree: 1 kB\nMemAvailable: " +
           std::to_string(available_mib << 10U) + " kB\nSwapTotal: 0 kB\n";
}

}  // namespace

TEST_CASE_METHOD(MemoryMachine, "memory_budget: a ring leaves 64 MiB to others") {
    CHECK(check(100 * mib, meminfo_with(164)));
    const auto refused = check(100 * mib + 1, meminfo_with(164));
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("/cam0: needs 101 MiB, and 164 MiB are free"));
    CHECK_THAT(refused.error().message(), Contains("lower 'slots' or 'history_s'"));
    CHECK_THAT(check(100 * mib, meminfo_with(163)).error().message(),
               Contains("needs 100 MiB, and 163 MiB are free"));
    CHECK_FALSE(check(1, meminfo_with(64)));
    CHECK_FALSE(check(1, meminfo_with(1)));
}

TEST_CASE_METHOD(MemoryMachine,
                 "memory_budget: where the machine does not say, the file system decides") {
    for (const char* memory : {"", "MemTotal: 5 kB\n", "MemAvailable: much\n", "\n\n"})
        CHECK(check(mib, memory));
    CHECK(check_tmpfs_space(directory.path() / "cam0", mib, directory.path() / "nothing"));
}

TEST_CASE_METHOD(MemoryMachine,
                 "memory_budget: a file system that is too small says how to enlarge it") {
    const auto refused = check(std::uint64_t{1} << 50U, "");
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("free in its file system"));
    CHECK_THAT(refused.error().message(), Contains("remount"));
}

TEST_CASE_METHOD(MemoryMachine,
                 "memory_budget: a file system that does not count its blocks has room") {
    // As a tmpfs without a limit.
    CHECK(check_tmpfs_space("/proc/cam0", mib, directory.write("meminfo", "")));
}

TEST_CASE_METHOD(MemoryMachine,
                 "memory_budget: a ring may take all of its file system, and no byte more") {
    const auto meminfo = directory.write("meminfo", "");
    const auto mounted = [&] { return test::mount_small_disk(directory.path(), "1m"); };
    if (!in_process(mounted)) {
        WARN("not tested: the machine lets no process mount a file system of its own");
        return;
    }
    CHECK(in_process([&] {
        return mounted() && check_tmpfs_space(directory.path() / "cam0", mib, meminfo) &&
               !check_tmpfs_space(directory.path() / "cam0", mib + 1, meminfo);
    }));
}

TEST_CASE_METHOD(MemoryMachine,
                 "memory_budget: a ring that does not fit is not made, and leaves nothing behind") {
    const auto writer = Writer::create(
        directory.path(), {"cam0", StreamKind::frames, 64, 1U << 20U, std::uint64_t{1} << 30U});
    REQUIRE_FALSE(writer);
    CHECK_THAT(writer.error().message(), Contains("needs 1073741"));
    CHECK(std::filesystem::is_empty(directory.path()));
}
