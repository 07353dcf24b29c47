// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_csv.hpp"

#include <catch2/catch.hpp>
#include <limits>
#include <sstream>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

const CsvColumns ab_c{{"a_ns", "b_ns"}, {"c_ns"}};

Expected<CsvTable> read_table(const std::string& text) {
    std::istringstream in(text);
    return read_csv(in, "x.csv", ab_c);
}

std::string error(const std::string& text) {
    const auto table = read_table(text);
    REQUIRE_FALSE(table);
    CHECK_FALSE(table.error().cure.empty());
    return table.error().message();
}

using Values = std::vector<std::int64_t>;

}  // namespace

TEST_CASE("clock_csv: columns are found by name, in any order, and others are ignored") {
    const auto table = read_table("note,b_ns,seq,a_ns\nhello there,2,0,1\n\"a, b\",-4,1,3\n");
    REQUIRE(table);
    CHECK(table->rows == 2);
    CHECK(table->columns[0] == Values{1, 3});
    CHECK(table->columns[1] == Values{2, -4});
    CHECK(table->columns[2].empty());
    CHECK(read_table("c_ns,b_ns,a_ns\n1,2,3\n")->columns[2] == Values{1});
}

TEST_CASE("clock_csv: what other programs write is read") {
    const Values one{1};
    const std::string text = GENERATE("a_ns,b_ns\r\n1,2\r\n",
                                      "\xEF\xBB\xBF"
                                      "a_ns,b_ns\n1,2",
                                      "\n\na_ns,b_ns\n\n   \n1,2\n\n", " a_ns ,\tb_ns\n 1 , 2 \n",
                                      "\"a_ns\",\"b_ns\"\n\"1\",\" 2\"\n");
    const auto table = read_table(text);
    REQUIRE(table);
    CHECK(table->rows == 1);
    CHECK(table->columns[0] == one);
    CHECK(table->columns[1] == Values{2});
}

TEST_CASE("clock_csv: the ends of the range of 64 bits are values, what is beyond is an error") {
    const auto table = read_table("a_ns,b_ns\n-9223372036854775808,9223372036854775807\n");
    REQUIRE(table);
    CHECK(table->columns[0][0] == std::numeric_limits<std::int64_t>::min());
    CHECK(table->columns[1][0] == std::numeric_limits<std::int64_t>::max());
    CHECK_THAT(error("a_ns,b_ns\n1,2\n9223372036854775808,1\n"),
               Contains("x.csv, line 3, column a_ns") && Contains("64 bits"));
}

TEST_CASE("clock_csv: a header without rows is an empty table, no header an error") {
    REQUIRE(read_table("a_ns,b_ns\n"));
    CHECK(read_table("a_ns,b_ns\n")->rows == 0);
    CHECK_THAT(error(""), Contains("x.csv") && Contains("is empty") && Contains("a_ns,b_ns"));
    CHECK_THAT(error("\n \r\n"), Contains("is empty"));
}

TEST_CASE("clock_csv: a missing column names those that are there") {
    CHECK_THAT(error("a_ns,h_ns,x\n1,2,3\n"),
               Contains("x.csv, line 1") && Contains("no column b_ns") && Contains("a_ns,h_ns,x"));
    CHECK_THAT(error("a_ns;b_ns\n1;2\n"), Contains("a_ns;b_ns") && Contains("by commas"));
    CHECK_THAT(error("A_NS,b_ns\n1,2\n"), Contains("no column a_ns"));
    CHECK_THAT(error("1,2\n3,4\n"), Contains("columns found: 1,2"));
    CHECK_THAT(error("a_ns,b_ns,a_ns\n1,2,3\n"), Contains("column a_ns appears twice"));
}

TEST_CASE("clock_csv: what is no whole number is named with line and column") {
    const std::string field =
        GENERATE("abc", "1.5", "1e9", "0x10", "+1", "1 2", "nan", "--1", "1_000", "-");
    CHECK_THAT(
        error("a_ns,b_ns\n1,2\n\n3," + field + "\n"),
        Contains("x.csv, line 4, column b_ns") && Contains("'" + field + "' is not an integer"));
}

TEST_CASE("clock_csv: an empty field and lines of another length are errors") {
    CHECK_THAT(error("a_ns,b_ns\n1,\n"), Contains("line 2, column b_ns: is empty"));
    CHECK_THAT(error("a_ns,b_ns\n,\n"), Contains("line 2, column a_ns: is empty"));
    CHECK_THAT(error("a_ns,b_ns\n1,2\n3\n"),
               Contains("line 3: 1 fields instead of 2") && Contains("column b_ns is missing"));
    CHECK_THAT(error("a_ns,b_ns\n1,2,3\n"), Contains("line 2: 3 fields instead of 2"));
    CHECK_THAT(error("a_ns,b_ns\n1,\"2\n"), Contains("line 2: a quote is not closed"));
    CHECK_THAT(error("\"a_ns,b_ns\n1,2\n"), Contains("line 1: a quote is not closed"));
}

TEST_CASE("clock_csv: bytes of no text neither crash nor reach the terminal") {
    const std::string message = error(std::string("a_ns,b_ns\n1,\x1b[2J\0\xFF\n", 18));
    CHECK_THAT(message, Contains("\\x1b[2J\\x00\\xff"));
    CHECK(error("a_ns,b_ns\n1," + std::string(100'000, 'x') + "\n").size() < 300);
}

TEST_CASE("clock_csv: a file that is not there, or is none, is an error") {
    const auto missing = read_csv("/nowhere/x.csv", ab_c);
    REQUIRE_FALSE(missing);
    CHECK_THAT(missing.error().message(), Contains("/nowhere/x.csv: cannot be read"));
    const auto directory = read_csv("/tmp", ab_c);
    REQUIRE_FALSE(directory);
    CHECK_THAT(directory.error().message(), Contains("/tmp: is a directory"));
}
