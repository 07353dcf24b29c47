// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_writer.hpp"

namespace versavis::firmware {

namespace {

constexpr std::int64_t day_s = 86'400;
constexpr std::int64_t year_2000_s = 946'684'800;

struct Date {
    unsigned year;  ///< since 2000
    unsigned month;
    unsigned day;
};

/// Of a day since 2000-01-01, before 2100: each fourth year is a leap year.
Date date_of(unsigned day) {
    constexpr unsigned four_years = 1461;
    constexpr std::uint8_t lengths[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    unsigned year = day / four_years * 4;
    day %= four_years;
    const auto year_length = [&year] { return year % 4 == 0 ? 366U : 365U; };
    for (; day >= year_length(); ++year) day -= year_length();
    unsigned month = 1;
    const auto length = [&] {
        return lengths[month - 1] + (month == 2 && year % 4 == 0 ? 1U : 0U);
    };
    for (; day >= length(); ++month) day -= length();
    return {year, month, day + 1};
}

/// Writes fields behind each other, and what closes a sentence.
class Line {
 public:
    explicit Line(char (&line)[longest_sentence]) : line_(line) {}

    void text(const char* text) {
        while (*text != 0) put(*text++);
    }
    void put(char character) { line_[size_++] = character; }
    void digits(unsigned value) {  // two of them
        put(static_cast<char>('0' + value / 10 % 10));
        put(static_cast<char>('0' + value % 10));
    }

    std::size_t finish() {
        unsigned sum = 0;
        for (std::size_t i = 1; i < size_; ++i) sum ^= static_cast<unsigned char>(line_[i]);
        const auto hex = [](unsigned digit) { return "0123456789ABCDEF"[digit & 15U]; };
        put('*');
        put(hex(sum >> 4U));
        put(hex(sum));
        text("\r\n");
        return size_;
    }

 private:
    char* line_;
    std::size_t size_ = 0;
};

void write_time(Line& line, std::int64_t utc_s) {
    const auto second = static_cast<unsigned>((utc_s - year_2000_s) % day_s);
    line.digits(second / 3600);
    line.digits(second / 60 % 60);
    line.digits(second % 60);
    line.text(".00");
}

void write_rmc(Line& line, std::int64_t utc_s, const Date& date) {
    write_time(line, utc_s);
    line.text(",A,0000.0000,N,00000.0000,E,0.00,0.00,");
    line.digits(date.day);
    line.digits(date.month);
    line.digits(date.year);
    line.text(",,,A");
}

void write_gga(Line& line, std::int64_t utc_s) {
    write_time(line, utc_s);
    line.text(",0000.0000,N,00000.0000,E,1,08,1.0,0.0,M,0.0,M,,");
}

void write_zda(Line& line, std::int64_t utc_s, const Date& date) {
    write_time(line, utc_s);
    line.put(',');
    line.digits(date.day);
    line.put(',');
    line.digits(date.month);
    line.text(",20");
    line.digits(date.year);
    line.text(",00,00");
}

struct Kind {
    const char* name;
    const char* unknown;  ///< its fields while the time is not known, as receivers send them
};

constexpr Kind kind_of(wire::TimeSentence sentence) {
    switch (sentence) {
        case wire::sentence_rmc: return {"RMC,", ",V,,,,,,,,,,N"};
        case wire::sentence_gga: return {"GGA,", ",,,,,0,,,,,,,,"};
        case wire::sentence_zda: break;
    }
    return {"ZDA,", ",,,,,"};
}

}  // namespace

std::size_t write_sentence(wire::TimeSentence sentence, const char (&talker)[2],
                           const std::int64_t* utc_s, char (&buffer)[longest_sentence]) {
    const Kind kind = kind_of(sentence);
    Line line(buffer);
    line.put('$');
    line.put(talker[0]);
    line.put(talker[1]);
    line.text(kind.name);
    if (utc_s == nullptr) {
        line.text(kind.unknown);
        return line.finish();
    }
    const Date date = date_of(static_cast<unsigned>((*utc_s - year_2000_s) / day_s));
    switch (sentence) {
        case wire::sentence_rmc: write_rmc(line, *utc_s, date); break;
        case wire::sentence_gga: write_gga(line, *utc_s); break;
        case wire::sentence_zda: write_zda(line, *utc_s, date); break;
    }
    return line.finish();
}

}  // namespace versavis::firmware
