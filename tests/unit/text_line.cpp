// SPDX-License-Identifier: BSD-3-Clause
#include "imu/text_line.hpp"

#include <catch2/catch.hpp>
#include <string>

using namespace versavis::firmware;

namespace {

std::string line_text(const TextLine& line) { return {line.data(), line.size()}; }

}  // namespace

TEST_CASE("text_line: text, other lines and numbers follow each other") {
    TextLine line;
    CHECK(line.size() == 0);
    line << ""
         << "a," << 0U << "," << 7U;
    CHECK(line_text(line) == "a,0,7");
    TextLine all;
    all << "<" << line << ">";
    CHECK(line_text(all) == "<a,0,7>");
}

TEST_CASE("text_line: numbers in decimal, of any size") {
    const std::uint32_t number =
        GENERATE(0U, 1U, 9U, 10U, 99U, 100U, 115'200U, 921'600U, 4'000'000'000U, UINT32_MAX);
    TextLine line;
    line << number;
    CHECK(line_text(line) == std::to_string(number));
}

TEST_CASE("text_line: bytes in hexadecimal have two digits") {
    TextLine line;
    line.hex(0x00).hex(0x09).hex(0xAF).hex(0xF0) << ".";
    CHECK(line_text(line) == "0009AFF0.");
}

TEST_CASE("text_line: holds 64 characters, and leaves out what is too much") {
    TextLine line;
    for (int i = 0; i < 32; ++i) line << "ab";
    CHECK(line.size() == 64);
    line << "c" << 5U;
    line.hex(1);
    CHECK(line.size() == 64);
    CHECK(line_text(line).substr(60) == "abab");
}
