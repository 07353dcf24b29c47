// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_reader.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds oldest_pulse = 900'000'000;
constexpr std::int64_t day_s = 86'400;
constexpr unsigned first_year_of_century =
    80;  // two digits from 80 on are of the 20th: GPS began then
constexpr std::size_t most_fields = 24;

struct Text {
    const char* begin = nullptr;
    std::size_t size = 0;
};

/// Digits from `from` on as a number. False: they are not all digits.
bool number(const Text& text, std::size_t from, std::size_t count, unsigned& out) {
    if (from + count > text.size) return false;
    out = 0;
    for (std::size_t i = from; i < from + count; ++i) {
        if (text.begin[i] < '0' || text.begin[i] > '9') return false;
        out = out * 10 + static_cast<unsigned>(text.begin[i] - '0');
    }
    return true;
}

int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

/// Exclusive-or of what lies between '$' and '*'.
bool checksum_right(const char* sentence, std::size_t size) {
    if (size < 4 || sentence[0] != '$' || sentence[size - 3] != '*') return false;
    unsigned sum = 0;
    for (std::size_t i = 1; i < size - 3; ++i) sum ^= static_cast<unsigned char>(sentence[i]);
    const int high = hex_digit(sentence[size - 2]);
    const int low = hex_digit(sentence[size - 1]);
    return high >= 0 && low >= 0 && static_cast<unsigned>(high * 16 + low) == sum;
}

std::size_t split(const char* sentence, std::size_t size, Text* fields) {
    std::size_t count = 0;
    fields[0] = {sentence + 1, 0};
    for (std::size_t i = 1; i < size - 3; ++i) {
        if (sentence[i] != ',') {
            ++fields[count].size;
        } else {
            if (++count == most_fields) return most_fields;
            fields[count] = {sentence + i + 1, 0};
        }
    }
    return count + 1;
}

/// The last three letters of "GPRMC" and the like.
bool is(const Text& name, const char* kind) {
    if (name.size != 5) return false;
    for (std::size_t i = 0; i < 3; ++i)
        if (name.begin[2 + i] != kind[i]) return false;
    return true;
}

/// "hhmmss" or "hhmmss.00".
bool time_of_day(const Text& text, std::int64_t& seconds) {
    unsigned hours = 0;
    unsigned minutes = 0;
    unsigned whole = 0;
    if (!number(text, 0, 2, hours) || !number(text, 2, 2, minutes) || !number(text, 4, 2, whole))
        return false;
    for (std::size_t i = 6; i < text.size; ++i)
        if (text.begin[i] != (i == 6 ? '.' : '0')) return false;
    if (hours > 23 || minutes > 59 || whole > 59) return false;
    seconds = hours * 3600 + minutes * 60 + whole;
    return true;
}

bool leap(unsigned year) { return (year % 4 == 0 && year % 100 != 0) || year % 400 == 0; }

/// Days since 1970. False: not a valid date.
bool days(unsigned year, unsigned month, unsigned day, std::int64_t& out) {
    constexpr unsigned before_month[] = {0,   31,  59,  90,  120, 151, 181,
                                         212, 243, 273, 304, 334, 365};
    if (year < 1970 || month < 1 || month > 12 || day < 1) return false;
    const unsigned leap_day = leap(year) ? 1 : 0;
    const unsigned length =
        before_month[month] - before_month[month - 1] + (month == 2 ? leap_day : 0);
    if (day > length) return false;
    const unsigned past = year - 1;
    const unsigned leap_days =
        past / 4 - past / 100 + past / 400 - (1969 / 4 - 1969 / 100 + 1969 / 400);
    out = std::int64_t{year - 1970} * 365 + leap_days + before_month[month - 1] +
          (month > 2 ? leap_day : 0) + day - 1;
    return true;
}

bool rmc(const Text* fields, std::size_t count, std::int64_t& day, std::int64_t& seconds) {
    unsigned parts[3] = {};
    if (count < 10 || fields[2].size != 1 || fields[2].begin[0] != 'A' || fields[9].size != 6)
        return false;
    for (std::size_t i = 0; i < 3; ++i)
        if (!number(fields[9], 2 * i, 2, parts[i])) return false;
    const unsigned year = parts[2] + (parts[2] < first_year_of_century ? 2000 : 1900);
    return time_of_day(fields[1], seconds) && days(year, parts[1], parts[0], day);
}

bool zda(const Text* fields, std::size_t count, std::int64_t& day, std::int64_t& seconds) {
    unsigned day_of_month = 0;
    unsigned month = 0;
    unsigned year = 0;
    if (count < 5 || fields[2].size != 2 || fields[3].size != 2 || fields[4].size != 4)
        return false;
    return number(fields[2], 0, 2, day_of_month) && number(fields[3], 0, 2, month) &&
           number(fields[4], 0, 4, year) && time_of_day(fields[1], seconds) &&
           days(year, month, day_of_month, day);
}

}  // namespace

bool nmea_utc(const char* sentence, std::size_t size, std::int64_t& utc_s) {
    if (!checksum_right(sentence, size)) return false;
    Text fields[most_fields];
    const std::size_t count = split(sentence, size, fields);
    std::int64_t day = 0;
    std::int64_t seconds = 0;
    const bool read = is(fields[0], "RMC")
                          ? rmc(fields, count, day, seconds)
                          : is(fields[0], "ZDA") && zda(fields, count, day, seconds);
    utc_s = day * day_s + seconds;
    return read;
}

void NmeaReader::begin(std::uint32_t baud) {
    *this = {};
    byte_duration_ = 10'000'000'000 / static_cast<Nanoseconds>(baud == 0 ? 1 : baud);
}

bool NmeaReader::take(std::uint8_t byte, Nanoseconds at, UtcLabel& label) {
    if (byte == '$') {
        began_ = at - byte_duration_;
        size_ = 0;
    } else if (size_ == 0) {
        return false;
    }
    if (byte == '\r' || byte == '\n') return finish(label);
    if (size_ == longest) {
        size_ = 0;  // no sentence is that long
        return false;
    }
    line_[size_++] = static_cast<char>(byte);
    return false;
}

bool NmeaReader::finish(UtcLabel& label) {
    const std::size_t size = size_;
    size_ = 0;
    std::int64_t utc_s = 0;
    if (!nmea_utc(line_, size, utc_s)) return false;
    const Nanoseconds pulse = newest_ <= began_ ? newest_ : before_;
    if (pulse > began_ || began_ - pulse >= oldest_pulse) return false;
    if (pulse == told_.pulse && utc_s == told_.utc_s) return false;
    label = told_ = {pulse, utc_s};
    return true;
}

}  // namespace versavis::firmware
