// SPDX-License-Identifier: BSD-3-Clause
#include "keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "line_delays.hpp"

namespace versavis::daemon {

namespace {

using Field = wire::ConfigurationField;
namespace limits = wire::limits;

constexpr double ns_per_us = 1e3;
constexpr double longest_us = limits::longest_exposure_ns / ns_per_us;

constexpr double longest_shift_us = limits::longest_short_ns / ns_per_us;

/// Longest history of a ring: an hour, for which no machine has the memory.
constexpr double longest_history_s = 3600;

/// Delay of a board's own driver or buffer, with room for a filter at the input.
constexpr double slowest_board_ns = 100'000;

/// The wire has eight bits for it.
constexpr double glitch_step_us = wire::glitch_unit_ns / ns_per_us;
constexpr double longest_glitch_us = 255 * glitch_step_us;

/// Filter delay of an IMU: strong filters at low rates.
constexpr double longest_filter_us = 1e6;

/// A number as documents have it.
std::string in_words(double value) {
    const double exponent = std::floor(std::log10(value));
    const double digit = value / std::pow(10, exponent);
    if (digit == 1 && value >= 1e4) return fmt::format("10^{}", exponent);
    if (digit == std::round(digit) && value >= 1e6) return fmt::format("{} 10^{}", digit, exponent);
    return fmt::format("{:.10g}", value);
}

std::string in_words(double minimum, double maximum) {
    return in_words(minimum) + " to " + in_words(maximum);
}

std::string in_words(const std::string& text) { return fmt::format("`\"{}\"`", text); }

/// The value as a default; empty: none.
template <class Type>
std::string shown(const Type& value) {
    if constexpr (std::is_same_v<Type, bool>)
        return fmt::format("{}", value);
    else if constexpr (std::is_arithmetic_v<Type>)
        return in_words(static_cast<double>(value));
    else if constexpr (std::is_same_v<Type, std::string>)
        return in_words(value);
    else if constexpr (std::is_same_v<Type, std::vector<std::string>>)
        return "`[]`";
    else
        return "";
}

/// How the value of a key is read, and what is known of it.
template <class Part>
struct Value {
    std::function<void(TableReader&, const char* key, Part&)> read;
    std::string range;
    std::string default_value;
    Field field{};           ///< where the board has it
    double board_units = 0;  ///< for one of the key's; 0: the board has a number for each name

    /// A default that is not one value.
    Value usually(const char* words) && {
        default_value = words;
        return std::move(*this);
    }

    /// A range that depends on other keys.
    Value within(const char* words) && {
        range = words;
        return std::move(*this);
    }

    Value also(const char* words) && {
        range += std::string(", ") + words;
        return std::move(*this);
    }

