// SPDX-License-Identifier: BSD-3-Clause
#include "imu/vn100.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <deque>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "nanoseconds.hpp"
#include "recorded_reports.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;
using wire::BoardEventKind;

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr Nanoseconds base = 1'250 * us;  // of its own samples

std::uint32_t bits_of(float value) {
    std::uint32_t word = 0;
    std::memcpy(&word, &value, sizeof word);
    return word;
}

/// Bit by bit, as the manual says.
std::uint16_t slow_vn100_crc(const Bytes& bytes) {
    unsigned crc = 0;
    for (const unsigned byte : bytes)
        for (unsigned bit = 0x80; bit != 0; bit >>= 1U) {
            const bool carry = ((crc & 0x8000U) != 0) != ((byte & bit) != 0);
            crc = (crc << 1U ^ (carry ? 0x1021U : 0U)) & 0xFFFFU;
        }
    return static_cast<std::uint16_t>(crc);
}

std::string framed(const std::string& text) {
    unsigned sum = 0;
    for (const char c : text) sum ^= static_cast<unsigned char>(c);
    return fmt::format("${}*{:02X}\r\n", text, sum);
}

Bytes text_bytes(const std::string& text) { return {text.begin(), text.end()}; }

Bytes operator+(Bytes a, const Bytes& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// What a packet says, in the units of the part.
struct Packet {
    std::uint64_t startup = second;
    std::array<float, 3> accel{1, -2, 3};
    std::array<float, 3> gyro{0.5F, -0.25F, 0.125F};
    std::array<float, 3> magnetic{0.25F, -0.5F, 1};
    float temperature = 25.5F;
    float pressure = 100;
    std::array<std::uint8_t, 4> header{0xFA, 0x01, 0x01, 0x06};

    /// Its eleven floats, in the order in which they are sent.
    std::array<float*, 11> fields() {
        return {&accel[0],    &accel[1],    &accel[2],    &gyro[0],     &gyro[1], &gyro[2],
                &magnetic[0], &magnetic[1], &magnetic[2], &temperature, &pressure};
    }
    Bytes bytes() {
        Bytes out(header.begin(), header.end());
        for (unsigned i = 0; i < 8; ++i)
            out.push_back(static_cast<std::uint8_t>(startup >> 8U * i));
        for (const float* field : fields())
            for (unsigned i = 0; i < 4; ++i)
                out.push_back(static_cast<std::uint8_t>(bits_of(*field) >> 8U * i));
        const std::uint16_t crc = slow_vn100_crc({out.begin() + 1, out.end()});
        out.push_back(static_cast<std::uint8_t>(crc >> 8U));
        out.push_back(static_cast<std::uint8_t>(crc));
        return out;
    }
};

Bytes vn100_packet(std::uint64_t startup = second) {
    Packet packet;
    packet.startup = startup;
    return packet.bytes();
}

using Reports = test::RecordedReports;

struct Uart final : ImuUart {
    void set_baud(std::uint32_t wanted) override {
        baud = wanted;
        bauds.push_back(wanted);
    }
    void invert_transmitter(bool /*inverted*/) override {}
    void write(const std::uint8_t* data, std::size_t size) override {
        CHECK(size <= 80);
        sent.emplace_back(data, data + size);
    }
    std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override {
        if (waiting.empty()) return 0;
        auto& [bytes, complete] = waiting.front();
        const std::size_t size = std::min(capacity, bytes.size());
        REQUIRE(size > 0);
        std::copy_n(bytes.begin(), size, data);
        bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        received = complete - line_time(bytes.size());
        if (bytes.empty()) waiting.pop_front();
        return size;
    }
    Nanoseconds line_time(std::size_t size) const {
        return static_cast<Nanoseconds>(size) * 10 * second / baud;
    }

    std::uint32_t baud = 115'200;
    std::vector<std::uint32_t> bauds;
    std::vector<std::string> sent;
    std::deque<std::pair<Bytes, Nanoseconds>> waiting;
};

/// What each command is answered by.
std::string answer_to(const std::string& command) {
    return command.substr(1, command.rfind('*') - 1);
}

struct Vn100World {
    explicit Vn100World(std::uint32_t rate_millihertz, Nanoseconds begin = second,
                        unsigned options = wire::imu_data_ready)
        : now(begin) {
        imu.configure(
            {wire::ImuKind::vn100, 0, static_cast<std::uint8_t>(options), 0, rate_millihertz}, now);
    }

    void poll(Nanoseconds at) {
        now = at;
        wire::ImuSample sample{};
        while (imu.poll(now, sample)) samples.push_back(sample);
    }
    void receive(const Bytes& bytes, Nanoseconds complete) {
        uart.waiting.emplace_back(bytes, complete);
        poll(complete);
    }
    /// Bytes that begin at `begin`; the time when they end.
    Nanoseconds send(const Bytes& bytes, Nanoseconds begin) {
        const Nanoseconds end = begin + uart.line_time(bytes.size());
        receive(bytes, end);
        return end;
    }
    void answer(const std::string& text) { receive(text_bytes(framed(text)), now + ms); }
    void answer_last() { answer(answer_to(uart.sent.back())); }
    /// Until the board waits for the answer to that step.
    void reach(unsigned step) {
        poll(imu.next_wake());
        while (uart.sent.size() <= step) {
            const bool baud = uart.sent.size() == 6;
            answer_last();
            if (baud) poll(imu.next_wake());  // it settles
        }
    }
    void set_up() {
        reach(8);
        answer_last();
        REQUIRE(reports.events.size() == 1);
        REQUIRE(reports.events[0].kind == BoardEventKind::imu_ready);
        reports.events.clear();
        uart.sent.clear();
        uart.bauds.clear();
    }
    /// A sample with its edge; the packet leaves `delay` later.
    void sample(Nanoseconds edge, std::uint64_t startup, Nanoseconds delay = 400 * us) {
        imu.ready_edge(edge);
        send(vn100_packet(startup), edge + delay);
    }
    bool stamped() const { return (samples.back().flags & wire::imu_stamped) != 0; }

    Reports reports;
    Uart uart;
    Vn100 imu{1, uart, reports};
    Nanoseconds now;
    std::vector<wire::ImuSample> samples;
};

struct RunningVn100 : Vn100World {
    explicit RunningVn100(std::uint32_t rate_millihertz = 800'000,
                          unsigned options = wire::imu_data_ready)
        : Vn100World(rate_millihertz, second, options) {
        set_up();
    }
};

}  // namespace

