// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_reader.hpp"

#include <cstring>

namespace versavis::firmware {

namespace {

constexpr Nanoseconds oldest_pulse = 900'000'000;
constexpr std::int64_t day_s = 86'400;
/// Two digits from here on are of the 20th century: GPS began then.
constexpr unsigned first_year_of_century = 80;
/// The last one that is read is the date of RMC.
constexpr std::size_t most_fields = 10;

struct Text {
    const char* begin;
    std::size_t size;
};

/// False: they are not all digits.
bool number(const char* digits, std::size_t count, unsigned& out) {
    out = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (digits[i] < '0' || digits[i] > '9') return false;
        out = out * 10 + static_cast<unsigned>(digits[i] - '0');
    }
    return true;
}

bool is_hex_digit(char c, unsigned value) {
    return c == "0123456789ABCDEF"[value] || c == "0123456789abcdef"[value];
}

/// Where the '*' is, if it is followed by the exclusive-or of what lies between it and '$'; else 0.
std::size_t checked_size(const char* sentence, std::size_t size) {
    std::size_t star = 0;
    unsigned sum = '$';  // of which nothing is left when it comes first
    while (star != size && sentence[star] != '*')
        sum ^= static_cast<unsigned char>(sentence[star++]);
    const bool right = star + 3 == size && sentence[0] == '$' &&
                       is_hex_digit(sentence[size - 2], sum >> 4U) &&
                       is_hex_digit(sentence[size - 1], sum & 0xFU);
    return right ? star : 0;
}

/// Fields that a sentence does not have are empty.
void split(const char* sentence, std::size_t size, Text (&fields)[most_fields]) {
    std::size_t count = 0;
    fields[0].begin = sentence + 1;
    for (std::size_t i = 1; i < size; ++i) {
        if (sentence[i] != ',') {
            ++fields[count].size;
        } else {
            if (++count == most_fields) return;
            fields[count].begin = sentence + i + 1;
        }
    }
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
    unsigned hours;
    unsigned minutes;
    unsigned whole;
    // A shorter one ends before what is no digit.
    if (!number(text.begin, 2, hours) || !number(text.begin + 2, 2, minutes) ||
        !number(text.begin + 4, 2, whole))
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

bool utc(const Text& time, unsigned year, unsigned month, unsigned day, std::int64_t& utc_s) {
    std::int64_t past_days;
    std::int64_t seconds;
    if (!days(year, month, day, past_days) || !time_of_day(time, seconds)) return false;
    utc_s = past_days * day_s + seconds;
    return true;
}

bool rmc(const Text* fields, std::int64_t& utc_s) {
    unsigned day;
    unsigned month;
    unsigned year;
    const char* date = fields[9].begin;
    if (fields[2].size != 1 || fields[2].begin[0] != 'A' || fields[9].size != 6 ||
        !number(date, 2, day) || !number(date + 2, 2, month) || !number(date + 4, 2, year))
        return false;
    return utc(fields[1], year + (year < first_year_of_century ? 2000 : 1900), month, day, utc_s);
}

bool zda(const Text* fields, std::int64_t& utc_s) {
    unsigned day;
    unsigned month;
    unsigned year;
    return fields[2].size == 2 && fields[3].size == 2 && fields[4].size == 4 &&
           number(fields[2].begin, 2, day) && number(fields[3].begin, 2, month) &&
           number(fields[4].begin, 4, year) && utc(fields[1], year, month, day, utc_s);
}

}  // namespace

bool nmea_utc(const char* sentence, std::size_t size, std::int64_t& utc_s) {
    Text fields[most_fields] = {};
    split(sentence, checked_size(sentence, size), fields);
    return is(fields[0], "RMC") ? rmc(fields, utc_s) : is(fields[0], "ZDA") && zda(fields, utc_s);
}

void NmeaReader::begin(std::uint32_t baud) {
    const std::uint32_t lines = lines_;
    *this = {};
    lines_ = lines;
    byte_duration_ = 10'000'000'000 / static_cast<Nanoseconds>(baud);
}

bool NmeaReader::take(std::uint8_t byte, Nanoseconds at) {
    if (complete_) size_ = 0;
    complete_ = false;
    if (byte == '$' || byte == '!') {
        began_ = at - byte_duration_;
        size_ = 0;
    } else if (size_ == 0) {
        return false;
    } else if (byte == '\r' || byte == '\n') {
        ++lines_;
        return complete_ = true;
    } else if (byte < ' ' || byte > '~' || size_ == sizeof line_) {
        size_ = 0;
        return false;
    }
    line_[size_++] = static_cast<char>(byte);
    return false;
}

void NmeaReader::copy_to(wire::Sentence& line) const {
    line.time_ns = began_;
    line.sequence = lines_;
    line.size = static_cast<std::uint8_t>(size_);
    std::memcpy(line.text, line_, size_);
}

bool NmeaReader::label(UtcLabel& label) {
    std::int64_t utc_s;
    if (!nmea_utc(line_, size_, utc_s)) return false;
    const Nanoseconds pulse = newest_ <= began_ ? newest_ : before_;
    if (pulse > began_ || began_ - pulse >= oldest_pulse) return false;
    if (pulse == reported_.pulse && utc_s == reported_.utc_s) return false;
    label = reported_ = {pulse, utc_s};
    return true;
}

}  // namespace versavis::firmware