    Value on_board(Field as, double units = 0) && {
        field = as;
        board_units = units;
        return std::move(*this);
    }
};

/// Of a type that is read without a range.
template <class Part, class Type>
Value<Part> plain(Type Part::*member, const char* range) {
    const auto read = [member](TableReader& reader, const char* key, Part& part) {
        reader.read(key, part.*member);
    };
    return {read, range, shown(Part().*member)};
}

template <class Part, class Flag>
Value<Part> flag(Flag Part::*member) {
    return plain(member, "true, false");
}

template <class Part, class Number>
Value<Part> number(Number Part::*member, double minimum, double maximum) {
    using Limit = std::conditional_t<std::is_integral_v<Number>, std::int64_t, double>;
    const auto read = [=](TableReader& reader, const char* key, Part& part) {
        reader.read(key, part.*member, static_cast<Limit>(minimum), static_cast<Limit>(maximum));
    };
    return {read, in_words(minimum, maximum), shown(Part().*member)};
}

/// The minimum follows from a key before; `range` says so.
template <class Part, class Number, class Minimum>
Value<Part> number(Number Part::*member, Minimum minimum, double maximum, const char* range) {
    const auto read = [=](TableReader& reader, const char* key, Part& part) {
        number(member, minimum(part), maximum).read(reader, key, part);
    };
    return {read, range, shown(Part().*member)};
}

template <class Part>
Value<Part> hexadecimal(std::uint16_t Part::*member) {
    constexpr unsigned most = 0xFFFF;
    return {number(member, 0, most).read, fmt::format("0 to 0x{:X}", most),
            fmt::format("`0x{:04X}`", Part().*member)};
}

/// So many numbers.
template <class Part>
Value<Part> numbers(std::vector<double> Part::*member, std::size_t count, const std::string& names,
                    double maximum) {
    const auto read = [=](TableReader& reader, const char* key, Part& part) {
        reader.read(key, part.*member, count, 0, maximum);
    };
    return {read, fmt::format("{}each {}", names, in_words(0, maximum)), ""};
}

template <class Part, class Choice>
Value<Part> choice(Choice Part::*member, const std::vector<std::pair<std::string, Choice>>& choices,
                   const char* difference = "") {
    const auto read = [=](TableReader& reader, const char* key, Part& part) {
        reader.choose<Choice>(key, part.*member, choices, difference);
    };
    std::vector<std::string> names;
    std::string usual;
    for (const auto& [name, value] : choices) {
        names.push_back(name);
        if (value == Part().*member) usual = in_words(name);
    }
    return {read, fmt::format("{}", fmt::join(names, ", ")), usual};
}

template <class Part>
struct Key {
    const char* name;
    Value<Part> value;
    const char* meaning;
};

template <class Part>
using Keys = std::vector<Key<Part>>;

/// Those of one table, in the order of the document.
template <class Part>
const Keys<Part>& keys();

template <>
const Keys<Configuration>& keys<Configuration>() {
    using Top = Configuration;
    static const Keys<Top> all{
        {"instance", plain(&Top::instance, "a name"),
         "distinguishes several services on one machine"},
        {"preset_directory", plain(&Top::preset_directory, "path").usually("as installed"),
         "directory of the camera presets"},
        {"state_directory", plain(&Top::state_directory, "path").usually("systemd's"),
         "measurements to reuse after a restart"},
        {"log_level",
         choice(&Top::log_level, {{"error", LogLevel::error},
                                  {"warning", LogLevel::warning},
                                  {"info", LogLevel::info},
                                  {"debug", LogLevel::debug}}),
         "of messages to journal or standard error"}};
    return all;
}

template <>
const Keys<BoardConfiguration>& keys<BoardConfiguration>() {
    using Board = BoardConfiguration;
    const auto read_delays = [](TableReader& reader, const char* key, Board& board) {
        auto delays = reader.below(key);
        if (!delays) return;
        delays->read("inputs", board.input_delay_ns, wire::camera_count, 0, slowest_board_ns);
        delays->read("outputs", board.output_delay_ns, wire::camera_count, 0, slowest_board_ns);
        delays->finish();
    };
    static const Keys<Board> all{
        {"link", plain(&Board::link, "`\"usb\"`, `\"unix:PATH\"`"),
         "how the trigger board is reached"},
        {"serial", plain(&Board::serial, "text"),
         "serial number of the board; empty: the first one found"},
        {"usb_vendor", hexadecimal(&Board::usb_vendor), "USB vendor id"},
        {"usb_product", hexadecimal(&Board::usb_product), "USB product id"},
        {"keep_configuration", flag(&Board::keep_configuration),
         "the board stores its configuration"},
        {"board_delay_ns",
         {read_delays, "each " + in_words(0, slowest_board_ns), "all 0"},
         "delays of the board's own inputs and outputs"}};
    return all;
}

template <>
const Keys<ClockConfiguration>& keys<ClockConfiguration>() {
    using Clock = ClockConfiguration;
    using clock::OutputClockKind;
    using clock::PpsLabels;
    using clock::SecondConflict;
    static const Keys<Clock> all{
        {"output",
         choice(&Clock::output, {{"realtime", OutputClockKind::realtime},
                                 {"tai", OutputClockKind::tai},
                                 {"monotonic_raw", OutputClockKind::monotonic_raw}}),
         "the clock of the published stamps"},
        {"force_tai", flag(&Clock::force_tai), "accept `output = \"tai\"` without a known offset"},
        {"exchange_rate_hz", number(&Clock::exchange_rate_hz, 1, 100),
         "how often board and host clock are compared"},
        {"align", flag(&Clock::align), "put grid points on whole seconds of the output clock"},
        {"max_slew_ppm", number(&Clock::max_slew_ppm, 0.1, 500),
         "limit for adjusting the grid while cameras run"},
        {"pps",
         choice(&Clock::pps,
                {{"off", PpsLabels::off}, {"host", PpsLabels::host}, {"nmea", PpsLabels::nmea}}),
         "stamp by PPS at the board instead of by messages over USB"},
        {"on_second_conflict",
         choice(&Clock::on_second_conflict, {{"flag", SecondConflict::flag},
                                             {"receiver", SecondConflict::receiver},
                                             {"host", SecondConflict::host}}),
         "which source of whole seconds to trust"}};
    return all;
}

Keys<CameraConfiguration> trigger_keys() {
    using Camera = CameraConfiguration;
    return {
        {"name", plain(&Camera::name, "a name, unique").usually(""), "name of its stream"},
        {"device", plain(&Camera::device, "text, unique").usually(""),
         "address, serial number or name of the camera"},
        {"trigger",
         choice(&Camera::trigger, {{"board", TriggerSource::board},
                                   {"free", TriggerSource::free_run},
                                   {"ptp", TriggerSource::ptp}}),
         "triggered by the board, free-running, or by PTP time"},
        {"output", number(&Camera::output, 0, wire::camera_count - 1).also("unique"),
         "trigger output of the board, and input of the exposure line"},
        {"master", plain(&Camera::master, "name of a camera").usually("").on_board(Field::master),
         "that camera's exposure line triggers this one"},
        {"rate_hz",
         number(&Camera::rate_hz, limits::slowest_camera_uhz / 1e6,
                limits::fastest_camera_uhz / 1e6)
             .on_board(Field::rate, 1e6),
         "frames per second; need not be whole"},
        {"phase_us",
         number(&Camera::phase_us, 0, longest_shift_us)
             .also("below the period")
             .on_board(Field::phase, ns_per_us),
         "shift of its grid against the other cameras"},
        {"exposure_us",
         number(&Camera::exposure_us, 0, longest_us)
             .usually("3000, or less")
             .also("within the period")
             .on_board(Field::exposure, ns_per_us),
         "expected until it is measured"},
        {"max_exposure_us",
         number(&Camera::max_exposure_us, limits::shortest_max_exposure_ns / ns_per_us, longest_us)
             .usually("the period")
             .on_board(Field::max_exposure, ns_per_us),
         "longer exposures are given up"},
        {"latency_us",
         number(&Camera::latency_us, 0, limits::longest_latency_ns / ns_per_us)
             .usually("by preset")
             .also("below the period")
             .on_board(Field::latency, ns_per_us),
         "trigger edge to start of exposure"},
        {"gap_us",
         number(&Camera::gap_us, 0, longest_shift_us)
             .also("below the period")
             .on_board(Field::gap, ns_per_us),
         "least pause between exposure and next trigger"},
        {"pulse_us",
         number(&Camera::pulse_us, limits::shortest_pulse_ns / ns_per_us,
                limits::longest_pulse_ns / ns_per_us)
             .usually("100, or less")
             .also("at most half the period")
             .on_board(Field::pulse, ns_per_us),
         "width of the trigger pulse"},
        {"trigger_inverted", flag(&Camera::trigger_inverted),
         "active-low pulse; the camera uses the falling edge"},
        {"strobe",
         choice(&Camera::strobe, {{"active_high", Strobe::active_high},
                                  {"active_low", Strobe::active_low},
                                  {"none", Strobe::none}}),
         "level of the exposure line"},
        {"preset", plain(&Camera::preset, "auto, or a name"), "how the camera is set up"},
        {"trigger_line", plain(&Camera::trigger_line, "text").usually("by preset"),
         "the camera's trigger input, as in TriggerSource"},
        {"strobe_line", plain(&Camera::strobe_line, "text").usually("by preset"),
         "the camera's exposure output, as in LineSelector"},
        {"strobe_input", plain(&Camera::strobe_input, "aux0, aux1").usually(""),
         "for `trigger = \"ptp\"`: input of the board for its line"},
        {"strobe_rising_us",
         numbers(&Camera::strobe_rising_us, 2, "[value, sigma], ", slowest_edge_us)
             .usually("by preset"),
         "delay of its rising edge"},
        {"strobe_falling_us",
         numbers(&Camera::strobe_falling_us, 2, "[value, sigma], ", slowest_edge_us)
             .usually("by preset"),
         "delay of its falling edge"},
        {"glitch_us",
         number(&Camera::glitch_us, glitch_step_us, longest_glitch_us)
             .on_board(Field::glitch, 1 / glitch_step_us),
         "shorter pulses on the exposure line are ignored"},
        {"exposure", choice(&Camera::exposure_by_pulse, {{"timed", false}, {"pulse", true}}),
         "`pulse`: exposes as long as the trigger pulse"}};
}

Keys<CameraConfiguration> frame_keys() {
    using Camera = CameraConfiguration;
    using pairing::Instant;
    const auto fewest_slots = [](const Camera& camera) { return camera.buffers + spare_slots; };
    return {
        {"buffers", number(&Camera::buffers, 2, 64), "frames that can be in transfer at a time"},
        {"slots",
         number(&Camera::slots, fewest_slots, 1024, "`buffers` + 8 to 1024")
             .usually("by `rate_hz`"),
         "frames in the ring"},
        {"history_s", number(&Camera::history_s, 0, longest_history_s).also("not with `slots`"),
         "how long frames stay readable"},
        {"history", choice(&Camera::history, {{"deep", true}, {"none", false}}),
         "`none`: only the two newest frames stay readable"},
        {"packet_size", number(&Camera::packet_size, 576, 16000).usually("the largest that passes"),
         "GigE Vision packet size, bytes"},
        {"receive",
         choice(&Camera::receive, {{"auto", ReceiveMode::automatic},
                                   {"socket", ReceiveMode::socket},
                                   {"packet", ReceiveMode::packet}}),
         "how GigE Vision packets are received"},
        {"latest_arrival_ms",
         number(&Camera::latest_arrival_ms, 1, 60000).usually("500, or less").also("less if fast"),
         "how late a frame may arrive"},
        {"on_unproved",
         choice(&Camera::on_unproved,
                {{"withhold", OnUnproved::withhold}, {"flag", OnUnproved::flag}}),
         "what happens to frames without proof"},
        {"camera_clock", flag(&Camera::camera_clock), "the camera's time stamps count as evidence"},
        {"stamp_instant",
         choice(&Camera::stamp_instant, {{"auto", Instant::unknown},
                                         {"start", Instant::start},
                                         {"middle", Instant::middle},
                                         {"end", Instant::end}}),
         "which instant the camera stamps"},
        {"check_exposure", flag(&Camera::check_exposure),
         "compare the camera's exposure time with the measured one"},
        {"chunks", flag(&Camera::chunks).usually("by exposure"),
         "the camera sends its exposure time with each frame"},
        {"keep_settings", flag(&Camera::keep_settings),
         "start from the camera's settings, not its defaults"},
        {"ptp", flag(&Camera::ptp), "the camera's clock follows PTP"},
        {"max_temperature_c", number(&Camera::max_temperature_c, 0, 200),
         "warn when the camera is hotter"},
        {"link_mbps", number(&Camera::link_mbps, 0, 1e6).usually("the interface's"),
         "speed of the network link"}};
}

template <>
const Keys<CameraConfiguration>& keys<CameraConfiguration>() {
    static const auto all = [] {
        Keys<CameraConfiguration> both = trigger_keys();
        for (auto& key : frame_keys()) both.push_back(std::move(key));
        return both;
    }();
    return all;
}

template <>
const Keys<AutoExposureConfiguration>& keys<AutoExposureConfiguration>() {
    using Control = AutoExposureConfiguration;
    static const Keys<Control> all{{"target", number(&Control::target, 0.01, 0.99),
                                    "target brightness, from 0 (black) to 1 (saturated)"},
                                   {"percentile", number(&Control::percentile, 0, 100),
                                    "percentile of the pixels taken as brightness; 0: mean"},
                                   {"min_us",
                                    number(&Control::min_us, 1, longest_us)
                                        .usually("50, at most `max_us`")
                                        .within("1 to `max_us`"),
                                    "shortest exposure"},
                                   {"max_us",
                                    number(&Control::max_us, 1, longest_us)
                                        .usually("`max_exposure_us`")
                                        .within("1 to `max_exposure_us`"),
                                    "longest exposure"},
                                   {"largest_step", number(&Control::largest_step, 1.01, 10),
                                    "largest factor from one exposure to the next"},
                                   {"delay_frames", number(&Control::delay_frames, 0, 10),
                                    "frames until a new exposure takes effect"}};
    return all;
}

template <>
const Keys<ImuConfiguration>& keys<ImuConfiguration>() {
    using Imu = ImuConfiguration;
    std::vector<std::pair<std::string, const imu::ImuModel*>> models;
    double fastest_hz = 0;
    unsigned strongest_filter = 0;
    for (const std::string& name : imu::model_names()) {
        const imu::ImuModel* model = imu::find_model(name);
        models.emplace_back(name, model);
        fastest_hz = std::max(fastest_hz, model->fastest_hz);
        strongest_filter = std::max<unsigned>(strongest_filter, model->strongest_filter);
    }
    static const Keys<Imu> all{
        {"name", plain(&Imu::name, "a name, unique"), "name of its stream"},
        {"model",
         choice(&Imu::model, models,
                "The part's label says ADIS16448BMLZ or ADIS16448AMLZ; only the B sends a checksum")
             .within("adis164.., icm42688p, bmi088, vn100")
             .on_board(Field::imu_kind),
         "the part"},
        {"bus", choice(&Imu::bus, {{"spi", ImuBus::spi}, {"i2c", ImuBus::i2c}}),
         "bus that connects the part; not for the vn100"},
        {"i2c_address", number(&Imu::i2c_address, 0, 0xFF).usually("0x68").within("0x68, 0x69"),
         "its address, with `bus = \"i2c\"`"},
        {"rate_hz",
         number(&Imu::rate_hz, limits::slowest_imu_millihertz / 1e3, fastest_hz)
             .within("1 to the fastest of the part")
             .on_board(Field::imu_rate, 1e3),
         "samples per second"},
        {"data_ready", flag(&Imu::data_ready).on_board(Field::imu_options),
         "data-ready line wired: it paces and timestamps samples"},
        {"accel_ready", flag(&Imu::accel_ready),
         "the accelerometer's own line is wired, too; bmi088 only"},
        {"filter",
         number(&Imu::filter, 0, strongest_filter)
             .within("0 to the strongest of the part")
             .on_board(Field::imu_filter, 1),
         "strength of the part's own filter"},
        {"history_s", number(&Imu::history_s, 0, longest_history_s).usually("16384 samples"),
         "how long samples stay readable; 128 bytes each"},
        {"filter_delay_us", number(&Imu::filter_delay_us, 0, longest_filter_us).usually("by part"),
         "delay of that filter; 0: timestamps are not corrected"}};
    return all;
}

template <>
const Keys<IlluminationConfiguration>& keys<IlluminationConfiguration>() {
    using Light = IlluminationConfiguration;
    const auto shortest_on = [](const Light& light) {
        return limits::shortest_light_ns / ns_per_us + light.lead_us;
    };
    static const Keys<Light> all{
        {"cameras", plain(&Light::cameras, "names of cameras").on_board(Field::cameras),
         "cameras that need light; empty: no light"},
        {"lead_us",
         number(&Light::lead_us, 0, limits::longest_lead_ns / ns_per_us)
             .on_board(Field::lead, ns_per_us),
         "how long the light leads the exposure"},
        {"max_on_us",
         number(&Light::max_on_us, shortest_on, limits::longest_light_ns / ns_per_us,
                "10 + `lead_us` to 10^6")
             .on_board(Field::max_on, ns_per_us),
         "longest time on"},
        {"duty_percent", number(&Light::duty_percent, 0.0001, 100).on_board(Field::duty, 1e4),
         "largest share of the time on"},
        {"inverted", flag(&Light::inverted), "the output is low while the light is on"}};
    return all;
}

template <>
const Keys<PortConfiguration>& keys<PortConfiguration>() {
    using Ports = PortConfiguration;
    static const Keys<Ports> all{
        {"inputs", plain(&Ports::inputs, "some of pps, aux0, aux1, sync").on_board(Field::inputs),
         "inputs whose edges become events"},
        {"falling", plain(&Ports::falling, "some of `inputs`"), "inputs whose falling edge counts"},
        {"imu_output", flag(&Ports::imu_output), "serve the IMU to a flight controller"},
        {"nmea", flag(&Ports::nmea), "a GNSS receiver at the UART labels the PPS pulses"},
        {"nmea_baud",
         number(&Ports::nmea_baud, limits::slowest_nmea_baud, limits::fastest_nmea_baud)
             .on_board(Field::nmea_baud, 1),
         "its baud rate"},
        {"test", plain(&Ports::test, "name of a camera or an IMU").on_board(Field::test),
         "what the test output shows"},
        {"test_rate_hz",
         number(&Ports::test_rate_hz, 0, fastest_test_hz)
             .within("0 (none), 0.1 to 10^4")
             .on_board(Field::test_rate, 1e3),
         "test pulses at this fixed rate instead"},
        {"test_output",
         choice(&Ports::test_output, test_outputs)
             .within("test, sync, trigger0 to trigger3")
             .on_board(Field::test_output),
         "output for these pulses"},
        {"sync_rate_hz",
         number(&Ports::sync_rate_hz, 0, fastest_sync_hz)
             .within("0 (none), 0.1 to 10")
             .on_board(Field::sync_rate, 1e6),
         "pulses at the sync output, on the grid"},
        {"follow_sync", flag(&Ports::follow_sync), "the grid follows another board's sync pulses"},
        {"pulse_us",
         number(&Ports::pulse_us, limits::shortest_pulse_ns / ns_per_us,
                limits::longest_pulse_ns / ns_per_us)
             .usually("100, or less")
             .also("at most half the period"),
         "width of sync and test pulses"}};
    return all;
}

template <>
const Keys<TimeOutputConfiguration>& keys<TimeOutputConfiguration>() {
    using Output = TimeOutputConfiguration;
    std::vector<std::pair<std::string, const TimeOutputModel*>> models;
    for (const TimeOutputModel& model : time_output_models())
        models.emplace_back(model.name, &model);
    constexpr double ns_per_ms = 1e6;
    constexpr double longest_delay_us = limits::longest_time_delay_ns / ns_per_us;
    static const Keys<Output> all{
        {"name", plain(&Output::name, "a name, unique"), "its name in status and events"},
        {"model", choice(&Output::model, models), "what is connected"},
        {"output", choice(&Output::output, test_outputs).within("test, sync, trigger0 to trigger3"),
         "where the pulses leave"},
        {"pulse_ms",
         number(&Output::pulse_ms, limits::shortest_time_pulse_ns / ns_per_ms,
                limits::longest_time_pulse_ns / ns_per_ms),
         "width of the pulses"},
        {"pulse_inverted", flag(&Output::pulse_inverted), "the pulses are low"},
        {"delay_us",
         number(&Output::delay_us, -longest_delay_us, longest_delay_us).within("-10^5 to 10^5"),
         "from the second to the pulse; negative: before it"},
        {"sentences", plain(&Output::sentences, "some of RMC, GGA, ZDA").usually("`[\"RMC\"]`"),
         "that follow each pulse; empty: only pulses"},
        {"talker", plain(&Output::talker, "two letters"), "that begins them, as in `$GPRMC`"},
        {"baud", number(&Output::baud, limits::slowest_time_baud, limits::fastest_time_baud),
         "of the sentences"},
        {"serial_inverted", flag(&Output::serial_inverted).usually("by model"),
         "the line rests low, as RS-232 does"},
        {"sentence_delay_ms", number(&Output::sentence_delay_ms, 0, limits::last_sentence_ms),
         "from the pulse to the first sentence"},
        {"holdover_s", number(&Output::holdover_s, 1, limits::longest_holdover_s),
         "how long the board goes on without the service"}};
    return all;
}

template <>
const Keys<MemoryConfiguration>& keys<MemoryConfiguration>() {
    using Memory = MemoryConfiguration;
    static const Keys<Memory> all{
        {"lock", flag(&Memory::lock), "keep all memory of the service, rings included, in RAM"},
        {"sealed", flag(&Memory::sealed), "nobody, not even the service, can truncate a ring"}};
    return all;
}

/// Calls `visit` with the title and the keys of each table.
template <class Visit>
void for_each_table(Visit visit) {
    visit("", keys<Configuration>());
    visit("[board]", keys<BoardConfiguration>());
    visit("[clock]", keys<ClockConfiguration>());
    visit("[[camera]]", keys<CameraConfiguration>());
    visit("[camera.auto_exposure]", keys<AutoExposureConfiguration>());
    visit("[[imu]]", keys<ImuConfiguration>());
    visit("[illumination]", keys<IlluminationConfiguration>());
    visit("[ports]", keys<PortConfiguration>());
    visit("[[time_output]]", keys<TimeOutputConfiguration>());
    visit("[memory]", keys<MemoryConfiguration>());
}

}  // namespace

template <class Part>
void read_keys(TableReader& reader, Part& part) {
    for (const Key<Part>& key : keys<Part>()) key.value.read(reader, key.name, part);
}
template void read_keys(TableReader&, Configuration&);
template void read_keys(TableReader&, BoardConfiguration&);
template void read_keys(TableReader&, ClockConfiguration&);
template void read_keys(TableReader&, CameraConfiguration&);
template void read_keys(TableReader&, AutoExposureConfiguration&);
template void read_keys(TableReader&, ImuConfiguration&);
template void read_keys(TableReader&, IlluminationConfiguration&);
template void read_keys(TableReader&, PortConfiguration&);
template void read_keys(TableReader&, TimeOutputConfiguration&);
template void read_keys(TableReader&, MemoryConfiguration&);

std::vector<KeyDescription> describe_keys() {
    std::vector<KeyDescription> all;
    for_each_table([&](const char* table, const auto& keys) {
        for (const auto& [name, value, meaning] : keys)
            all.push_back({table, name, value.default_value, value.range, meaning});
    });
    return all;
}

std::optional<BoardKey> find_key(wire::ConfigurationField field) {
    std::optional<BoardKey> found;
    for_each_table([&](const char* /*table*/, const auto& keys) {
        for (const auto& key : keys)
            if (key.value.field == field) found = {key.name, key.value.board_units};
    });
    return found;
}

}  // namespace versavis::daemon
