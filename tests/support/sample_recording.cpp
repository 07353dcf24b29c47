// SPDX-License-Identifier: BSD-3-Clause
// sample-recording FILE [png] [cut] [mono12] [large]: writes a recording for tests of other
// programs.
#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "recording_file.hpp"

int main(int argc, char** argv) {
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    if (arguments.empty()) return 64;
    const auto given = [&](const char* name) {
        return std::find(arguments.begin() + 1, arguments.end(), name) != arguments.end();
    };
    constexpr std::uint32_t mono8 = 0x01080001;
    constexpr std::uint32_t mono12 = 0x01100005;
    std::ofstream file(arguments[0], std::ios::binary);
    const std::uint32_t format = given("mono12") ? mono12 : mono8;
    // One image of 16 bits has more than 4 MiB then, the largest block of LZ4.
    file << (given("large")
                 ? versavis::test::sample_recording(1, given("png"), given("cut"), format, 2200,
                                                    1100)
                 : versavis::test::sample_recording(3, given("png"), given("cut"), format));
    return file.flush() ? 0 : 1;
}
