// SPDX-License-Identifier: BSD-3-Clause
#include "board/uf2.hpp"

#include <catch2/catch.hpp>
#include <functional>

#include "../support/temporary_directory.hpp"
#include "../support/uf2_file.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;
using Catch::Contains;

namespace {

using Bytes = std::vector<std::uint8_t>;

/// Offset of a block's field.
constexpr std::size_t field(std::size_t block, std::size_t at) { return block * 512 + at; }

struct Uf2Damage {
    const char* name;
    std::function<void(Bytes&)> make;
    const char* where;
    const char* what;
};

}  // namespace

TEST_CASE("uf2: an image comes back in whole sectors, and what the file leaves open is erased") {
    const Bytes image = flash_image(18);  // a sector and two pages
    const auto parsed = parse_uf2(uf2_file(image), "x.uf2");
    REQUIRE(parsed);
    CHECK(parsed->pages == 18);
    REQUIRE(parsed->sectors.size() == 2);
    Bytes padded = image;
    padded.resize(2 * flash_sector, 0xFF);
    CHECK(parsed->sectors.at(flash_begin) == Bytes(padded.begin(), padded.begin() + flash_sector));
    CHECK(parsed->sectors.at(flash_begin + flash_sector) ==
          Bytes(padded.begin() + flash_sector, padded.end()));
}

TEST_CASE("uf2: blocks may come in any order of their addresses") {
    const Bytes image = flash_image(2);
    Bytes file = uf2_file(image);
    for (std::size_t i = 12; i < 16; ++i) std::swap(file[i], file[512 + i]);
    for (std::size_t i = 32; i < 288; ++i) std::swap(file[i], file[512 + i]);
    const auto parsed = parse_uf2(file, "x.uf2");
    REQUIRE(parsed);
    CHECK(parsed->sectors == parse_uf2(uf2_file(image), "x.uf2")->sectors);
}

TEST_CASE("uf2: the check of the boot stage is the chip's") {
    const std::string nine = "123456789";
    // CRC-32/MPEG-2 of the catalogue of CRCs.
    CHECK(boot_stage_crc({reinterpret_cast<const std::uint8_t*>(nine.data()), nine.size()}) ==
          0x0376E6E7);
}

TEST_CASE("uf2: each way in which a file can be wrong is reported with its block") {
    const Uf2Damage damage = GENERATE(values<Uf2Damage>({
        {"empty", [](Bytes& file) { file.clear(); }, "x.uf2:", "is no UF2 file"},
        {"an ELF", [](Bytes& file) { put_word(file, 0, 0x464C457F); }, "x.uf2:", "is no UF2 file"},
        {"second magic", [](Bytes& file) { file[field(3, 4)] ^= 1; }, "block 3",
         "is no block of a UF2 file"},
        {"last magic", [](Bytes& file) { file[field(2, 511)] ^= 1; }, "block 2",
         "is no block of a UF2 file"},
        {"no chip family", [](Bytes& file) { put_word(file, field(1, 8), 0); }, "block 1",
         "names no chip family"},
        {"RP2350", [](Bytes& file) { put_word(file, field(0, 28), 0xE48BFF59); }, "block 0",
         "0xe48bff59 (RP2350, of a Pico 2), the RP2040 is 0xe48bff56"},
        {"one block of another family",
         [](Bytes& file) { put_word(file, field(4, 28), 0xE48BFF57); }, "block 4", "0xe48bff57"},
        {"not for the flash", [](Bytes& file) { put_word(file, field(1, 8), 0x2001); }, "block 1",
         "is not for the flash"},
        {"number", [](Bytes& file) { put_word(file, field(3, 20), 4); }, "block 3",
         "has the number 4"},
        {"cut after a block", [](Bytes& file) { file.resize(field(4, 0)); }, "block 0",
         "there are 5 blocks, the file has 4"},
        {"cut within a block", [](Bytes& file) { file.resize(field(4, 100)); }, "block 0",
         "there are 5 blocks, the file has 4"},
        {"something follows", [](Bytes& file) { file.resize(field(5, 100)); }, "block 5",
         "is cut off"},
        {"another count", [](Bytes& file) { put_word(file, field(2, 24), 6); }, "block 2",
         "there are 6 blocks, the file has 5"},
        {"short payload", [](Bytes& file) { put_word(file, field(2, 16), 128); }, "block 2",
         "has 128 bytes, not 256"},
        {"long payload", [](Bytes& file) { put_word(file, field(2, 16), 476); }, "block 2",
         "has 476 bytes, not 256"},
        {"within a page", [](Bytes& file) { put_word(file, field(1, 12), 0x10000180); }, "block 1",
         "begins within a page"},
        {"in RAM", [](Bytes& file) { put_word(file, field(1, 12), 0x20000000); }, "block 1",
         "0x20000000, outside of the flash"},
        {"behind the flash", [](Bytes& file) { put_word(file, field(1, 12), 0x11000000); },
         "block 1", "0x11000000, outside of the flash"},
        {"just behind it", [](Bytes& file) { put_word(file, field(1, 12), 0x10200000); }, "block 1",
         "0x10200000, outside of the flash, which is 2048 KiB from 0x10000000"},
        {"over the settings", [](Bytes& file) { put_word(file, field(1, 12), 0x101FE000); },
         "block 1", "0x101fe000, where the board keeps its settings, from 0x101fe000"},
        {"just before the settings", [](Bytes& file) { put_word(file, field(1, 12), 0x101FDF00); },
         "x.uf2", "is damaged"},
        {"damaged content", [](Bytes& file) { file[field(3, 32 + 5)] ^= 1; }, "x.uf2",
         "is damaged, or is not VersaVIS firmware"},
        {"firmware of others", [](Bytes& file) { put_word(file, field(4, 32 + 248), 0); }, "x.uf2",
         "is damaged, or is not VersaVIS firmware"},
        {"before the flash", [](Bytes& file) { put_word(file, field(1, 12), 0x0FFFFF00); },
         "block 1", "0x0fffff00, outside of the flash"},
        {"a page twice", [](Bytes& file) { put_word(file, field(4, 12), 0x10000200); }, "block 4",
         "is for 0x10000200, as block 2 is"},
        {"no boot stage", [](Bytes& file) { put_word(file, field(0, 12), 0x10000500); }, "block 0",
         "would not start"},
        {"damaged boot stage", [](Bytes& file) { file[field(0, 32 + 77)] ^= 0x10; }, "block 0",
         "would not start"},
    }));
    INFO(damage.name);
    Bytes file = uf2_file(flash_image(5));
    damage.make(file);
    const auto parsed = parse_uf2(file, "x.uf2");
    REQUIRE_FALSE(parsed);
    CHECK_THAT(parsed.error().where + ":", Contains(damage.where) && Contains("x.uf2"));
    CHECK_THAT(parsed.error().what, Contains(damage.what));
    CHECK_FALSE(parsed.error().cure.empty());
}

TEST_CASE("uf2: a file that cannot be read is reported") {
    const TemporaryDirectory directory;
    CHECK_THAT(read_uf2(directory.path() / "none").error().message(),
               Contains("No such file") && Contains("check its name"));
    CHECK_FALSE(read_uf2(directory.path()));
    CHECK_THAT(read_uf2("/dev/zero").error().message(), Contains("larger than any flash"));
    const auto read = read_uf2(directory.write("good.uf2", as_text(uf2_file(flash_image(3)))));
    REQUIRE(read);
    CHECK(read->pages == 3);
}
