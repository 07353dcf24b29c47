// SPDX-License-Identifier: BSD-3-Clause
// The ring of clock stamps and its recording, from the rig's board through the service.
#include <signal.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "engine/clock/output_clock.hpp"
#include "engine/clock/recording.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::clock;

namespace {

/// The next item of the ring, of any kind; throws when none arrives in time.
ClockItem next(ClockStream& stream) {
    const HostTime deadline = host_now() + seconds(20);
    while (host_now() < deadline) {
        const auto item = test::look(stream.next(milliseconds(200)));
        if (item.found != test::Found::item) continue;
        const auto recorded = from_metadata(item.data);
        REQUIRE(recorded);
        return *recorded;
    }
    throw std::runtime_error("no clock stamps arrived in time");
}

template <class Item>
Item next_of(ClockStream& stream) {
    for (;;) {
        const ClockItem item = next(stream);
        if (std::holds_alternative<Item>(item)) return std::get<Item>(item);
    }
}

ClockStream from_the_first(const Stack& stack) {
    auto stream = ClockStream::open("clock", {{Position::middle}, stack.instance()});
    if (!stream) throw std::runtime_error(stream.error().message());
    return std::move(*stream);
}

/// Rows of a CSV file of whole numbers; the header must be `header`, and every row must have as
/// many columns.
std::vector<std::vector<std::int64_t>> read_csv(const std::string& path,
                                                const std::string& header) {
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);
    CHECK(line == header);
    const auto columns = std::count(header.begin(), header.end(), ',') + 1;
    std::vector<std::vector<std::int64_t>> rows;
    while (std::getline(file, line)) {
        CHECK_FALSE(file.eof());  // the last line is complete as well
        std::istringstream cells(line);
        std::string cell;
        std::vector<std::int64_t> row;
        while (std::getline(cells, cell, ',')) {
            std::size_t used = 0;
            row.push_back(std::stoll(cell, &used));
            CHECK(used == cell.size());
        }
        REQUIRE(static_cast<std::ptrdiff_t>(row.size()) == columns);
        rows.push_back(row);
    }
    return rows;
}

void check_exchanges(const std::vector<std::vector<std::int64_t>>& rows) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const std::int64_t round_trip_ns = rows[i][3] - rows[i][0] - (rows[i][2] - rows[i][1]);
        CHECK(round_trip_ns > 0);
        CHECK(round_trip_ns < 500'000'000);
        CHECK(std::abs(rows[i][2] - rows[i][1]) < 50'000'000);
        if (i > 0) CHECK(rows[i][0] > rows[i - 1][3]);
        if (i > 0) CHECK(rows[i][1] > rows[i - 1][2]);
    }
}

}  // namespace

