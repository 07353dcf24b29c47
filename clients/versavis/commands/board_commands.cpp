// SPDX-License-Identifier: BSD-3-Clause
#include "board_commands.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "base/fail.hpp"
#include "board/board_info.hpp"
#include "board/bring_up.hpp"
#include "commands/progress_line.hpp"
#include "engine/board/firmware_file.hpp"

namespace versavis::client {

namespace {

/// One line of whoever sits at the terminal; none: nobody does, or the program is to end.
std::optional<std::string> answer(const std::string& question, const std::function<bool()>& stop) {
    if (isatty(STDIN_FILENO) == 0) return std::nullopt;
    fmt::print(stderr, "{}", question);
    constexpr int look_at_stop_ms = 100;
    pollfd input{STDIN_FILENO, POLLIN, 0};
    while (::poll(&input, 1, look_at_stop_ms) <= 0)
        if (stop()) return std::nullopt;
    std::string line;
    if (!std::getline(std::cin, line)) return std::nullopt;
    return line;
}

void show(const BringUpStep& step) {
    fmt::print(stderr, "\n{}\n  connect: {}\n", step.name, step.connect);
    if (*step.where != '\0') fmt::print(stderr, "  measure: pins {}\n", step.where);
    fmt::print(stderr, "  expect:  {}\n", step.expect);
}

}  // namespace

BoardCommands::BoardCommands(CLI::App& app, std::function<bool()> stop)
    : flash_(
          app.add_subcommand("flash",
                             "Flash new firmware to the board: erase, write, verify, then wait "
                             "until it runs. Stop the service first. If interrupted, run it again. "
                             "Exits 0 if every selected board was flashed (docs/user/board.md)")),
      board_(app.add_subcommand("board", "Inspect, reset or self-test the trigger board")),
      stop_(std::move(stop)) {
    board_->require_subcommand(1);
    add_flash();
    add_info();
    add_reset();
    add_self_test();
}

void BoardCommands::add_flash() {
    flash_->add_option("file", file_,
                       "UF2 file (default: share/versavis/versavis.uf2 below the installation "
                       "prefix, or else the one built with this program)");
    add_choice(*flash_);
    flash_->add_flag("--all", all_, "Flash every connected board, one after the other")
        ->excludes("--serial", "--port");
    flash_->add_flag("--json", json_, "Print the result as a JSON object");
}

void BoardCommands::add_info() {
    info_ = board_->add_subcommand(
        "info",
        "Show version, serial number, parts and counters of the board. If the service has the "
        "board open, it is asked; otherwise the board itself is queried, which stops its cameras");
    add_choice(*info_);
    info_->add_flag("--json", json_,
                    "Print a JSON object with the keys of `board` in the status document "
                    "(docs/contracts/status.md)");
}

void BoardCommands::add_reset() {
    reset_ = board_->add_subcommand(
        "reset", "Reset the board, or make it leave its boot loader. Stop the service first");
    add_choice(*reset_);
    reset_->add_flag("--json", json_, "Print a JSON object");
}

void BoardCommands::add_self_test() {
    self_test_ = board_->add_subcommand(
        "selftest",
        "Send pulses on each output and measure them at the inputs wired to it. First disconnect "
        "cameras and light, and stop the service. Exits 0 if at least one wire was found and all "
        "passed, 1 if not (docs/user/board.md)");
    add_choice(*self_test_);
    self_test_
        ->add_option("--wire", wires_, "Required loopback wire, e.g. test=aux0; may be repeated")
        ->type_name("OUTPUT=INPUT")
        ->allow_extra_args(false);
    self_test_
        ->add_flag("--bringup", bring_up_,
                   "Guide through the first power-up of a board: each step says what to connect "
                   "and what a scope should show, then asks for the result")
        ->excludes("--wire");
    self_test_->add_flag("--json", json_, "Print a JSON object");
}

void BoardCommands::add_choice(CLI::App& command) {
    command.add_option("--serial", choice_.serial,
                       "Serial number of the board, to choose one of several");
    command.add_option("--port", choice_.port,
                       "USB port of the board, e.g. usb:1-2, to choose one of several");
}

bool BoardCommands::chosen() const { return flash_->parsed() || board_->parsed(); }

int BoardCommands::run(const std::string& instance) {
    instance_ = instance;
    if (flash_->parsed()) return flash_board();
    if (info_->parsed()) return show_info();
    if (reset_->parsed()) return reset();
    return bring_up_ ? lead_through() : test();
}

int BoardCommands::flash_board() {
    const auto own = board::firmware_file();
    if (file_.empty() && !std::filesystem::exists(own))
        return fail({own.string(), "is not there",
                     "install gcc-arm-none-eabi, libnewlib-dev and libstdc++-arm-none-eabi-dev, "
                     "then build and install again; or name a UF2 file of a release"});
    ProgressLine line;
    FlashSettings settings{file_.empty() ? own.string() : file_, choice_, instance_, stop_};
    settings.progress = [&](const std::string& what, std::size_t done, std::size_t all) {
        line.show(fmt::format("{} {} %", what, 100 * done / all));
    };
    if (all_) return flash_fleet(settings, line);
    const auto flashed = flash(settings);
    line.end();
    if (!flashed) return fail(flashed.error());
    fmt::print("{}", json_ ? to_json(*flashed).dump() + "\n" : to_text(*flashed));
    return EX_OK;
}

int BoardCommands::flash_fleet(const FlashSettings& settings, ProgressLine& line) {
    std::size_t good = 0;
    auto outcomes = nlohmann::json::array();
    const auto finished = [&](const FoundBoard& board, const Expected<Flashed>& flashed) {
        line.end();
        if (!flashed) {
            fail(flashed.error());
            outcomes.push_back({{"port", board.device.port()},
                                {"serial", board.serial},
                                {"error", flashed.error().message()}});
            return;
        }
        ++good;
        outcomes.push_back(to_json(*flashed));
        if (json_) return;
        fmt::print("{}", to_text(*flashed));
        std::fflush(stdout);
    };
    const auto count = flash_all(settings, finished);
    if (!count) return fail(count.error());
    fmt::print("{}", json_ ? nlohmann::json{{"boards", outcomes}}.dump() + "\n"
                           : fmt::format("{} of {} boards have the new firmware\n", good, *count));
    return good == *count ? EX_OK : EX_UNAVAILABLE;
}

int BoardCommands::show_info() {
    const auto info = board_info(choice_, instance_);
    if (!info) return fail(info.error());
    fmt::print("{}", json_ ? info->dump() + "\n" : board_text(*info));
    return EX_OK;
}

int BoardCommands::reset() {
    const auto board = reset_board({choice_, instance_, stop_});
    if (!board) return fail(board.error());
    fmt::print("{}", to_text(*board, json_));
    return EX_OK;
}

int BoardCommands::test() {
    ProgressLine line;
    SelfTestSettings settings{choice_, instance_, wires_, stop_};
    settings.progress = [&](const char* what, std::size_t done, std::size_t all) {
        line.show(fmt::format("{} {} %", what, 100 * done / all));
    };
    const auto tested = self_test(settings);
    line.end();
    if (!tested) return fail(tested.error());
    fmt::print("{}", to_text(*tested, json_));
    return tested->passed ? EX_OK : EXIT_FAILURE;
}

int BoardCommands::lead_through() {
    BringUpSettings settings{choice_, instance_};
    settings.stop = stop_;
    settings.prepare = [&](const BringUpStep& step) {
        show(step);
        if (*step.where == '\0') answer("  connected? [Enter] ", stop_);
    };
    settings.look = [&](const BringUpStep&) -> std::optional<bool> {
        const auto seen = answer("  as expected? [Y/n] ", stop_);
        if (!seen) return std::nullopt;
        return seen->empty() || seen->front() == 'y' || seen->front() == 'Y';
    };
    const auto done = bring_up(settings);
    if (!done) return fail(done.error());
    fmt::print("{}", to_text(*done, json_));
    return done->passed() ? EX_OK : EXIT_FAILURE;
}

}  // namespace versavis::client
