// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_reader.hpp"

#include <rapidcheck.h>

#include <catch2/catch.hpp>
#include <cctype>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis::firmware;
using namespace versavis::test;

namespace {

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

std::string zda(const std::string& time, const std::string& date) {
    return sentence("GPZDA," + time + "," + date + ",,");
}

/// As many digits as asked for.
std::string digits(unsigned number, std::size_t count) {
    const std::string all = std::to_string(number);
    return std::string(count > all.size() ? count - all.size() : 0, '0') + all;
}

/// Sends the text so that its first byte begins at `begin`.
std::vector<UtcLabel> feed(NmeaReader& reader, const std::string& text, Nanoseconds begin) {
    std::vector<UtcLabel> labels;
    UtcLabel label;
    for (const char c : text) {
        begin += reader.byte_duration();
        if (reader.take(static_cast<std::uint8_t>(c), begin) && reader.label(label))
            labels.push_back(label);
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

TEST_CASE("nmea_reader: every day of the calendar, and no other one") {
    using namespace std::chrono;
    const unsigned year_number = GENERATE(1970U, 1971U, 1972U, 1973U, 1999U, 2000U, 2001U, 2024U,
                                          2079U, 2099U, 2100U, 2101U, 2400U, 2401U, 9999U);
    for (unsigned m = 0; m <= 13; ++m)
        for (unsigned d = 0; d <= 32; ++d) {
            const year_month_day date{year(static_cast<int>(year_number)), month(m), day(d)};
            std::optional<std::int64_t> expected;
            if (date.ok()) expected = sys_seconds(sys_days(date)).time_since_epoch().count();
            const std::string written = digits(d, 2) + "," + digits(m, 2) + ",";
            CAPTURE(written, year_number);
            REQUIRE(utc(zda("000000", written + digits(year_number, 4))) == expected);
            if (year_number < 1980 || year_number > 2079) continue;
            REQUIRE(utc(rmc("000000", digits(d, 2) + digits(m, 2) +
                                          digits(year_number % 100, 2))) == expected);
        }
}

TEST_CASE("nmea_reader: every year since 1970, and the century of two digits") {
    using namespace std::chrono;
    CHECK_FALSE(utc(zda("000000", "31,12,1969")));
    CHECK_FALSE(utc(zda("000000", "01,01,0000")));
    for (int y = 1970; y < 2600; ++y) {
        const auto seconds = [y](unsigned m) {
            return sys_seconds(sys_days(year(y) / month(m) / 1)).time_since_epoch().count();
        };
        const std::string text = std::to_string(y);
        REQUIRE(utc(zda("000000", "01,01," + text)) == seconds(1));
        REQUIRE(utc(zda("000000", "01,03," + text)) == seconds(3));
        if (y < 1980 || y > 2079) continue;
        REQUIRE(utc(rmc("000000", "0101" + text.substr(2))) == seconds(1));
        REQUIRE(utc(rmc("000000", "0103" + text.substr(2))) == seconds(3));
    }
}

TEST_CASE("nmea_reader: every second of a day, and no other one") {
    for (unsigned part = 0; part < 100; ++part) {
        const auto time = [](unsigned hours, unsigned minutes, unsigned seconds) {
            return utc(
                zda(digits(hours, 2) + digits(minutes, 2) + digits(seconds, 2), "01,01,1970"));
        };
        CAPTURE(part);
        CHECK(time(part, 0, 0) == (part < 24 ? std::optional(part * 3600) : std::nullopt));
        CHECK(time(1, part, 2) == (part < 60 ? std::optional(3602 + part * 60) : std::nullopt));
        CHECK(time(0, 1, part) == (part < 60 ? std::optional(60 + part) : std::nullopt));
    }
}

TEST_CASE("nmea_reader: what is no time, or no good one, gives none") {
    CHECK_FALSE(utc(rmc("235960", "311216")));  // the leap second
    CHECK_FALSE(utc(rmc("", "")));
    CHECK_FALSE(utc(sentence("GPRMC,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,")));
    CHECK_FALSE(utc(sentence("GPZDA,120000")));
    CHECK_FALSE(utc(sentence("GPZDA,120000,01,01")));
    for (const char* status : {"V", "", "AA", "a"})
        CHECK_FALSE(utc(rmc("120000", "010120", status)));
    for (const char* date : {"01012", "0101200", "", "010120 "})
        CHECK_FALSE(utc(rmc("120000", date)));
    for (const char* date :
         {"1,01,2020", "010,01,2020", "01,010,2020", "001,01,2020", "01,1,2020", "01,001,2020",
          "01,01,20", "01,01,202", "01,01,20200", ",,", "01,01", "01"})
        CHECK_FALSE(utc(zda("120000", date)));
}

TEST_CASE("nmea_reader: only whole seconds, with as many zeros as a receiver likes") {
    for (const char* time : {"120001", "120001.", "120001.0", "120001.00", "120001.0000"})
        CHECK(utc(zda(time, "01,01,1970")) == 43'201);
    for (const char* time : {"12000", "1200", "120000.1", "120000.01", "120000.20", "120000x00",
                             "1200000", "120000,", "120000.0.", " 120000", "-12000", ""})
        CHECK_FALSE(utc(zda(time, "01,01,1970")));
}

TEST_CASE("nmea_reader: of a date and a time, each character is a digit") {
    const std::string time = "120000";
    const std::string date = "01,01,2020";
    for (const char bad : {'/', ':', ' ', 'A'}) {
        for (std::size_t i = 0; i < time.size(); ++i) {
            std::string damaged = time;
            damaged[i] = bad;
            CHECK_FALSE(utc(zda(damaged, date)));
            CHECK_FALSE(utc(rmc(damaged, "010120")));
        }
        for (std::size_t i = 0; i < date.size(); ++i) {
            if (date[i] == ',') continue;
            std::string damaged = date;
            damaged[i] = bad;
            CHECK_FALSE(utc(zda(time, damaged)));
        }
        for (std::size_t i = 0; i < 6; ++i) {
            std::string damaged = "010120";
            damaged[i] = bad;
            CHECK_FALSE(utc(rmc(time, damaged)));
        }
    }
}

TEST_CASE("nmea_reader: sentences of any talker, and of no other kind") {
    for (const char* name : {"GPZDA", "GNZDA", "XXZDA"})
        CHECK(utc(sentence(std::string(name) + ",000001,01,01,1970,,")) == 1);
    for (const char* name :
         {"GPZDX", "GPZXA", "GPXDA", "ZDA", "PZDA", "GGPZDA", "GPZDAA", "GP", ""})
        CHECK_FALSE(utc(sentence(std::string(name) + ",000001,01,01,1970,,")));
    for (const char* name : {"GPRMX", "GPRXC", "GPXMC", "RMC", "PRMC", "GPGGA"})
        CHECK_FALSE(utc(sentence(std::string(name) + ",000001,A,47,N,8,E,0,0,010120,,,A")));
    // The date is the last field that counts, however many follow.
    CHECK(utc(sentence("GPRMC,000001,A,47,N,8,E,0,0,010180")) == 315'532'801);
    CHECK(utc(sentence("GPRMC,000001,A,47,N,8,E,0,0,010180,,")) == 315'532'801);
    CHECK(utc(sentence("GPRMC,000001,A,47,N,8,E,0,0,010180" + std::string(40, ','))) ==
          315'532'801);
    CHECK_FALSE(utc(sentence("GPRMC,000001,A,47,N,8,E,0,0")));
}

TEST_CASE("nmea_reader: a checksum has two hexadecimal digits, and all must be right") {
    const std::string hex = "0123456789ABCDEFabcdef";
    for (const char first : {'A', 'a', 'p', 'Q'})  // between them, all digits are right ones
        for (char last = 'A'; last <= 'P'; ++last) {
            const std::string good = sentence(std::string{first, last} + "ZDA,000001,01,01,1970,,");
            for (const std::size_t at : {good.size() - 2, good.size() - 1})
                for (int c = 0; c < 256; ++c) {
                    std::string other = good;
                    other[at] = static_cast<char>(c);
                    const bool same = std::toupper(c) == good[at] && hex.find(other[at]) < 22;
                    REQUIRE(utc(other).has_value() == same);
                }
        }
    const std::string good = zda("000001", "01,01,1970");
    REQUIRE(utc(good));
    for (std::size_t i = 0; i + 3 < good.size(); ++i) {
        std::string damaged = good;
        damaged[i] = static_cast<char>(damaged[i] ^ 1);
        CHECK_FALSE(utc(damaged));
        CHECK_FALSE(utc(good.substr(0, i)));
        CHECK_FALSE(utc(good.substr(i + 1)));
    }
    CHECK_FALSE(utc(good + "0"));
    CHECK_FALSE(utc(good.substr(0, good.size() - 1)));
    CHECK_FALSE(utc(good.substr(0, good.size() - 2)));
    std::string other = good;
    other[good.size() - 3] = '#';  // in place of the star
    CHECK_FALSE(utc(other));
    for (const char* nothing : {"", "$", "*", "$*", "*$", "$*0", "$*00", "*00", "**0", "$$*00"})
        CHECK_FALSE(utc(nothing));
}

TEST_CASE("nmea_reader: any bytes at all do no harm, and a sentence after them is read") {
    CHECK(rc::check([](const std::vector<std::uint8_t>& junk) {
        NmeaReader reader;
        reader.begin(9600);
        reader.pulse(0);
        for (const std::uint8_t byte : junk) reader.take(byte, 50 * ms);
        const auto labels = feed(reader, "\r\n" + rmc("120000", "010120") + "\r\n", 100 * ms);
        RC_ASSERT(labels.size() == 1U);
    }));
    NmeaReader reader;
    reader.begin(9600);
    reader.pulse(0);
    CHECK(feed(reader, "$" + std::string(5000, 'A') + "\r\n", 0).empty());
    CHECK(feed(reader, rmc("120000", "010120") + "\r\n", 100 * ms).size() == 1);
}

TEST_CASE("nmea_reader: a line may end in either way, and begins with its sign") {
    const std::string line = rmc("120000", "010120");
    for (const std::string& text :
         {line + "\r\n", line + "\n", line + "\r", "A,*00\r\n" + line + "\r", "$GP" + line + "\n",
          "\n\r\n" + line + "\n\r\n"}) {
        NmeaReader reader;
        reader.begin(115'200);
        reader.pulse(0);
        CHECK(feed(reader, text, 100 * ms).size() == 1);
    }
    for (const std::string& text : {line, line.substr(1) + "\r\n", line + " \r\n",
                                    line.substr(0, 20) + "\r\n" + line.substr(20) + "\r\n"}) {
        NmeaReader reader;
        reader.begin(115'200);
        reader.pulse(0);
        CHECK(feed(reader, text, 100 * ms).empty());
    }
    NmeaReader reader;
    reader.begin(115'200);
    reader.pulse(0);
    CHECK(feed(reader, line + "\r\n", 100 * ms).size() == 1);
    // The sign of the one before does not count for the next.
    CHECK(feed(reader, rmc("120001", "010120").substr(1) + "\r\n", 200 * ms).empty());
}

TEST_CASE("nmea_reader: a sentence has at most 104 characters") {
    const std::string start = "GPZDA,120000,01,01,2020";
    for (const std::size_t size : {103U, 104U, 105U, 106U, 200U}) {
        const std::string line = sentence(start + std::string(size - start.size() - 4, ','));
        REQUIRE(line.size() == size);
        NmeaReader reader;
        reader.begin(115'200);
        reader.pulse(0);
        CHECK(feed(reader, line + "\r\n", 100 * ms).size() == (size <= 104 ? 1 : 0));
        CHECK(feed(reader, line + std::string(size, 'x') + "\r\n", 150 * ms).empty());
        CHECK(feed(reader, line.substr(1) + "\r\n", 160 * ms).empty());
        // The next one is read again.
        CHECK(feed(reader, rmc("120001", "010120") + "\r\n", 200 * ms).size() == 1);
    }
}

TEST_CASE("nmea_reader: the end of a long line is no sentence") {
    NmeaReader reader;
    reader.begin(115'200);
    reader.pulse(0);
    const std::string line = rmc("120000", "010120") + "\r\n";
    for (std::size_t size = 102; size < 108; ++size)
        CHECK(feed(reader, "$" + std::string(size, 'A') + line.substr(1), 100 * ms).empty());
    CHECK(feed(reader, line, 200 * ms).size() == 1);
}

TEST_CASE("nmea_reader: it begins anew with what it knows of pulses and bytes") {
    const std::string line = rmc("120000", "010120") + "\r\n";
    NmeaReader reader;
    CHECK(reader.byte_duration() == 0);
    reader.begin(1'200);
    CHECK(reader.byte_duration() == 8'333'333);
    reader.begin(9'600);
    CHECK(reader.byte_duration() == 1'041'666);
    reader.pulse(0);
    CHECK(feed(reader, line, 100 * ms).size() == 1);
    CHECK(feed(reader, line.substr(0, 10), 300 * ms).empty());
    reader.begin(921'600);
    CHECK(feed(reader, line.substr(10), 400 * ms).empty());
    CHECK(feed(reader, line, 500 * ms).empty());
    reader.pulse(0);
    CHECK(feed(reader, line, 500 * ms).size() == 1);  // reported once more
}

TEST_CASE("nmea_reader: which pulse a sentence names, to the nanosecond") {
    const std::string line = rmc("120000", "010120") + "\r\n";
    const auto named = [&line](const std::vector<Nanoseconds>& pulses, Nanoseconds begin) {
        NmeaReader reader;
        reader.begin(9'600);
        for (const Nanoseconds pulse : pulses) reader.pulse(pulse);
        const auto labels = feed(reader, line, begin);
        return labels.empty() ? std::nullopt : std::optional(labels[0].pulse);
    };
    CHECK(named({}, 0) == std::nullopt);
    CHECK(named({}, second / 2) == std::nullopt);
    CHECK(named({}, 5 * second) == std::nullopt);
    CHECK(named({second}, second) == second);
    CHECK(named({second}, second - 1) == std::nullopt);
    CHECK(named({second}, second + 900 * ms - 1) == second);
    CHECK(named({second}, second + 900 * ms) == std::nullopt);
    CHECK(named({second, 2 * second}, 2 * second) == 2 * second);
    CHECK(named({second, 2 * second}, 2 * second - 200 * ms) == second);
    CHECK(named({second, 2 * second}, 2 * second - 100 * ms) == std::nullopt);
    CHECK(named({second, 2 * second}, second - 1) == std::nullopt);
    CHECK(named({0, second, 2 * second}, second - 200 * ms) == std::nullopt);  // too long ago
}

TEST_CASE(
    "nmea_reader: another name for the same pulse is reported, and the same name for another") {
    NmeaReader reader;
    reader.begin(115'200);
    reader.pulse(second);
    CHECK(feed(reader, rmc("120000", "010120") + "\r\n", second + 10 * ms).size() == 1);
    CHECK(feed(reader, rmc("120000", "010120") + "\r\n", second + 50 * ms).empty());
    CHECK(feed(reader, rmc("120001", "010120") + "\r\n", second + 100 * ms).size() == 1);
    CHECK(feed(reader, rmc("120001", "010120") + "\r\n", second + 150 * ms).empty());
    reader.pulse(2 * second);
    CHECK(feed(reader, rmc("120001", "010120") + "\r\n", 2 * second + 10 * ms).size() == 1);
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

namespace {

struct TimedLine {
    Nanoseconds at;
    std::uint32_t sequence;
    std::string text;
};

/// Of the bytes, sent from 1 s on.
std::vector<TimedLine> lines(NmeaReader& reader, const std::string& bytes) {
    std::vector<TimedLine> found;
    Nanoseconds at = second;
    for (const char c : bytes) {
        at += reader.byte_duration();
        if (!reader.take(static_cast<std::uint8_t>(c), at)) continue;
        versavis::wire::Sentence line{};
        reader.copy_to(line);
        found.push_back({line.time_ns, line.sequence, std::string(line.text, line.size)});
    }
    return found;
}

}  // namespace

TEST_CASE("nmea_reader: each line, damaged ones too, with the time of its first bit") {
    NmeaReader reader;
    reader.begin(9'600);
    const std::string ubx("\xb5\x62\x01\x07$\x00!abc\x0d", 11);  // a binary message
    const auto found =
        lines(reader, "tail\r\n$GPGGA,1*00\r\n" + ubx + "!AIVDM,1\n\r\n$A$PUBX,00\r\n");
    REQUIRE(found.size() == 4);
    CHECK(found[0].text == "$GPGGA,1*00");
    CHECK(found[0].at == second + 6 * reader.byte_duration());
    CHECK(found[1].text == "!abc");  // nobody can tell
    CHECK(found[2].text == "!AIVDM,1");
    CHECK(found[3].text == "$PUBX,00");
    for (std::uint32_t i = 0; i < found.size(); ++i) CHECK(found[i].sequence == i + 1);
    reader.begin(115'200);
    CHECK(lines(reader, "$X\n").at(0).sequence == 5);
}
