// SPDX-License-Identifier: BSD-3-Clause
#include "replay.hpp"

#include <cxxabi.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "../support/process.hpp"
#include "../support/temporary_directory.hpp"

namespace versavis::emulator {

namespace {

const std::filesystem::path directory = VERSAVIS_EMULATOR;

// A second of the board's life takes a few; more means that the emulator hangs.
constexpr Duration longest = seconds(300);

std::string readable(const std::string& symbol) {
    int status = 0;
    const std::unique_ptr<char, decltype(&std::free)> name(
        abi::__cxa_demangle(symbol.c_str(), nullptr, nullptr, &status), &std::free);
    return status == 0 ? name.get() : symbol;
}

}  // namespace

Replayed replay(const std::vector<std::uint32_t>& recording, bool with_profile) {
    const test::TemporaryDirectory scratch;
    const std::string recorded = scratch.path() / "recording";
    const std::string result = scratch.path() / "result.json";
    std::ofstream(recorded, std::ios::binary)
        .write(reinterpret_cast<const char*>(recording.data()),
               static_cast<std::streamsize>(recording.size() * sizeof recording[0]));
    std::vector<std::string> command = {
        "node", "--single-threaded", directory / "replay.mjs", directory / "replay.elf", recorded,
        result};
    if (with_profile) command.emplace_back("--profile");
    test::Process process(command, scratch.path() / "log");
    const int code = process.wait(longest);
    if (code != 0)
        throw std::runtime_error(code < 0 ? "the emulator does not end" : process.output());
    const auto json = nlohmann::json::parse(std::ifstream(result));
    Replayed replayed;
    json.at("polls").get_to(replayed.polls);
    json.at("stack").get_to(replayed.stack);
    json.at("core").get_to(replayed.core);
    json.at("library").get_to(replayed.library);
    json.at("board").get_to(replayed.board);
    replayed.deepest = readable(json.at("deepest"));
    for (const auto& function : json.at("profile"))
        replayed.profile.push_back({readable(function.at("name")), function.at("self"),
                                    function.at("total"), function.at("calls")});
    return replayed;
}

}  // namespace versavis::emulator
