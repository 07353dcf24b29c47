// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_metrics.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

json status_of_two_cameras() {
    json status = json::parse(R"({"release": "1.2", "started_ns": 1000000000,
        "host_time_ns": 11000000000, "health": "degraded",
        "board": {"health": "ok", "fault": "", "serial": "E6", "firmware": "versavis 1.2",
                  "packets": 7, "lost_packets": 0, "loop_max_ns": 2000},
        "clock": {"health": "ok", "fault": "", "sigma_ns": 4500, "bound_ns": null,
                  "skew_ppm": -12.5, "host_synchronised": true},
        "imus": [{"name": "imu0", "health": "ok", "fault": "", "published": 4000, "lost": 2}],
        "streams": [{"name": "cam0", "items": 200}]})");
    for (const char* name : {"cam0", "cam1"})
        status["cameras"].push_back({{"name", name},
                                     {"health", "ok"},
                                     {"fault", ""},
                                     {"delivered_hz", 19.5},
                                     {"frames_received", 200},
                                     {"link_mbps", 1000},
                                     {"link_needed_mbps", 250}});
    status["cameras"][1]["health"] = "degraded";
    status["cameras"][1]["fault"] = "packet_loss";
    return status;
}

std::vector<std::string> lines_of(const std::string& text) {
    std::istringstream in(text);
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
}

std::string read_source(const std::string& path) {
    std::ifstream file(VERSAVIS_SOURCE_DIR "/" + path);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("status_metrics: values are in base units, and what is unknown is left out") {
    const std::string text =
        openmetrics_text("default", status_of_two_cameras(), HostTime{11'250'000'000});
    CHECK_THAT(text, Contains("\nversavis_clock_sigma_seconds{service=\"default\"} 4.5e-06\n"));
    CHECK_THAT(text, Contains("\nversavis_clock_skew_ratio{service=\"default\"} -1.25e-05\n"));
    CHECK_THAT(text, Contains("\nversavis_clock_host_synchronised{service=\"default\"} 1\n"));
    CHECK_THAT(text, Contains("\nversavis_uptime_seconds{service=\"default\"} 10\n"));
    CHECK_THAT(text, Contains("\nversavis_status_age_seconds{service=\"default\"} 0.25\n"));
    CHECK_THAT(text, Contains("versavis_camera_frames_received_total{service=\"default\",camera="
                              "\"cam1\"} 200\n"));
    CHECK_THAT(text, Contains("versavis_camera_link_load_ratio{service=\"default\",camera=\"cam0\""
                              "} 0.25\n"));
    CHECK_THAT(text, Contains("versavis_device_fault_info{service=\"default\",device=\"cam1\","
                              "fault=\"packet_loss\"} 1\n"));
    CHECK_THAT(text, !Contains("versavis_clock_bound_seconds") && !Contains("null"));
}

TEST_CASE("status_metrics: each family is described once, before its samples, and ends by a unit") {
    const std::string text = openmetrics_text("d", status_of_two_cameras(), HostTime{11});
    std::set<std::string> described;
    std::string family;
    for (const std::string& line : lines_of(text)) {
        INFO(line);
        std::smatch found;
        if (std::regex_match(line, found,
                             std::regex("# TYPE (versavis_[a-z_]+) (gauge|counter)"))) {
            family = found[1];
            if (found[2] == "counter") CHECK_THAT(family, !Catch::EndsWith("_total"));
            CHECK(described.insert(family).second);
        } else if (std::regex_match(line, found, std::regex("# UNIT (\\S+) (\\S+)"))) {
            CHECK((found[1] == family && family.ends_with("_" + found[2].str())));
        } else if (std::regex_match(line, found, std::regex("# HELP (\\S+) .+\\."))) {
            CHECK(found[1] == family);
        } else if (line != "# EOF") {
            REQUIRE(std::regex_match(line, found,
                                     std::regex("([a-z_]+)\\{[a-z]+=\".*\"\\} [-0-9.e]+")));
            const bool of_family = found[1] == family || found[1] == family + "_total";
            CHECK(of_family);
        }
    }
    CHECK_THAT(text, Catch::EndsWith("\n# EOF\n"));
}

TEST_CASE("status_metrics: without a service there is only versavis_up") {
    CHECK(openmetrics_text("a\"b\\", std::nullopt, HostTime{}) ==
          "# TYPE versavis_up gauge\n# HELP versavis_up 1 if the service lives and publishes its "
          "status.\nversavis_up{service=\"a\\\"b\\\\\"} 0\n# EOF\n");
}

TEST_CASE(
    "status_metrics: alerts and dashboard name only metrics that exist, the manual names all") {
    const std::vector<std::string> names = metric_names();
    for (const char* file : {"systemd/versavis-alerts.yml", "systemd/versavis-dashboard.json"}) {
        const std::string text = read_source(file);
        const std::regex name("versavis_[a-z_]+");
        int used = 0;
        for (std::sregex_iterator at(text.begin(), text.end(), name), end; at != end;
             ++at, ++used) {
            INFO(file << ": " << at->str());
            CHECK(std::count(names.begin(), names.end(), at->str()) == 1);
        }
        CHECK(used > 5);
    }
    // No two panels of the dashboard lie on each other.
    std::set<std::pair<int, int>> taken;
    const auto dashboard = nlohmann::json::parse(read_source("systemd/versavis-dashboard.json"));
    for (const auto& panel : dashboard["panels"]) {
        const auto& at = panel["gridPos"];
        for (int x = at["x"]; x < at["x"].get<int>() + at["w"].get<int>(); ++x)
            for (int y = at["y"]; y < at["y"].get<int>() + at["h"].get<int>(); ++y) {
                INFO(panel["title"]);
                CHECK((x < 24 && taken.emplace(x, y).second));
            }
    }
    const std::string manual = read_source("docs/user/monitoring.md");
    for (const std::string& metric : names) CHECK_THAT(manual, Contains("`" + metric + "`"));
}
