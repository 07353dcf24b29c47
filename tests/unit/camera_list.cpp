// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_list.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace versavis;
using daemon::Access;
using daemon::ListedCamera;

namespace {

ListedCamera camera_at(const std::string& address, const std::string& serial) {
    ListedCamera camera;
    camera.address = camera.device = address;
    camera.serial = serial;
    return camera;
}

}  // namespace

TEST_CASE("camera_list: an address that changes by itself is no name for the configuration") {
    CHECK(daemon::device_name("192.168.1.20", "4711") == "192.168.1.20");
    CHECK(daemon::device_name("169.254.3.4", "4711") == "4711");
    CHECK(daemon::device_name("169.254.3.4", "") == "169.254.3.4");
}

TEST_CASE("camera_list: two cameras with one address are named, each by the other") {
    std::vector<ListedCamera> cameras{camera_at("10.0.0.2", "A"), camera_at("10.0.0.3", "B"),
                                      camera_at("10.0.0.2", "C"), camera_at("", "D"),
                                      camera_at("", "E")};
    daemon::find_shared_addresses(cameras);
    CHECK(cameras[0].access == Access::unreachable);
    CHECK_THAT(cameras[0].problem,
               Catch::Contains("serial number C") && Catch::Contains("10.0.0.2, too"));
    CHECK_THAT(cameras[2].problem, Catch::Contains("serial number A"));
    for (const std::size_t other : {1U, 3U, 4U}) CHECK(cameras[other].access == Access::free);
}

TEST_CASE("camera_list: whatever a camera calls itself, the list is JSON") {
    ListedCamera camera = camera_at("10.0.0.2", "A\xff\"B");
    camera.access = Access::busy;
    const auto list = nlohmann::json::parse(daemon::to_json({camera, camera}));
    REQUIRE(list.size() == 2);
    CHECK(list[0]["access"] == "busy");
    CHECK(list[0]["serial"] == "A\xef\xbf\xbd\"B");
}
