// SPDX-License-Identifier: BSD-3-Clause
#include "routes.hpp"

#include <catch2/catch.hpp>
#include <cstring>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;
using namespace versavis::web;

namespace {

Request get(const std::string& target, const std::string& host = "localhost:8765") {
    Request request(http::verb::get, target, 11);
    request.set(http::field::host, host);
    return request;
}

struct Site {
    Settings settings{"nobody", "127.0.0.1", 8765, ""};
    LiveData data{"nobody"};
    RecordingProcess recording{"nobody", ""};

    Response operator()(const Request& request) {
        return respond(request, settings, data, recording);
    }
    unsigned status(const Request& request) { return (*this)(request).result_int(); }
};

}  // namespace

TEST_CASE("web_routes: targets") {
    const auto target = parse_target("/api/picture/a%20b?after=3&whole=1&=&empty=&flag");
    REQUIRE(target);
    CHECK(target->path == "/api/picture/a b");
    CHECK(target->query.at("after") == "3");
    CHECK(target->query.at("flag").empty());
    CHECK_FALSE(parse_target(""));
    CHECK_FALSE(parse_target("http://other/"));
    for (const char* damaged : {"/%", "/%1", "/%g1", "/%1g", "/?a=%", "/%-1", "/%+1", "/% 1"})
        CHECK_FALSE(parse_target(damaged));
}

TEST_CASE("web_routes: only loopback is this host") {
    for (const char* host :
         {"localhost", "localhost:1", "127.0.0.1:8765", "127.8.9.1", "[::1]", "[::1]:8765"})
        CHECK(names_loopback(host));
    for (const char* host :
         {"", "example.org", "localhost.example.org", "10.0.0.1", "[::2]", "127.0.0.1.example.org",
          ":8765", "[", "]", "[]", "[::1", "127.0.0.1@example.org"})
        CHECK_FALSE(names_loopback(host));
}

TEST_CASE("web_routes: without a service there is a page that says so") {
    Site site;
    CHECK(site(get("/")).body().find("<!DOCTYPE html>") == 0);
    CHECK(site(get("/page.js"))[http::field::content_type] == "text/javascript; charset=utf-8");
    const auto state = nlohmann::json::parse(site(get("/api/state")).body());
    CHECK(state["status"].is_null());
    CHECK(state["conclusion"]["state"] == "unknown");
    CHECK(site(get("/metrics")).body().find("versavis_up{service=\"nobody\"} 0\n") !=
          std::string::npos);
}

TEST_CASE("web_routes: what is wrong with a request") {
    Site site;
    CHECK(site.status(get("/nothing")) == 404);
    CHECK(site.status(get("/api/picture/cam0")) == 404);
    CHECK(site.status(get("/api/picture/")) == 404);
    CHECK(site.status(get("/api/picture/..%2f..%2fcam0")) == 404);
    for (const char* query : {"after=", "after=-1", "after=x", "after=1x", "whole=2",
                              "whole=", "after=99999999999999999999"})
        CHECK(site.status(get(std::string("/api/picture/cam0?") + query)) == 400);
    CHECK(site.status(get("/%zz")) == 400);
    CHECK(site.status(get("/", "rebinding.example.org")) == 421);
    Request post = get("/api/state");
    post.method(http::verb::post);
    CHECK(site.status(post) == 405);
    CHECK(site(post)[http::field::allow] == "GET, HEAD");
}

TEST_CASE("web_routes: with a token, nobody gets anything without it") {
    Site site;
    site.settings.token = "0123456789abcdef";
    for (const char* target : {"/", "/page.js", "/api/state", "/api/picture/cam0", "/metrics",
                               "/?token=", "/?token=0123456789abcdeF", "/?token=0123456789abcde",
                               "/?token=0123456789abcdef0", "/api/state?token=0123456789abcdef"})
        CHECK(site.status(get(target, "car.example.org")) == 401);
    const Response entered = site(get("/?token=0123456789abcdef", "car.example.org"));
    CHECK(entered.result_int() == 303);
    CHECK(entered[http::field::location] == "/");
    CHECK(entered[http::field::set_cookie] ==
          "versavis=0123456789abcdef; HttpOnly; SameSite=Strict; Path=/");
    Request request = get("/api/state", "car.example.org");
    request.set(http::field::cookie, "other=1; versavis=0123456789abcdef");
    CHECK(site.status(request) == 200);
    for (const char* cookie : {"versavis=", "xversavis=0123456789abcdef", ";;", "versavis"}) {
        request.set(http::field::cookie, cookie);
        CHECK(site.status(request) == 401);
    }
    request.erase(http::field::cookie);
    request.set(http::field::authorization, "Bearer 0123456789abcdef");
    CHECK(site.status(request) == 200);
    request.set(http::field::authorization, "Basic 0123456789abcdef");
    CHECK(site.status(request) == 401);
}

TEST_CASE("web_routes: recordings are begun and ended by the own page alone") {
    const test::TemporaryDirectory directory;
    Site site;
    Request post = get("/api/record?action=begin");
    post.method(http::verb::post);
    CHECK(site.status(post) == 403);  // it has no folder
    CHECK_FALSE(nlohmann::json::parse(site(get("/api/record")).body())["possible"].get<bool>());
    RecordingProcess recording{"nobody", directory.path()};
    const auto status = [&](const std::string& target, const std::string& origin) {
        Request request = get(target);
        request.method(http::verb::post);
        if (!origin.empty()) request.set(http::field::origin, origin);
        return respond(request, site.settings, site.data, recording).result_int();
    };
    for (const char* origin : {"http://other.example.org", "http://localhost", "null", "//",
                               "http://localhost:8765.example.org"})
        CHECK(status("/api/record?action=begin", origin) == 403);
    CHECK(status("/api/record?action=", "") == 400);
    CHECK(status("/api/record", "") == 400);
    CHECK(status("/api/record?action=end", "http://localhost:8765") == 409);
}

TEST_CASE("web_routes: a status document of other types is an error, not an end") {
    const test::TemporaryDirectory directory("/dev/shm");
    const std::string instance = test::instance_in(directory.path());
    auto status =
        *ring::Writer::create(directory.path(), {"status", ring::StreamKind::status, 8, 2, 4096});
    const auto publish = [&](const std::string& document) {
        const auto slot = status.acquire();
        REQUIRE(slot);
        std::memcpy(status.slot_data(*slot), document.data(), document.size());
        status.publish(*slot, static_cast<std::uint32_t>(document.size()), OutputTime{1}, {});
    };
    for (const char* members :
         {R"("clock": 7)", R"("clock": {"sigma_ns": "x", "health": 7})", R"("cameras": {"a": 1})",
          R"("cameras": [7], "health": [])", R"("board": [[]], "imus": [{"name": {}}])"}) {
        publish(std::string(R"({"schema": 1, )") + members + "}");
        Site site;
        site.settings.instance = instance;
        site.data = LiveData(instance);
        site.data.advance(host_now());
        const Response response = site(get("/api/state"));
        CHECK((response.result_int() == 200 || response.result_int() == 500));
        CHECK_FALSE(nlohmann::json::parse(response.body()).empty());
        site.data.advance(host_now() + seconds(1));
    }
}