TEST_CASE("vn100: the CRC of a packet is that of the manual's example, and of its description") {
    Bytes example{0xFA, 0x01, 0x08, 0x00, 0x93, 0x50, 0x2E, 0x42, 0x83,
                  0x3E, 0xF1, 0x3F, 0x48, 0xB5, 0x04, 0xBB, 0x92, 0x88};
    CHECK(vn100_crc(example.data() + 1, example.size() - 1) == 0);
    example[7] ^= 1U;
    CHECK(vn100_crc(example.data() + 1, example.size() - 1) != 0);
    CHECK(vn100_crc(example.data(), 0) == 0);
    std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same bytes each time
    for (std::size_t size = 1; size < 200; ++size) {
        Bytes bytes(size);
        for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
        REQUIRE(vn100_crc(bytes.data(), size) == slow_vn100_crc(bytes));
    }
}

TEST_CASE("vn100: floats become fixed point as if by floating point, and saturate") {
    const auto check = [](float value, unsigned bits) {
        const double exact = std::round(std::ldexp(double{value}, static_cast<int>(bits)));
        const auto expected = static_cast<std::int32_t>(
            std::clamp<double>(exact, -double{INT32_MAX}, double{INT32_MAX}));
        std::int32_t out = 12345;
        CAPTURE(value, bits);
        REQUIRE(fixed_point(bits_of(value), bits, out));
        REQUIRE(out == expected);
        REQUIRE(fixed_point(bits_of(-value), bits, out));
        REQUIRE(out == -expected);
    };
    for (const unsigned bits : {7U, 8U, 13U, 20U, 24U}) {
        for (int exponent = -126; exponent < 128; ++exponent)
            for (const float mantissa : {1.0F, 1.25F, 1.5F, 1.75F, 1.9999999F, 1.0000001F})
                check(std::ldexp(mantissa, exponent), bits);
        for (const float value : {0.0F, 1e-40F, 9.81F, 100.0F, 3e30F}) check(value, bits);
    }
    for (const std::uint32_t word : {0x7FC00000U, 0x7F800000U, 0xFF800000U, 0x7F800001U}) {
        std::int32_t out = 0;
        CHECK_FALSE(fixed_point(word, 20, out));  // no number, or infinite
    }
}

