// SPDX-License-Identifier: BSD-3-Clause
#include "emulated_board.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "../../firmware/rp2040/pins.hpp"

namespace versavis::rig {

namespace {

using firmware::Nanoseconds;
using nlohmann::json;

constexpr Nanoseconds cycle_ns = 8;

/// Bytes take so long between the board and an owner in real time, each way.
constexpr Nanoseconds real_way = 300'000;

/// Less than the way: nothing that the host sends later can reach the board sooner than that. So
/// far it runs ahead of such an owner, and then what it sends is ready when it is due, however long
/// the emulation took.
constexpr Nanoseconds lead = 200'000;

/// The board ends its runs with a whole instruction or the entry of an exception. So far ahead it
/// hears of events around it, whose edges then reach its pins in their own cycle.
constexpr Nanoseconds longest_step = 32 * cycle_ns;

/// The cycle in which an instant is over.
std::int64_t cycle_of(Nanoseconds at) { return (at + cycle_ns - 1) / cycle_ns; }

std::string to_hex(std::span<const std::uint8_t> bytes) {
    return fmt::format("{:02x}", fmt::join(bytes, ""));
}

std::vector<std::uint8_t> from_hex(const std::string& text) {
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
        bytes.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
    return bytes;
}

/// GPIO that the owner sees, by their bit in Environment.
constexpr rp2040::SignalPin seen_pins[] = {
    {0, rp2040::pin_trigger0},
    {1, rp2040::pin_trigger0 + 1},
    {2, rp2040::pin_trigger0 + 2},
    {3, rp2040::pin_trigger0 + 3},
    {firmware::pin_light, rp2040::pin_light},
    {firmware::pin_sync, rp2040::pin_sync_output},
    {firmware::pin_test, rp2040::pin_test_output},
};

/// Where this program was built: no path of it may stand in what is installed.
std::filesystem::path build_directory() {
    return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path();
}

/// Where the parts that the firmware knows may be.
constexpr int i2c_addresses[] = {0x68, 0x69};

json wiring() {
    json watched = json::array();
    for (const rp2040::SignalPin& each : seen_pins) watched.push_back(each.pin);
    return {{"watch", watched},
            {"selects", {+rp2040::pin_spi_select0, +rp2040::pin_spi_select1}},
            {"i2c", i2c_addresses}};
}

json nothing() {
    return {{"inputs", json::array()}, {"usb", json::array()}, {"uart", json::array()}};
}

}  // namespace

std::string EmulatedChip::default_image() {
    return build_directory() / "firmware" / "versavis.uf2";
}

Expected<std::unique_ptr<EmulatedChip>> EmulatedChip::create(const std::string& image) {
    const std::string script = build_directory() / "emulator" / "lock_step.mjs";
    for (const std::string& file : {image, script})
        if (!std::filesystem::exists(file))
            return failure(file, "there is no such file",
                           "the emulated board runs where the project was built, after './dev demo "
                           "--board rp2040'");
    auto process =
        ChildProcess::start({"node", "--single-threaded", script, image, wiring().dump()},
                            ChildProcess::Errors::inherited);
    if (!process) {
        process.error().cure = "install nodejs";
        return Unexpected(process.error());
    }
    return std::unique_ptr<EmulatedChip>(new EmulatedChip(std::move(*process)));
}

json EmulatedChip::read() {
    std::size_t end = 0;
    while ((end = text_.find('\n')) == std::string::npos) {
        char buffer[16'384];
        const ssize_t size = ::recv(process_.socket(), buffer, sizeof buffer, 0);
        if (size <= 0) throw std::runtime_error("the emulated board has ended");
        text_.append(buffer, static_cast<std::size_t>(size));
    }
    json line = json::parse(text_.substr(0, end));
    text_.erase(0, end + 1);
    return line;
}

void EmulatedChip::write(const json& line) {
    const std::string text = line.dump() + "\n";
    for (std::size_t sent = 0; sent < text.size();) {
        const ssize_t size =
            ::send(process_.socket(), text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
        if (size <= 0) throw std::runtime_error("the emulated board has ended");
        sent += static_cast<std::size_t>(size);
    }
}

EmulatedBoard::EmulatedBoard(EmulatedChip& chip, firmware::Environment environment)
    : chip_(chip),
      environment_(std::move(environment)),
      pending_(std::make_unique<json>(nothing())),
      way_(environment_.next_event ? 0 : real_way) {
    chip_.write({{"start", true}});
    now_ = chip_.read().at("now").get<std::int64_t>() * cycle_ns;
}

EmulatedBoard::~EmulatedBoard() = default;

Nanoseconds EmulatedBoard::edge_time(Nanoseconds at) { return cycle_of(at) * cycle_ns; }

void EmulatedBoard::schedule_edge(const firmware::Edge& edge) {
    (*pending_)["inputs"].push_back(
        {rp2040::pin_of_input(edge.input), edge.level ? 1 : 0, cycle_of(edge.at)});
}

void EmulatedBoard::receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    (*pending_)["usb"].push_back({to_hex(bytes), cycle_of(at + way_)});
}

void EmulatedBoard::uart_receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    (*pending_)["uart"].push_back({to_hex(bytes), cycle_of(at)});
}

Nanoseconds EmulatedBoard::next_wake() const {
    return on_its_way_.empty() ? now_ : std::min(now_, on_its_way_.front().at);
}

void EmulatedBoard::consume(std::size_t size, Nanoseconds /*at*/) {
    transmitted_.erase(transmitted_.begin(),
                       transmitted_.begin() + static_cast<std::ptrdiff_t>(size));
}

void EmulatedBoard::run_until(Nanoseconds until) {
    const Nanoseconds target = environment_.next_event ? until : until + lead;
    while (now_ < until && !stopped_) step_to(target);
    deliver(until);
}

/// Or to the next event around the board.
void EmulatedBoard::step_to(Nanoseconds until) {
    if (!environment_.next_event) return run_to(until);
    const Nanoseconds event = environment_.next_event();
    const Nanoseconds reported = event - longest_step;
    run_to(std::clamp(reported, now_, until));
    deliver(now_);
    if (reported <= now_) environment_.fire(event);
}

/// To the host, what has arrived there at `at`.
void EmulatedBoard::deliver(Nanoseconds at) {
    for (; !on_its_way_.empty() && on_its_way_.front().at <= at; on_its_way_.pop_front()) {
        const auto& bytes = on_its_way_.front().bytes;
        transmitted_.insert(transmitted_.end(), bytes.begin(), bytes.end());
    }
}

/// Or to the first change of an output.
void EmulatedBoard::run_to(Nanoseconds until) {
    json command = std::exchange(*pending_, nothing());
    command["until"] = until / cycle_ns;
    command["reads"] = transmitted_.size() < link_capacity_;
    command["held"] = stuck_;
    command["i2c_held"] = i2c_held_;
    chip_.write(command);
    json answer = chip_.read();
    for (; answer.contains("transfer"); answer = chip_.read())
        answer_transfer(answer.at("transfer"));
    const auto reached = answer.at("now").get<std::int64_t>();
    now_ = reached * cycle_ns;
    // Less than a cycle cannot be run.
    if (reached >= until / cycle_ns) now_ = std::max(now_, until);
    take(answer);
}

void EmulatedBoard::answer_transfer(const json& asked) {
    firmware::ImuTransfer transfer;
    const auto bytes = from_hex(asked.at("bytes").get<std::string>());
    if (bytes.size() > sizeof transfer.bytes) throw std::runtime_error("too long a transfer");
    const bool spi = asked.contains("select");
    if (!spi)
        transfer.bus = asked.at("reads").get<bool>() ? firmware::ImuTransfer::Bus::i2c_read
                                                     : firmware::ImuTransfer::Bus::i2c_write;
    transfer.chip = asked.at(spi ? "select" : "address").get<std::uint8_t>();
    transfer.size = static_cast<std::uint8_t>(bytes.size());
    transfer.clock_hz = asked.at("hz").get<std::uint32_t>();
    std::copy(bytes.begin(), bytes.end(), transfer.bytes);
    std::vector<std::uint8_t> received(bytes.size(), 0xFF);
    const bool acknowledged =
        environment_.imu_transfer &&
        environment_.imu_transfer(asked.at("at").get<std::int64_t>() * cycle_ns, transfer,
                                  received);
    chip_.write({{"bytes", to_hex(received)}, {"acknowledged", acknowledged}});
}

void EmulatedBoard::take(const json& answer) {
    for (const json& packet : answer.at("usb"))
        on_its_way_.push_back({packet.at(0).get<std::int64_t>() * cycle_ns + way_,
                               from_hex(packet.at(1).get<std::string>())});
    take_pins(answer.at("pins"));
    const auto uart = from_hex(answer.at("uart").at(0).get<std::string>());
    if (!uart.empty() && environment_.uart_sent)
        environment_.uart_sent(now_, answer.at("uart").at(1).get<std::uint32_t>(), uart);
    if (!answer.contains("stopped")) return;
    stopped_ = true;
    bitten_ = answer.at("stopped") == "watchdog";
    if (environment_.reboot) environment_.reboot(answer.at("stopped") == "boot loader");
}

void EmulatedBoard::take_pins(const json& pins) {
    for (const json& change : pins) {
        const auto levels = change.at(1).get<std::uint32_t>();
        std::uint32_t seen = 0;
        for (const rp2040::SignalPin& each : seen_pins)
            seen |= (levels >> each.pin & 1U) << each.signal;
        if (seen == std::exchange(pins_, seen)) continue;
        if (environment_.outputs_changed)
            environment_.outputs_changed(change.at(0).get<std::int64_t>() * cycle_ns, seen);
    }
}

}  // namespace versavis::rig
