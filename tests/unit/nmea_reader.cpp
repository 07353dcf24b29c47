// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_reader.hpp"

#include <rapidcheck.h>

#include <catch2/catch.hpp>
#include <optional>
#include <string>
#include <vector>

using namespace versavis::firmware;

namespace {

constexpr Nanoseconds second = 1'000'000'000;
constexpr Nanoseconds ms = 1'000'000;

/// The sentence of these fields, with its checksum.
std::string sentence(const std::string& body) {
    unsigned sum = 0;
    for (const char c : body) sum ^= static_cast<unsigned char>(c);
    const char* digits = "0123456789ABCDEF";
    return "$" + body + "*" + digits[sum >> 4U] + digits[sum & 15U];
}

std::optional<std::int64_t> utc(const std::string& text) {
    std::int64_t seconds = 0;
    return nmea_utc(text.data(), text.size(), seconds) ? std::optional(seconds) : std::nullopt;
}

std::string rmc(const std::string& time, const std::string& date, const std::string& status = "A") {
    return sentence("GPRMC," + time + "," + status + ",4723.1,N,00832.4,E,0.02,31.6," + date +
                    ",,,A");
}

/// Sends the text so that its first byte begins at `begin`.
std::vector<UtcLabel> feed(NmeaReader& reader, const std::string& text, Nanoseconds begin) {
    std::vector<UtcLabel> labels;
    UtcLabel label;
    for (const char c : text) {
        begin += reader.byte_duration();
        if (reader.take(static_cast<std::uint8_t>(c), begin, label)) labels.push_back(label);
    }
    return labels;
}

}  // namespace

TEST_CASE("nmea_reader: seconds since 1970 of sentences as receivers send them") {
    CHECK(utc("$GPRMC,225446,A,4916.45,N,12311.12,W,000.5,054.7,191194,020.3,E*68") == 785'285'686);
    CHECK(utc("$GPZDA,201530.00,04,07,2002,00,00*60") == 1'025'813'730);
    CHECK(utc("$GPZDA,201530.00,04,07,2002,00,00*6F") == std::nullopt);
    CHECK(utc(rmc("000000.00", "010100")) == 946'684'800);
    CHECK(utc(rmc("235959.000", "311299")) == 946'684'799);
    CHECK(utc(sentence("GNZDA,000000,01,01,1970,00,00")) == 0);
    CHECK(utc(sentence("GNZDA,000000.00,01,01,2100,,")) == 4'102'444'800);
    CHECK(utc(rmc("120000", "010180")) ==
          315'576'000);  // two digits from 80 on are of the last century
    CHECK(utc(rmc("120000", "010179")) == 3'439'800'000);
}

TEST_CASE("nmea_reader: leap days are those of the calendar") {
    CHECK(utc(rmc("000000", "290200")) == 951'782'400);
    CHECK(utc(rmc("000000", "010300")) == 951'868'800);
    CHECK(utc(rmc("235959", "290224")) == 1'709'251'199);
    CHECK(utc(rmc("000000", "010324")) == 1'709'251'200);
    CHECK_FALSE(utc(rmc("000000", "290223")));
    CHECK_FALSE(utc(sentence("GPZDA,000000,29,02,2100,,")));
    CHECK(utc(sentence("GPZDA,000000,01,03,2100,,")) == 4'107'542'400);
}

TEST_CASE("nmea_reader: what is no time, or no good one, gives none") {
    CHECK_FALSE(utc(rmc("120000", "010120", "V")));
    CHECK_FALSE(utc(rmc("235960", "311216")));     // the leap second
    CHECK_FALSE(utc(rmc("120000.20", "010120")));  // between pulses
    CHECK_FALSE(utc(rmc("120000x00", "010120")));
    CHECK_FALSE(utc(rmc("240000", "010120")));
    CHECK_FALSE(utc(rmc("126000", "010120")));
    CHECK_FALSE(utc(rmc("12000", "010120")));
    CHECK_FALSE(utc(rmc("", "")));
    CHECK_FALSE(utc(rmc("120000", "000120")));
    CHECK_FALSE(utc(rmc("120000", "010020")));
    CHECK_FALSE(utc(rmc("120000", "011320")));
    CHECK_FALSE(utc(rmc("120000", "310420")));
    CHECK_FALSE(utc(sentence("GPGGA,120000,A,4723.1,N,00832.4,E,0.02,31.6,010120")));
    CHECK_FALSE(utc(sentence("GPRMC,120000,A")));
    CHECK_FALSE(utc(sentence("RMC,120000,A,4723.1,N,00832.4,E,0.02,31.6,010120")));
    CHECK_FALSE(utc(sentence("GPZDA,120000,01,01,69,,")));
    CHECK_FALSE(utc(sentence("GPZDA,120000,01,01,1969,,")));
    CHECK_FALSE(utc(sentence("GPRMC,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,")));
    CHECK_FALSE(utc(""));
    CHECK_FALSE(utc("$*"));
    CHECK_FALSE(utc("$*00"));
}

TEST_CASE("nmea_reader: any bytes at all do no harm, and a sentence after them is read") {
    CHECK(rc::check([](const std::vector<std::uint8_t>& junk) {
        NmeaReader reader;
        reader.begin(9600);
        reader.pulse(0);
        UtcLabel label;
        for (const std::uint8_t byte : junk) reader.take(byte, 50 * ms, label);
        const auto labels = feed(reader, "\r\n" + rmc("120000", "010120") + "\r\n", 100 * ms);
        RC_ASSERT(labels.size() == 1U);
    }));
    NmeaReader reader;
    reader.begin(9600);
    reader.pulse(0);
    CHECK(feed(reader, "$" + std::string(5000, 'A') + "\r\n", 0).empty());
    CHECK(feed(reader, rmc("120000", "010120") + "\r\n", 100 * ms).size() == 1);
}

TEST_CASE(
    "nmea_reader: a sentence names the pulse before it began, if that is young enough, and once") {
    NmeaReader reader;
    reader.begin(9600);
    const std::string line = rmc("120000", "010120") + "\r\n";
    CHECK(feed(reader, line, 10 * second).empty());  // no pulse at all
    reader.pulse(20 * second);
    auto labels = feed(reader, line, 20 * second + 899 * ms);
    REQUIRE(labels.size() == 1);
    CHECK(labels[0].pulse == 20 * second);
    CHECK(labels[0].utc_s == 1'577'880'000);
    // The other sentence of the same second says the same.
    CHECK(
        feed(reader, sentence("GPZDA,120000.00,01,01,2020,00,00") + "\r\n", 20 * second + 950 * ms)
            .empty());
    reader.pulse(30 * second);
    CHECK(feed(reader, line, 30 * second + 900 * ms).empty());
    // Its bytes are read after the next pulse came.
    reader.pulse(40 * second);
    reader.pulse(41 * second);
    labels = feed(reader, line, 40 * second + 880 * ms);
    REQUIRE(labels.size() == 1);
    CHECK(labels[0].pulse == 40 * second);
}
