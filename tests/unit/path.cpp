// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring_path.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <optional>
#include <string>

using namespace versavis;

namespace {

/// The variable as it was, when it goes out of scope.
class Variable {
 public:
    explicit Variable(const char* name) : name_(name) {
        if (const char* value = std::getenv(name)) before_ = value;
    }
    ~Variable() { before_ ? ::setenv(name_, before_->c_str(), 1) : ::unsetenv(name_); }
    Variable(const Variable&) = delete;
    Variable& operator=(const Variable&) = delete;

 private:
    const char* name_;
    std::optional<std::string> before_;
};

}  // namespace

TEST_CASE("path: the instance is the one of the environment, if that names one") {
    const Variable instance("VERSAVIS_INSTANCE");
    ::setenv("VERSAVIS_INSTANCE", "rover", 1);
    CHECK(default_instance() == "rover");
    ::setenv("VERSAVIS_INSTANCE", "", 1);
    CHECK(default_instance() == "default");
    ::unsetenv("VERSAVIS_INSTANCE");
    CHECK(default_instance() == "default");
}

TEST_CASE("path: streams lie in the directory of their instance") {
    CHECK(stream_path("rover", "imu0") == "/dev/shm/versavis/rover/imu0");
    CHECK(instance_directory("rover") == "/dev/shm/versavis/rover");
}

TEST_CASE("path: a stream's name leads to no other directory, and hides nothing") {
    for (const char* name : {"imu0", "a", "with space", "a.b", "a."}) CHECK(is_stream_name(name));
    for (const char* name : {"", ".", "..", ".lock", "/imu0", "a/b", "a/", "../default/imu0"})
        CHECK_FALSE(is_stream_name(name));
}