TEST_CASE("clock stamps: each exchange, each sample's way and the output clock are in the ring") {
    Stack stack({"stamps", 66, 1, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    const std::uint32_t nonce = status["board"]["nonce"];
    ClockStream stream = from_the_first(stack);
    CHECK(next_of<RecordedRestart>(stream).nonce == nonce);

    std::optional<RecordedExchange> last;
    for (int i = 0; i < 25; ++i) {
        const auto exchange = next_of<RecordedExchange>(stream);
        CHECK(exchange.nonce == nonce);
        CHECK(exchange.arrived - exchange.sent > exchange.answered - exchange.received);
        CHECK(exchange.arrived - exchange.sent < milliseconds(500));
        CHECK(exchange.answered >= exchange.received);
        CHECK(exchange.answered - exchange.received < milliseconds(50));
        if (last) CHECK(exchange.request > last->request);
        if (last) CHECK(exchange.sent > last->arrived);
        last = exchange;
    }
    // By the stamps of one exchange, the host time of the board's zero lies between these two.
    const std::int64_t earliest_ns = last->sent.ns - last->received.ns;
    for (int i = 0; i < 20; ++i) {
        const auto one_way = next_of<RecordedMessage>(stream);
        CHECK(one_way.nonce == nonce);
        const Duration delay{one_way.arrived.ns - one_way.departed.ns - earliest_ns};
        CHECK(delay > Duration{});
        CHECK(delay < milliseconds(500));
    }
    const auto output = next_of<RecordedOutput>(stream);
    const auto after = next_of<RecordedOutput>(stream);
    auto clock = OutputClock::create(OutputClockKind::realtime);
    REQUIRE(clock);
    CHECK(absolute(clock->offset() - after.minus_host) < milliseconds(10));
    CHECK(absolute(after.host - output.host - seconds(1)) < milliseconds(900));
    CHECK(after.uncertainty < milliseconds(10));

    std::string text;
    CHECK(stack.tool({"list"}, &text) == 0);
    CHECK_THAT(text, Catch::Matches("(.|\n)*clock +clock(.|\n)*"));
    CHECK(stack.tool({"tail", "clock", "--oldest", "-n", "200", "--json"}, &text) == 0);
    for (const auto* kind : {"exchange", "one_way", "board_restarted", "output"})
        CHECK_THAT(text, Catch::Contains("\"clock\":\"" + std::string(kind) + "\""));
    CHECK(stack.tool({"tail", "clock", "-n", "3"}, &text) == 0);
    CHECK_THAT(text, Catch::Contains("arrived_ns="));
}

TEST_CASE(
    "clock stamps: recorded for some seconds, until it is stopped, and never across a restart") {
    Stack stack({"record", 67, 1, 20, "",
                 "[[fault]]\nkind = \"board_reset\"\ncamera = \"cam0\"\nat_exposure = 260\n", ""});
    std::string text;
    const std::string exchanges = stack.log_path("x.csv");
    const std::string one_way = stack.log_path("y.csv");
    CHECK(stack.tool({"clock", "record", "--exchanges", exchanges}, &text) ==
          69);  // no service is running
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    CHECK(stack.tool({"clock", "record", "--seconds", "0.2", "--exchanges", "/nowhere/x.csv"},
                     &text) == 69);
    CHECK_THAT(text, Catch::Contains("/nowhere/x.csv"));

    CHECK(stack.tool(
              {"clock", "record", "--seconds", "2", "--exchanges", exchanges, "--oneway", one_way},
              &text) == 0);
    const auto rows = read_csv(exchanges, "h1_ns,m2_ns,m3_ns,h4_ns");
    CHECK(rows.size() > 10);
    CHECK(rows.size() < 40);
    check_exchanges(rows);
    const auto samples = read_csv(one_way, "m_ns,h_ns");
    CHECK(samples.size() > 200);
    for (std::size_t i = 1; i < samples.size(); ++i) CHECK(samples[i][0] > samples[i - 1][0]);
    CHECK_THAT(text, Catch::Contains(std::to_string(rows.size()) + " exchanges, " +
                                     std::to_string(samples.size()) + " one-way messages"));

    CHECK(stack.tool({"clock", "record", "--exchanges", exchanges}, &text) == 69);
    CHECK_THAT(text, Catch::Contains("none is overwritten"));

    const std::string second_file = stack.log_path("second.csv");
    const std::string third_file = stack.log_path("third.csv");
    Process stopped({program("versavis"), "--instance", "record", "clock", "record", "--exchanges",
                     second_file},
                    stack.log_path("stopped.log"));
    REQUIRE(stopped.wait_for_output("recording to", seconds(10)));
    auto stream = wait_for_stream<ClockStream>("clock", "record");
    const auto seen = next_of<RecordedExchange>(stream);
    stopped.signal(SIGINT);
    CHECK(stopped.wait(seconds(10)) == 0);
    const auto until_stopped = read_csv(second_file, "h1_ns,m2_ns,m3_ns,h4_ns");
    check_exchanges(until_stopped);
    REQUIRE_FALSE(until_stopped.empty());
    CHECK(until_stopped.back()[3] >= seen.arrived.ns);

    CHECK(stack.tool({"clock", "record", "--seconds", "60", "--exchanges", third_file}, &text) ==
          69);
    CHECK_THAT(text, Catch::Contains("board: restarted"));
    check_exchanges(read_csv(third_file, "h1_ns,m2_ns,m3_ns,h4_ns"));
    ClockStream all = from_the_first(stack);
    const auto first = next_of<RecordedRestart>(all);
    const auto second = next_of<RecordedRestart>(all);
    CHECK(first.nonce != second.nonce);
    CHECK(next_of<RecordedExchange>(all).nonce == second.nonce);
}

TEST_CASE(
    "clock stamps: TAI that the kernel does not know is refused, or forced and said to be UTC") {
    const std::int32_t kernel_offset_s = kernel_clocks()->kernel_state().tai_offset_s;
    Stack stack({"tai", 68, 1, 20, "", "", ""});
    std::ofstream file(stack.configuration_path(), std::ios::app);
    file << "[clock]\noutput = \"tai\"\n" << std::flush;
    if (kernel_offset_s == 0) {
        std::string text;
        CHECK(run({program("versavisd"), "--config", stack.configuration_path()},
                  stack.log_path("refused.log"), &text) == 69);
        CHECK_THAT(text, Catch::Contains("TAI") && Catch::Contains("force_tai = true"));
    }
    file << "force_tai = true\n" << std::flush;
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["clock"]["output"] == "tai");
    CHECK(status["clock"]["tai_offset_s"] == kernel_offset_s);
    CHECK(status["clock"]["tai_valid"] == (kernel_offset_s != 0));
    CHECK(status["clock"]["host_max_error_ns"].is_number_integer());
    CHECK(status["clock"]["output_steps"] == 0);
    auto stream = wait_for_stream<FrameStream>("cam0", "tai");
    auto frame = test::look(stream.next(seconds(5)));
    while (frame.found != test::Found::item) frame = test::look(stream.next(seconds(5)));
    auto clock = OutputClock::create(OutputClockKind::tai, true);
    REQUIRE(clock);
    CHECK(absolute(Duration{frame.time.ns - frame.data.host_time.ns} - clock->offset()) <
          milliseconds(1));
}
