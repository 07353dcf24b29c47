// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/epoch_block.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "engine/ring/directory.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct Kept {
    test::TemporaryDirectory directory{"/dev/shm"};
    int file = ::open((directory.path() / "epochs").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);

    ~Kept() { ::close(file); }
    void store(std::uint32_t number) const {
        REQUIRE(::pwrite(file, &number, sizeof number, 0) == sizeof number);
    }
};

}  // namespace

TEST_CASE_METHOD(Kept, "epoch_block: each run begins behind what the one before may have used") {
    std::uint32_t expected = 0;
    for (int run = 0; run < 5; ++run) {
        EpochBlock block(file);
        CHECK(block.first() == expected);
        expected += 1024;  // as the contract says
    }
}

TEST_CASE_METHOD(Kept, "epoch_block: a run of many epochs reserves on, before it needs to") {
    EpochBlock block(file);
    for (std::uint32_t epoch = 0; epoch < 10'000; epoch += epochs_reserved / 8) {
        block.keep(epoch);
        std::uint32_t reserved = 0;
        REQUIRE(::pread(file, &reserved, sizeof reserved, 0) == sizeof reserved);
        CHECK(reserved >= epoch + epochs_reserved / 2);
        CHECK(reserved <= epoch + 2 * epochs_reserved);
    }
}

TEST_CASE_METHOD(Kept, "epoch_block: a run of few epochs takes no more than its block") {
    {
        EpochBlock block(file);
        for (std::uint32_t epoch = 0; epoch < 100; ++epoch) block.keep(epoch);
    }
    CHECK(EpochBlock(file).first() == epochs_reserved);
}

TEST_CASE_METHOD(Kept, "epoch_block: numbers wrap") {
    store(0xFFFFFFF0);
    EpochBlock block(file);
    CHECK(block.first() == 0xFFFFFFF0);
    block.keep(0xFFFFFFF0 + epochs_reserved - 1);
    CHECK(EpochBlock(file).first() == 0xFFFFFFF0 + 2 * epochs_reserved);
}

TEST_CASE_METHOD(Kept, "epoch_block: a file that holds no number begins at 0") {
    REQUIRE(::pwrite(file, "abc", 3, 0) == 3);
    CHECK(EpochBlock(file).first() == 0);
    CHECK(EpochBlock(-1).first() == 0);
}

TEST_CASE_METHOD(Kept, "epoch_block: an instance's directory remembers") {
    const auto path = directory.path() / "instance";
    for (std::uint32_t run = 0; run < 3; ++run) {
        auto owned = OwnedDirectory::claim(path);
        REQUIRE(owned);
        CHECK(owned->epochs().first() == run * epochs_reserved);
        owned->epochs().keep(owned->epochs().first());
    }
}