TEST_CASE("vn100: rates are 800 Hz by whole numbers, never slower than asked") {
    const auto [wanted, rate] = GENERATE(table<unsigned, unsigned>({{1'000, 1'000},
                                                                    {150'000, 160'000},
                                                                    {160'000, 160'000},
                                                                    {160'001, 200'000},
                                                                    {300'000, 400'000},
                                                                    {400'000, 400'000},
                                                                    {400'001, 800'000},
                                                                    {800'000, 800'000},
                                                                    {800'001, 800'000},
                                                                    {2'000'000, 800'000},
                                                                    {0, 1}}));  // no IMU at all
    CHECK(Vn100::true_rate(wanted) == rate);
    if (wanted != 0) CHECK(Vn100::true_rate(rate) == rate);
}

TEST_CASE("vn100: set up step by step, at a baud rate that carries its packets") {
    const auto [rate, baud, divider] =
        GENERATE(table<unsigned, unsigned, int>({{1'000, 115'200, 800},
                                                 {150'000, 115'200, 5},
                                                 {160'000, 115'200, 5},
                                                 {160'001, 921'600, 4},
                                                 {800'000, 921'600, 1}}));
    const std::vector<std::string> steps{"VNASY,0",
                                         "VNWRG,06,0",
                                         "VNWRG,75,0,8,01,0001",
                                         "VNWRG,76,0,8,01,0001",
                                         "VNWRG,77,0,8,01,0001",
                                         fmt::format("VNWRG,05,{}", baud),
                                         "VNWRG,32,3,0,0,0,1,1,0,100000,0",
                                         fmt::format("VNWRG,75,1,{},01,0601", divider),
                                         "VNASY,1"};
    Vn100World world(rate);
    for (std::size_t step = 0; step < steps.size(); ++step) {
        CAPTURE(step);
        if (step == 6) {
            CHECK(world.imu.next_wake() == world.now + 20 * ms);
            world.poll(world.imu.next_wake() - 1);  // not before it has settled
            CHECK(world.uart.sent.size() == 6);
        }
        if (step == 0 || step == 6) world.poll(world.imu.next_wake());
        REQUIRE(world.uart.sent.size() == step + 1);
        CHECK(world.uart.sent.back() == framed(steps[step]));
        CHECK(world.uart.bauds.size() == (step <= 5 ? 1U : 2U));
        CHECK(world.uart.baud == (step <= 5 ? 115'200 : baud));
        CHECK(world.imu.next_wake() == world.now + 300 * ms);
        CHECK(world.reports.events.empty());
        world.answer(steps[step]);
    }
    CHECK(world.reports.events ==
          std::vector<ReportedEvent>{{BoardEventKind::imu_ready, 1, world.now, 100, 0}});
    CHECK(world.imu.next_wake() ==
          world.now + 100 * ms + 20 * second * 1'000 / Vn100::true_rate(rate));
    world.poll(world.now + ms);
    CHECK(world.uart.sent.size() == steps.size());
    CHECK(world.imu.restarts() == 0);
}

TEST_CASE("vn100: it begins when the part has power for long enough, and only if it is chosen") {
    Vn100World early(100'000, 0);
    CHECK(early.imu.next_wake() == 300 * ms);
    early.poll(300 * ms - 1);
    CHECK(early.uart.sent.empty());
    early.poll(300 * ms);
    CHECK(early.uart.sent.size() == 1);
    Vn100World later(100'000, 300 * ms + 1);
    CHECK(later.imu.next_wake() == 300 * ms + 1);
    later.imu.configure({wire::ImuKind::none, 0, 0, 0, 0}, 2 * second);
    CHECK(later.imu.next_wake() == never);
    later.receive(vn100_packet(), 3 * second);
    CHECK(later.uart.sent.empty());
    CHECK(later.uart.waiting.size() == 1);  // it may be a GNSS receiver's
    Reports reports;
    Uart uart;
    Vn100 fresh(1, uart, reports);
    CHECK(fresh.next_wake() == never);
    wire::ImuSample sample{};
    CHECK_FALSE(fresh.poll(never - 1, sample));
    CHECK(uart.bauds.empty());
}

TEST_CASE("vn100: a command without an answer is silence, and begins anew after a second") {
    for (const unsigned step : {0U, 1U, 4U, 6U, 7U, 8U}) {
        Vn100World world(200'000);
        world.reach(step);
        const Nanoseconds asked = world.now;
        const std::uint32_t first = world.uart.bauds[0];
        world.poll(asked + 300 * ms - 1);
        CHECK(world.reports.events.empty());
        world.poll(asked + 300 * ms);
        CHECK(world.reports.events ==
              std::vector<ReportedEvent>{
                  {BoardEventKind::imu_silent, 1, world.now, 0, static_cast<int>(step)}});
        CHECK(world.imu.restarts() == 1);
        REQUIRE(world.imu.next_wake() == world.now + second);
        const std::size_t sent = world.uart.sent.size();
        world.poll(world.imu.next_wake() - 1);
        CHECK(world.uart.sent.size() == sent);
        world.poll(world.imu.next_wake());
        REQUIRE(world.uart.sent.size() == sent + 1);
        CHECK(world.uart.sent.back() == framed("VNASY,0"));
        // The part may talk at the other baud rate.
        CHECK(first == 115'200);
        CHECK(world.uart.baud == 921'600);
        world.poll(world.now + 300 * ms);
        world.poll(world.imu.next_wake());
        CHECK(world.uart.baud == 115'200);
    }
}

TEST_CASE("vn100: a part that changes its baud rate before it answers is asked again at that one") {
    Vn100World world(200'000);
    world.reach(5);
    const std::string command = world.uart.sent.back();
    CHECK(world.uart.bauds == std::vector<std::uint32_t>{115'200});
    world.poll(world.imu.next_wake() - 1);
    CHECK(world.uart.sent.size() == 6);
    world.poll(world.imu.next_wake());
    CHECK(world.uart.bauds == std::vector<std::uint32_t>{115'200, 921'600});
    REQUIRE(world.uart.sent.size() == 7);
    CHECK(world.uart.sent.back() == command);
    CHECK(world.reports.events.empty());
    CHECK(world.imu.next_wake() == world.now + 300 * ms);
    SECTION("it answers") {
        world.answer_last();
        CHECK(world.imu.next_wake() == world.now + 20 * ms);
        world.poll(world.imu.next_wake());
        CHECK(world.uart.sent.back().substr(0, 9) == "$VNWRG,32");
    }
    SECTION("it is silent all the same") {
        world.poll(world.imu.next_wake());
        CHECK(world.reports.events ==
              std::vector<ReportedEvent>{{BoardEventKind::imu_silent, 1, world.now, 0, 5}});
    }
}

TEST_CASE("vn100: where the baud rate stays, a part is asked for it once") {
    Vn100World world(100'000);
    world.reach(5);
    world.poll(world.imu.next_wake());
    CHECK(world.uart.sent.size() == 6);
    CHECK(world.reports.events ==
          std::vector<ReportedEvent>{{BoardEventKind::imu_silent, 1, world.now, 0, 5}});
}

TEST_CASE("vn100: a new configuration begins at the baud rate of the one before") {
    RunningVn100 fast(800'000);
    fast.imu.configure({wire::ImuKind::vn100, 0, 0, 0, 100'000}, fast.now);
    fast.poll(fast.now);
    CHECK(fast.uart.baud == 921'600);
    RunningVn100 slow(100'000);
    slow.imu.configure({wire::ImuKind::vn100, 0, 0, 0, 800'000}, slow.now);
    slow.poll(slow.now);
    CHECK(slow.uart.baud == 115'200);
    CHECK(slow.uart.sent == std::vector<std::string>{framed("VNASY,0")});
}

TEST_CASE("vn100: an error that the part reports is a failure, with its code") {
    const unsigned step = GENERATE(0U, 3U, 8U);
    Vn100World world(200'000);
    world.reach(step);
    world.answer("VNERR,0C");
    CHECK(world.reports.events ==
          std::vector<ReportedEvent>{
              {BoardEventKind::imu_failed, 1, world.now, '0' * 256 + 'C', static_cast<int>(step)}});
    CHECK(world.imu.next_wake() == world.now + second);
    world.answer("VNERR,0C");  // of nothing that was asked
    CHECK(world.reports.events.size() == 1);
}

TEST_CASE("vn100: only an intact answer to the command ends a step") {
    const auto step = GENERATE(0U, 1U, 8U);
    Vn100World world(200'000);
    world.reach(step);
    const std::string good = framed(answer_to(world.uart.sent.back()));
    const std::string other = step == 1 ? "VNASY,0" : "VNWRG,06,0";
    std::vector<std::string> wrong{framed(other),
                                   framed("VNYMR,+100.949,-006.786"),
                                   framed("VNER,0C"),
                                   framed("VNERRS,0"),
                                   framed("VNASX,0"),
                                   framed("VNWRX,06,0"),
                                   framed(""),
                                   framed("V"),
                                   "$\n",
                                   "$*\n",
                                   "$*0\n",
                                   "\r\n",
                                   good.substr(1),
                                   "#" + good.substr(1),
                                   good.substr(0, good.size() - 5) + "\r\n",  // no sum
                                   good.substr(0, good.size() - 3) + "\n"};   // one digit of it
    for (std::size_t i = 1; i + 2 < good.size(); ++i) {
        wrong.push_back(good);
        wrong.back()[i] = static_cast<char>(wrong.back()[i] ^ 1);
    }
    for (const std::string& text : wrong) {
        CAPTURE(text);
        world.receive(text_bytes(text), world.now + ms / 10);
        REQUIRE(world.uart.sent.size() == step + 1);
        REQUIRE(world.reports.events.empty());
    }
    world.receive(text_bytes("$junk" + good), world.now + ms / 10);
    CHECK(world.uart.sent.size() == (step < 8 ? step + 2 : 9));
    CHECK(world.reports.events.size() == (step < 8 ? 0 : 1));
}

TEST_CASE("vn100: an answer comes in pieces, or among packets, and has 64 characters at most") {
    Vn100World world(200'000);
    world.reach(1);
    const auto waits = [&world] { return world.uart.sent.size() == 2; };
    SECTION("byte by byte") {
        for (std::size_t step = 1; step < 5; ++step)
            for (const char c : framed(answer_to(world.uart.sent.back()))) {
                REQUIRE(world.uart.sent.size() == step + 1);
                world.receive({static_cast<std::uint8_t>(c)}, world.now + ms / 10);
            }
        CHECK(world.uart.sent.size() == 6);
    }
    SECTION("between packets") {
        world.receive(vn100_packet() + text_bytes(framed("VNWRG,06,0")) + vn100_packet(),
                      world.now + ms);
        CHECK_FALSE(waits());
        CHECK(world.samples.empty());
    }
    SECTION("64") {
        world.answer("VNWRG,06," + std::string(64 - 15, '0'));
        CHECK_FALSE(waits());
    }
    SECTION("65") {
        world.answer("VNWRG,06," + std::string(65 - 15, '0'));
        CHECK(waits());
        world.answer("VNWRG,06,0");
        CHECK_FALSE(waits());
    }
}

TEST_CASE("vn100: what arrived before it is asked does not count") {
    Vn100World world(200'000);
    world.receive(text_bytes("$VNA"), world.now - 1);
    world.poll(world.imu.next_wake());
    REQUIRE(world.uart.sent.size() == 1);
    world.answer("VNASY,0");
    CHECK(world.uart.sent.size() == 2);
    // Nor does what comes twice.
    world.imu.configure({wire::ImuKind::vn100, 0, 0, 0, 200'000}, 3 * second);
    world.now = 3 * second;
    world.answer("VNASY,0");
    CHECK(world.uart.sent.size() == 3);
    CHECK(world.uart.sent.back() == framed("VNASY,0"));
}

TEST_CASE("vn100: what a packet says") {
    RunningVn100 world;
    Packet packet;
    packet.accel = {1, -2, 3.5F};
    packet.gyro = {0.5F, -0.25F, 0.125F};
    packet.magnetic = {0.25F, -0.5F, 1};
    packet.temperature = -25.5F;
    packet.pressure = 101.5F;
    const Nanoseconds begin = world.now;
    world.send(packet.bytes(), begin);
    REQUIRE(world.samples.size() == 1);
    const wire::ImuSample& sample = world.samples[0];
    CHECK(sample.kind == wire::ImuKind::vn100);
    CHECK(sample.imu == 1);
    CHECK(sample.number == 0);
    CHECK(sample.flags == 0);
    CHECK(sample.time_ns == begin);
    CHECK(std::vector(sample.accel, sample.accel + 3) == std::vector{1 << 20, -(2 << 20), 7 << 19});
    CHECK(std::vector(sample.gyro, sample.gyro + 3) == std::vector{1 << 23, -(1 << 22), 1 << 21});
    CHECK(sample.magnetic[0] == 2'048);
    CHECK(sample.magnetic[1] == -4'096);
    CHECK(sample.magnetic[2] == 8'192);
    CHECK(sample.temperature == -3'264);
    CHECK(sample.pressure == 25'984);
}

TEST_CASE("vn100: what does not fit into a word stays at its ends") {
    RunningVn100 world;
    Packet packet;
    packet.magnetic = {3.9998779F, 4.5F, -4.5F};
    packet.temperature = 300;
    packet.pressure = 300;
    world.send(packet.bytes(), world.now);
    packet.magnetic = {-4, -4.0001221F, 4};
    packet.temperature = -300;
    packet.pressure = -1;
    packet.startup += static_cast<std::uint64_t>(base);
    world.send(packet.bytes(), world.now);
    REQUIRE(world.samples.size() == 2);
    CHECK(world.samples[0].magnetic[0] == 32'767);
    CHECK(world.samples[0].magnetic[1] == 32'767);
    CHECK(world.samples[0].magnetic[2] == -32'768);
    CHECK(world.samples[0].temperature == 32'767);
    CHECK(world.samples[0].pressure == 65'535);
    CHECK(world.samples[1].magnetic[0] == -32'768);
    CHECK(world.samples[1].magnetic[1] == -32'768);
    CHECK(world.samples[1].magnetic[2] == 32'767);
    CHECK(world.samples[1].temperature == -32'768);
    CHECK(world.samples[1].pressure == 0);
}

TEST_CASE("vn100: a packet with a float that is no number is sent, and says that the part failed") {
    for (std::size_t i = 0; i < 11; ++i) {
        RunningVn100 world;
        Packet packet;
        *packet.fields().at(i) = std::numeric_limits<float>::quiet_NaN();
        world.send(packet.bytes(), world.now);
        REQUIRE(world.samples.size() == 1);
        CHECK(world.samples[0].flags == wire::imu_self_test_failed);
        CHECK(world.imu.errors() == 1);
    }
}

TEST_CASE("vn100: packets are recognised by their header and CRC, wherever they begin") {
    RunningVn100 world;
    const Bytes good = vn100_packet();
    SECTION("byte by byte") {
        for (std::size_t i = 0; i < good.size(); ++i) {
            CHECK(world.samples.empty());
            world.receive({good[i]}, world.now + 11 * us);
        }
    }
    SECTION("after bytes of others") {
        world.receive(text_bytes("\r\nabc") + Bytes{0xFA, 0xFA, 0x01, 0xFA, 0x01, 0x01} + good,
                      world.now + ms);
    }
    SECTION("after a line") {
        world.receive(text_bytes(framed("VNYMR,1,2")) + good, world.now + ms);
    }
    SECTION("after a line without an end, of 64 bytes at least") {
        world.receive(text_bytes("$VNYM") + good, world.now + ms);
        CHECK(world.samples.empty());
        world.receive(text_bytes("."), world.now + ms);
        CHECK(world.samples.size() == 1);
        world.receive(text_bytes("$VNYMR") + vn100_packet(second + 1), world.now + ms);
        CHECK(world.samples.size() == 2);
        return;
    }
    SECTION("after damaged ones") {
        for (std::size_t i = 0; i < good.size(); ++i) {
            Bytes damaged = good;
            damaged[i] ^= 0x10U;
            world.receive(damaged, world.now + ms / 10);
            world.receive(text_bytes("\n"), world.now + ms / 10);
            CHECK(world.samples.empty());
        }
        // Those whose header is damaged are not known for packets.
        CHECK(world.imu.errors() == good.size() - 4);
        world.receive(good, world.now + ms);
    }
    CHECK(world.samples.size() == 1);
    for (std::size_t i = 0; i < 4; ++i) {
        Packet other;
        other.header.at(i) ^= 2U;
        const std::uint32_t errors = world.imu.errors();
        world.receive(other.bytes(), world.now + ms);
        CHECK(world.imu.errors() == errors);
    }
    CHECK(world.samples.size() == 1);
    CHECK(world.reports.events.empty());
}

TEST_CASE("vn100: while it is set up, packets are neither samples nor errors") {
    Vn100World world(200'000);
    world.reach(3);
    Bytes damaged = vn100_packet();
    damaged[20] ^= 1U;
    world.receive(vn100_packet(), world.now + ms);
    world.receive(damaged + text_bytes("\n"), world.now + ms);
    CHECK(world.samples.empty());
    CHECK(world.imu.errors() == 0);
    world.answer_last();
    CHECK(world.uart.sent.size() == 5);
}

TEST_CASE("vn100: a sample without an edge has the time of its packet's first byte") {
    const std::uint32_t rate = GENERATE(100'000U, 800'000U);
    RunningVn100 world(rate);
    const Nanoseconds begin = world.now;
    // Two at once, and the beginning of a third.
    const auto period = static_cast<std::uint64_t>(second * 1'000 / rate);
    const Bytes three =
        vn100_packet() + vn100_packet(second + period) + vn100_packet(second + 2 * period);
    const Nanoseconds end = world.send({three.begin(), three.begin() + 130}, begin);
    REQUIRE(world.samples.size() == 2);
    CHECK(std::abs(world.samples[0].time_ns - begin) <= 2);
    CHECK(std::abs(world.samples[1].time_ns - begin - world.uart.line_time(58)) <= 2);
    world.send({three.begin() + 130, three.end()}, end);
    REQUIRE(world.samples.size() == 3);
    CHECK(std::abs(world.samples[2].time_ns - begin - world.uart.line_time(116)) <= 2);
}

TEST_CASE("vn100: samples that were lost on the way are missing by number") {
    RunningVn100 world(400'000);  // every 2.5 ms
    std::uint64_t startup = 7 * second;
    const auto next = [&](std::int64_t since) {
        startup += static_cast<std::uint64_t>(since);
        world.send(vn100_packet(startup), world.now + 2 * base);
        return world.samples.back().number;
    };
    CHECK(next(0) == 0);  // the first: whatever its clock shows
    CHECK(next(2 * base) == 1);
    CHECK(next(4 * base) == 3);
    CHECK((world.samples.back().flags & wire::imu_overrun) != 0);
    CHECK(next(3 * base - 1) == 4);
    CHECK((world.samples.back().flags & wire::imu_overrun) == 0);
    CHECK(next(3 * base) == 6);  // rounded
    CHECK(next(20 * base) == 16);
    CHECK(next(base - 1) == 17);
    CHECK((world.samples.back().flags & wire::imu_overrun) == 0);
    CHECK(next(-3 * second) == 18);  // it began anew
    CHECK((world.samples.back().flags & wire::imu_overrun) == 0);
    CHECK(next(2 * base) == 19);
}

TEST_CASE("vn100: a sample has the time of the newest edge before its packet") {
    const Nanoseconds delay = GENERATE(Nanoseconds{1}, 400 * us, base - 1);
    RunningVn100 world;
    const Nanoseconds begin = 2 * second;
    for (int i = 0; i < 5; ++i) {
        const Nanoseconds edge = begin + i * base;
        world.sample(edge, second + static_cast<std::uint64_t>(i * base), delay);
        // The clocks of part and board are compared from the second one on.
        CHECK(world.stamped() == (i > 0));
        if (i > 0) CHECK(world.samples.back().time_ns == edge);
    }
    CHECK(world.samples.size() == 5);
}

TEST_CASE("vn100: a packet that comes twice is stamped once") {
    RunningVn100 world;
    const Nanoseconds edge = 2 * second;
    world.sample(edge, second);
    world.sample(edge + base, second + static_cast<std::uint64_t>(base));
    CHECK(world.stamped());
    world.send(vn100_packet(second + static_cast<std::uint64_t>(base)), edge + base + 900 * us);
    REQUIRE(world.samples.size() == 3);
    CHECK_FALSE(world.stamped());
}

TEST_CASE("vn100: without a data-ready line no sample is stamped by an edge") {
    RunningVn100 world(800'000, 0);
    for (int i = 0; i < 5; ++i) {
        world.sample(2 * second + i * base, second + static_cast<std::uint64_t>(i * base));
        CHECK_FALSE(world.stamped());
        CHECK(world.samples.back().time_ns == 2 * second + i * base + 400 * us);
    }
}

TEST_CASE("vn100: a packet that begins with an edge, or long after one, is not stamped by it") {
    RunningVn100 world(100'000);
    const auto sample = [&world](int i, Nanoseconds delay) {
        world.sample(2 * second + i * 8 * base, second + static_cast<std::uint64_t>(i * 8 * base),
                     delay);
        return world.stamped();
    };
    sample(0, 400 * us);
    CHECK(sample(1, 400 * us));
    CHECK(sample(2, base - 1));
    CHECK_FALSE(sample(3, base));
    CHECK_FALSE(sample(4, 400 * us));  // it is not compared with the one before
    CHECK(sample(5, 400 * us));
    CHECK_FALSE(sample(6, 0));
    CHECK(world.samples.back().time_ns == 2 * second + 48 * base);
    CHECK_FALSE(sample(7, 3 * base));
}

TEST_CASE("vn100: more bytes wait than there is room for") {
    RunningVn100 world;
    Bytes many;
    for (int i = 0; i < 8; ++i)
        many = many + vn100_packet(second + static_cast<std::uint64_t>(i * base));
    const Nanoseconds end = world.send({many.begin(), many.begin() + 50}, world.now);
    world.send({many.begin() + 50, many.end()}, end);
    CHECK(world.samples.size() == 8);
    CHECK(world.imu.errors() == 0);
}

TEST_CASE("vn100: an edge that the part's own clock does not confirm stamps nothing") {
    RunningVn100 world;
    std::uint64_t startup = second;
    Nanoseconds edge = 2 * second;
    world.sample(edge, startup);
    const auto next = [&](Nanoseconds by_board, Nanoseconds by_part) {
        edge += by_board;
        startup += static_cast<std::uint64_t>(by_part);
        world.sample(edge, startup);
        return world.stamped();
    };
    CHECK(next(base, base));
    CHECK(next(10 * base, 10 * base));
    CHECK(next(base + base / 2 - 1, base));
    CHECK_FALSE(next(base + base / 2, base));
    CHECK(next(base, base));
    CHECK(next(base - base / 2 + 1, base));
    CHECK_FALSE(next(base - base / 2, base));
    CHECK(next(base, base));
    CHECK_FALSE(next(base, second));
    CHECK(next(base, base));
    CHECK_FALSE(next(base, -second));
    CHECK(next(base, base));
}

TEST_CASE("vn100: echoes of an edge, up to 300 us after it, are no edges") {
    RunningVn100 world;
    world.sample(2 * second, second);
    world.imu.ready_edge(2 * second + base);
    world.imu.ready_edge(2 * second + base + 300 * us - 1);
    world.send(vn100_packet(second + static_cast<std::uint64_t>(base)),
               2 * second + base + 400 * us);
    CHECK(world.stamped());
    CHECK(world.samples.back().time_ns == 2 * second + base);
    world.imu.ready_edge(2 * second + 2 * base);
    world.imu.ready_edge(2 * second + 2 * base + 300 * us);
    world.send(vn100_packet(second + static_cast<std::uint64_t>(2 * base)),
               2 * second + 2 * base + 400 * us);
    CHECK(world.stamped());
    CHECK(world.samples.back().time_ns == 2 * second + 2 * base + 300 * us);
}

TEST_CASE("vn100: packets that are read late find their edges, up to fifteen edges later") {
    const int later = GENERATE(1, 14, 15, 16, 17);
    RunningVn100 world;
    const Nanoseconds begin = 2 * second;
    world.sample(begin, second);
    world.sample(begin + base, second + static_cast<std::uint64_t>(base));
    CHECK(world.stamped());
    for (int i = 2; i <= 2 + later; ++i) world.imu.ready_edge(begin + i * base);
    world.uart.waiting.emplace_back(vn100_packet(second + static_cast<std::uint64_t>(2 * base)),
                                    begin + 2 * base + 400 * us + world.uart.line_time(58));
    world.poll(begin + (3 + later) * base);
    REQUIRE(world.samples.size() == 3);
    CHECK(world.stamped() == (later <= 15));
    CHECK(world.samples.back().time_ns == begin + 2 * base + (later <= 15 ? 0 : 400 * us));
}

TEST_CASE("vn100: a part that falls silent is set up again, at the other baud rate first") {
    RunningVn100 world(400'000);
    const Nanoseconds end = world.send(vn100_packet(), world.now);
    const Nanoseconds patience = 150 * ms;  // and 20 periods
    CHECK(world.imu.next_wake() == end + patience);
    world.poll(end + patience - 1);
    CHECK(world.reports.events.empty());
    world.poll(end + patience);
    CHECK(world.reports.events ==
          std::vector<ReportedEvent>{{BoardEventKind::imu_silent, 1, world.now, 0, 0xFFFF}});
    CHECK(world.uart.sent.empty());
    CHECK(world.imu.next_wake() == world.now + second);
    world.send(vn100_packet(2 * second), world.now + ms);  // it is not running
    CHECK(world.samples.size() == 1);
    // Running again: the first number shows that at least one sample is missing.
    world.reports.events.clear();
    world.uart.sent.clear();
    world.set_up();
    world.send(vn100_packet(9 * second), world.now + ms);
    REQUIRE(world.samples.size() == 2);
    CHECK(world.samples.back().number == 2);
    CHECK(world.samples.back().flags == (wire::imu_overrun | wire::imu_repeated));
}

TEST_CASE("vn100: damaged packets alone are silence") {
    RunningVn100 world;
    Bytes damaged = vn100_packet();
    damaged[40] ^= 1U;
    const Nanoseconds until = world.imu.next_wake();
    for (Nanoseconds at = until - 10 * ms; at < until; at += ms)
        world.receive(damaged + text_bytes("\n"), at);
    CHECK(world.imu.next_wake() == until);
    CHECK(world.imu.errors() >= 10);
    world.poll(until);
    CHECK(world.reports.events.size() == 1);
}
