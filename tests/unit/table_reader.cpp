// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/table_reader.hpp"

#include <sys/stat.h>

#include <catch2/catch.hpp>

#include "../support/message_table.hpp"
#include "../support/temporary_directory.hpp"

using namespace versavis;
using test::accepted;

namespace {

/// From the place in the file on, or the whole file's from its name on; empty: it is read.
std::string parse_error(const std::string& text) {
    const test::TemporaryDirectory directory;
    const auto root = parse_toml(directory.write("t.toml", text));
    return root ? "" : root.error().message().substr(directory.path().string().size() + 1);
}

std::string repeated(const std::string& text, unsigned count) {
    std::string all;
    for (unsigned i = 0; i < count; ++i) all += text;
    return all;
}

}  // namespace

TEST_CASE("table_reader: what is no file is not read") {
    const test::TemporaryDirectory directory;
    const std::string pipe = (directory.path() / "pipe").string();
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    for (const std::string& path : {directory.path().string(), pipe, std::string("/dev/zero")}) {
        const auto root = parse_toml(path);
        REQUIRE_FALSE(root);
        CHECK(root.error().message() ==
              path + ": is not a regular file; give the path of a readable file");
    }
    CHECK(parse_toml("/nowhere/t.toml").error().message() ==
          "/nowhere/t.toml: there is no such file; give the path of a readable file");
    const std::string loop = (directory.path() / "loop").string();
    std::filesystem::create_symlink(loop, loop);
    CHECK(parse_toml(loop).error().message() ==
          loop +
              ": cannot be opened: Too many levels of symbolic links; give the path of a "
              "readable file");
}

