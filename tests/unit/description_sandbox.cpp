// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_sandbox.hpp"

#include <catch2/catch.hpp>
#include <fstream>

#include "../support/process.hpp"
#include "../support/temporary_directory.hpp"
#include "gige_registers.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

Description honest_description() {
    const std::string text = rig::gige_xml(640, 480);
    return {{text.begin(), text.end()}, false};
}

bool never_stop() { return false; }

}  // namespace

TEST_CASE("description_sandbox: a good one is looked at once, also in the next life") {
    const test::TemporaryDirectory directory;
    const std::string daemon = test::program("versavisd");
    CHECK(
        DescriptionSandbox(daemon, directory.path()).vet("cam0", honest_description(), never_stop));
    CHECK(DescriptionSandbox("/bin/false", directory.path())
              .vet("cam0", honest_description(), never_stop));
    auto other = honest_description();
    other.bytes.push_back('\n');
    CHECK_FALSE(DescriptionSandbox("/bin/false", directory.path()).vet("cam0", other, never_stop));
}

TEST_CASE("description_sandbox: why one is refused is reported, and kept for this life only") {
    const test::TemporaryDirectory directory;
    auto broken = honest_description();
    broken.bytes.resize(1000);
    DescriptionSandbox vetting(test::program("versavisd"), directory.path());
    for (int i = 0; i < 2; ++i) {
        const auto refused = vetting.vet("cam0", broken, never_stop);
        REQUIRE_FALSE(refused);
        CHECK_THAT(refused.error().message(),
                   Catch::Contains("cam0") && Catch::Contains("cut off"));
    }
    CHECK_FALSE(std::ifstream(directory.path() / "descriptions").good());
}

TEST_CASE("description_sandbox: what ends its reader, or keeps it busy, is refused") {
    const test::TemporaryDirectory directory;
    const std::string crash = directory.write("crash", "#!/bin/sh\nkill -SEGV $$\n");
    const std::string hang = directory.write("hang", "#!/bin/sh\nexec sleep 100\n");
    std::filesystem::permissions(crash, std::filesystem::perms::owner_all);
    std::filesystem::permissions(hang, std::filesystem::perms::owner_all);
    const auto crashed =
        DescriptionSandbox(crash, directory.path()).vet("cam0", honest_description(), never_stop);
    REQUIRE_FALSE(crashed);
    CHECK_THAT(crashed.error().message(), Catch::Contains("crashes with signal 11"));
    int asked = 0;
    const auto stopped =
        DescriptionSandbox(hang, directory.path()).vet("cam0", honest_description(), [&] {
            return ++asked > 3;
        });
    REQUIRE_FALSE(stopped);
    CHECK_THAT(stopped.error().message(), Catch::Contains("stopped"));
}

TEST_CASE("description_sandbox: one that is slow is looked at again, some times") {
    const test::TemporaryDirectory directory;
    const std::string runs = directory.path() / "runs";
    const std::string slow =
        directory.write("slow", "#!/bin/sh\necho run >> " + runs + "\nkill -XCPU $$\n");
    std::filesystem::permissions(slow, std::filesystem::perms::owner_all);
    DescriptionSandbox vetting(slow, directory.path());
    for (int i = 0; i < 5; ++i) {
        const auto refused = vetting.vet("cam0", honest_description(), never_stop);
        REQUIRE_FALSE(refused);
        CHECK_THAT(refused.error().message(), Catch::Contains("too much CPU time"));
    }
    CHECK(std::filesystem::file_size(runs) == 3 * std::string("run\n").size());
}
