// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_writer.hpp"

#include <catch2/catch.hpp>
#include <ctime>
#include <string>

#include "wire/limits.hpp"

using namespace versavis;
using namespace versavis::firmware;

namespace {

std::string sentence(wire::TimeSentence kind, const std::int64_t* utc_s,
                     const char (&talker)[2] = {'G', 'P'}) {
    char line[longest_sentence];
    return {line, write_sentence(kind, talker, utc_s, line)};
}

/// As the C library has it.
std::string formatted(std::int64_t utc_s, const char* format) {
    const std::time_t seconds = utc_s;
    std::tm utc{};
    gmtime_r(&seconds, &utc);
    char text[64];
    return {text, std::strftime(text, sizeof text, format, &utc)};
}

}  // namespace

TEST_CASE("nmea_writer: sentences that name a second") {
    const std::int64_t newyear = 1'798'761'600;
    CHECK(sentence(wire::sentence_rmc, &newyear) ==
          "$GPRMC,000000.00,A,0000.0000,N,00000.0000,E,0.00,0.00,010127,,,A*5B\r\n");
    CHECK(sentence(wire::sentence_zda, &newyear) == "$GPZDA,000000.00,01,01,2027,00,00*61\r\n");
    CHECK(sentence(wire::sentence_gga, &newyear) ==
          "$GPGGA,000000.00,0000.0000,N,00000.0000,E,1,08,1.0,0.0,M,0.0,M,,*55\r\n");
    CHECK(sentence(wire::sentence_zda, &newyear, {'G', 'N'}).substr(0, 7) == "$GNZDA,");
}

TEST_CASE("nmea_writer: a time that is not known is said as receivers without a fix say it") {
    CHECK(sentence(wire::sentence_rmc, nullptr) == "$GPRMC,,V,,,,,,,,,,N*53\r\n");
    CHECK(sentence(wire::sentence_gga, nullptr) == "$GPGGA,,,,,,0,,,,,,,,*66\r\n");
    CHECK(sentence(wire::sentence_zda, nullptr) == "$GPZDA,,,,,,*48\r\n");
}

TEST_CASE("nmea_writer: each second of a century has the date that the C library gives it") {
    // Not quite a day further each time: all times of day occur, and all days.
    for (std::int64_t utc_s = wire::limits::first_utc_s; utc_s <= wire::limits::last_utc_s;
         utc_s += 86'161) {
        const std::string rmc = sentence(wire::sentence_rmc, &utc_s);
        const std::string zda = sentence(wire::sentence_zda, &utc_s);
        if (rmc.substr(7, 9) != formatted(utc_s, "%H%M%S.00") ||
            rmc.substr(54, 6) != formatted(utc_s, "%d%m%y") ||
            zda.substr(7, 20) != formatted(utc_s, "%H%M%S.00,%d,%m,%Y"))
            FAIL(rmc << zda);
    }
}