TEST_CASE("table_reader: a file that is too large or too deep is refused before it is parsed") {
    const std::string dots(200, '.');
    // As deep as it can be built of short lines.
    const std::string level = "[\n{" + repeated("a.", 60) + "a=";
    test::check_messages(parse_error,
                         {{std::string(1U << 20U, '#'), accepted},
                          {std::string((1U << 20U) + 1, '#'),
                           "t.toml: is larger than 1048576 bytes; is it the right file?"},
                          {"# " + dots + "\nx = 1 # " + dots, accepted},
                          {"x = 1\n" + repeated("a.", 40'000) + "a = 1",
                           "t.toml:2:1: more than 64 dots on one line; no key is nested so deeply"},
                          {"x = 1\n[" + repeated("a.", 40'000) + "a]",
                           "t.toml:2:1: more than 64 dots on one line; no key is nested so deeply"},
                          {"x = 1\n\"#\"" + repeated(".a", 40'000) + " = 1",
                           "t.toml:2:1: more than 64 dots on one line; no key is nested so deeply"},
                          {"x = " + repeated(level, 120) + "1" + repeated("}\n]", 120), accepted}});
    // What the parser says of these is its own.
    CHECK_THAT(parse_error("x = " + std::string(100'000, '[')), Catch::StartsWith("t.toml:1:"));
    CHECK_THAT(parse_error("x = " + repeated(level, 2'000)), Catch::StartsWith("t.toml:"));
}

TEST_CASE("table_reader: what is not TOML is refused with its place") {
    for (const auto& [text, place] : {std::pair("a = 1\nb = '\xC3\x28'\n", "t.toml:2:"),
                                      {"\x7F\x45LF\x02\x01", "t.toml:1:1: "},
                                      {"a = 1\na = 2\n", "t.toml:2:"}})
        CHECK_THAT(parse_error(text),
                   Catch::StartsWith(place) &&
                       Catch::EndsWith("; the file must be TOML in UTF-8: https://toml.io"));
}

TEST_CASE("table_reader: characters that look like those of TOML are named") {
    const auto named = [](const std::string& place, const std::string& name,
                          const std::string& cure) {
        return "t.toml:" + place + ": there is " + name + " here, which TOML does not know; " +
               cure;
    };
    test::check_messages(
        parse_error,
        {{"a = “x”\n", named("1:5", "a curly quote", "type \" instead")},
         {"b = 1\na = \"x”\n", named("2:7", "a curly quote", "type \" instead")},
         {"a = ‘x’\n", named("1:5", "a curly quote", "type ' instead")},
         {"a = –1\n", named("1:5", "a dash", "type - instead")},
         {"a\u00A0= 1\n", named("1:2", "a no-break space", "type a plain space instead")},
         {"a = { b = 'é”', c = “x” }\n", named("1:21", "a curly quote", "type \" instead")},
         {"\u200Ba = 1\n", named("1:1", "an invisible space", "delete it, or type the line again")},
         {"a = \"“x”\" # – it’s\n", accepted}});
    // What is in a string or a comment is not why.
    for (const char* text : {"a = = 1 # it’s\n", "a = \"“x”\" b\n", "a = 'it”s' = # “\n"})
        CHECK_THAT(parse_error(text), Catch::EndsWith("; the file must be TOML in UTF-8: "
                                                      "https://toml.io"));
}

TEST_CASE("table_reader: names that may have been meant are named, and only those") {
    const auto cure_of = [](const std::string& text) {
        const toml::table root = toml::parse("kind = \"" + text + "\"\n");
        TomlFile file{"t.toml", "manual"};
        TableReader reader(file, root);
        int kind = 0;
        reader.choose<int>("kind", kind,
                           {{"off", 0},
                            {"none", 1},
                            {"end", 2},
                            {"active_low", 3},
                            {"active_high", 4},
                            {"part16a", 5},
                            {"part16b", 6},
                            {"part17", 7},
                            {"board", 8},
                            {"lock", 9},
                            {"line1", 10},
                            {"line2", 11},
                            {"line3", 12},
                            {"line4", 13}},
                           "They differ.");
        return file.problems.front().cure;
    };
    const std::string nothing = "see manual";
    test::check_messages(
        cure_of, {{"on", nothing},
                  {"high", "did you mean \"active_high\"?"},
                  {"begin", nothing},
                  {"active", "did you mean \"active_low\" or \"active_high\"? They differ."},
                  {"part16", "did you mean \"part16a\" or \"part16b\"? They differ."},
                  {"PART-16 B", "did you mean \"part16b\"?"},
                  {"part18", nothing},
                  {"baord", "did you mean \"board\"?"},
                  {"bored", nothing},
                  {"locked", "did you mean \"lock\"?"},
                  {"line", nothing},
                  {"line5", nothing},
                  {"", nothing},
                  {std::string(200, 'x'), nothing}});
}

TEST_CASE("table_reader: a key that is at home elsewhere gets the cure that is known for it") {
    const toml::table root = toml::parse("[t]\nstray = 1\nhight = 2\nother = 3\n");
    TomlFile file{"t.toml", "manual", {}, [](std::string_view title, std::string_view key) {
                      return title == "[t]" && key != "other" ? "not here" : "";
                  }};
    TableReader reader(file, *root["t"].as_table(), "[t]");
    int height = 1;
    reader.read("height", height, 0, 9);
    reader.finish();
    REQUIRE(file.problems.size() == 3);
    CHECK(file.problems[0].message() == "t.toml:3:1: unknown key 'hight'; did you mean 'height'?");
    CHECK(file.problems[1].cure == "remove it; the keys are in manual");
    CHECK(file.problems[2].message() == "t.toml:2:1: unknown key 'stray'; not here");
}

TEST_CASE("table_reader: problems are collected with place, table and key") {
    const toml::table root = toml::parse("[t]\nwidth_us = 3\nhight = 1\nkind = \"rond\"\n");
    TomlFile file{"t.toml", "manual"};
    TableReader reader(file, *root["t"].as_table(), "[t]");
    double width = 1;
    int height = 1;
    bool kind = false;
    reader.read("width_us", width, 0, 2);
    reader.read("height", height, 0, 9);
    reader.choose<bool>("kind", kind, {{"round", true}, {"flat", false}});
    reader.finish();
    REQUIRE(file.problems.size() == 3);
    CHECK(width == 1);
    CHECK(file.problems[0].message() ==
          "t.toml:2:12: 'width_us' must be a number from 0 to 2 us, but is 3; see manual");
    CHECK(file.problems[0].key == "width_us");
    CHECK(file.problems[0].range.maximum == 2);
    CHECK(file.problems[1].message() ==
          "t.toml:4:8: 'kind' must be one of round, flat, but is 'rond'; did you mean \"round\"?");
    CHECK(file.problems[2].message() == "t.toml:3:1: unknown key 'hight'; did you mean 'height'?");
    CHECK(file.problems[2].table == "[t]");
    CHECK(file.result().error().message() == file.problems[0].message());
    const TomlEntry entry = reader.entry();
    CHECK(entry.has("kind"));
    CHECK_FALSE(entry.has("height"));
    CHECK(entry.place_of("kind").text() == "t.toml:4:8");
    CHECK(entry.place_of("height").text() == "t.toml:1:1");
}
