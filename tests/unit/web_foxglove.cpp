// SPDX-License-Identifier: BSD-3-Clause
#include "foxglove.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <map>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "recording/lenses.hpp"
#include "recording/ros_messages.hpp"

using namespace versavis;
using namespace versavis::web;

namespace {

struct Viewed {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::string instance = test::instance_in(directory.path());
    ring::Writer imu = *ring::Writer::create(directory.path(), {"imu0", ring::StreamKind::imu, 64});
    LiveData data{instance};
    FoxgloveSession session{instance, data};
    HostTime now{1'000'000'000};

    nlohmann::json next_text() {
        const auto text = session.next_text(now);
        return text ? nlohmann::json::parse(*text) : nlohmann::json();
    }
    void publish(std::uint64_t number) {
        ImuMetadata sample{};
        sample.number = number;
        imu.publish({static_cast<std::int64_t>(number)}, pack(sample));
    }
    /// A session with its channels known, and one subscription.
    void subscribe() {
        CHECK(next_text()["op"] == "serverInfo");
        const auto advertised = next_text();
        REQUIRE(advertised["channels"].size() == 1);
        const auto id = advertised["channels"][0]["id"].get<int>();
        session.receive(
            nlohmann::json{{"op", "subscribe"}, {"subscriptions", {{{"id", 7}, {"channelId", id}}}}}
                .dump());
        CHECK(next_text().is_null());
    }
    /// Stamps of the messages that there are.
    std::vector<std::int64_t> take() {
        std::vector<std::int64_t> stamps;
        while (const auto message = session.next_message(now)) {
            REQUIRE(message->size() > 13);
            CHECK(message->substr(0, 5) == std::string("\x01\x07\0\0\0", 5));
            std::int64_t stamp = 0;
            std::memcpy(&stamp, message->data() + 5, sizeof stamp);
            stamps.push_back(stamp);
        }
        return stamps;
    }
};

}  // namespace

TEST_CASE("web_foxglove: the protocol that both speak") {
    CHECK(foxglove_protocol("foxglove.websocket.v1") == "foxglove.websocket.v1");
    CHECK(foxglove_protocol("foxglove.websocket.v1, foxglove.sdk.v1") == "foxglove.sdk.v1");
    CHECK(foxglove_protocol("x,foxglove.sdk.v1 ,y") == "foxglove.sdk.v1");
    for (const char* other : {"", ",", " ", "foxglove.sdk.v2", "xfoxglove.sdk.v1", "foxglove"})
        CHECK(foxglove_protocol(other).empty());
}

TEST_CASE("web_foxglove: what was subscribed comes, and what was overwritten is counted") {
    Viewed viewed;
    viewed.subscribe();
    for (std::uint64_t number = 1; number <= 3; ++number) viewed.publish(number);
    CHECK(viewed.take() == std::vector<std::int64_t>{1, 2, 3});
    for (std::uint64_t number = 4; number <= 203; ++number) viewed.publish(number);
    CHECK(viewed.take().empty());  // the item that says so is none
    const auto rest = viewed.take();
    REQUIRE_FALSE(rest.empty());
    CHECK(rest.back() == 203);
    viewed.now = viewed.now + seconds(6);
    const auto status = viewed.next_text();
    CHECK(status["level"] == 1);
    CHECK(status["message"] == "/imu0/data_raw: " + std::to_string(200 - rest.size()) +
                                   " messages were not sent, as newer ones had come");
    viewed.session.receive(R"({"op":"unsubscribe","subscriptionIds":[7]})");
    viewed.publish(204);
    CHECK(viewed.take().empty());
}

TEST_CASE("web_foxglove: a viewer that is behind for a second goes on with the newest") {
    Viewed viewed;
    viewed.subscribe();
    CHECK(viewed.take().empty());
    for (std::uint64_t number = 1; number <= 50; ++number) viewed.publish(number);
    viewed.now = viewed.now + milliseconds(900);
    CHECK(viewed.session.next_message(viewed.now));
    viewed.now = viewed.now + milliseconds(200);
    CHECK(viewed.take() == std::vector<std::int64_t>{50});
    viewed.publish(51);
    viewed.publish(52);
    CHECK(viewed.take() == std::vector<std::int64_t>{51, 52});
    viewed.now = viewed.now + seconds(6);
    CHECK_THAT(viewed.next_text()["message"].get<std::string>(),
               Catch::StartsWith("/imu0/data_raw: 48 messages were not sent"));
}

TEST_CASE("web_foxglove: samples do not wait for images, nor images forever for samples") {
    Viewed viewed;
    auto frames = *ring::Writer::create(viewed.directory.path(),
                                        {"cam0", ring::StreamKind::frames, 8, 8, 4096});
    for (auto text = viewed.next_text(); !text.is_null(); text = viewed.next_text())
        if (text["op"] == "advertise")
            for (const auto& channel : text["channels"])
                if (channel["topic"] == "/imu0/data_raw" || channel["topic"] == "/cam0/image_raw")
                    viewed.session.receive(nlohmann::json{
                        {"op", "subscribe"},
                        {"subscriptions",
                         {{{"id", channel["topic"] == "/imu0/data_raw" ? 1 : 2},
                           {"channelId",
                            channel["id"]}}}}}.dump());
    const auto publish_frame = [&] { frames.publish(*frames.acquire(), 1, {}, {}); };
    const auto next_id = [&] { return viewed.session.next_message(viewed.now).value()[1]; };
    publish_frame();
    viewed.publish(1);
    viewed.publish(2);
    CHECK(next_id() == 1);
    CHECK(next_id() == 1);
    CHECK(next_id() == 2);
    publish_frame();
    unsigned before = 0;
    for (;; ++before) {
        viewed.publish(3 + before);
        if (next_id() == 2) break;
        REQUIRE(before < 1000);
    }
    CHECK(before == 64);
}

TEST_CASE("web_foxglove: sentences of a receiver, and the lens of a camera") {
    constexpr auto camchain =
        "cam0: {camera_model: pinhole, intrinsics: [300.0, 301.0, 160.0, 120.0], resolution: [320, "
        "240], distortion_model: radtan, distortion_coeffs: [0.1, 0.2, 0.0, 0.0], rostopic: "
        "/cam0/image_raw}\n";
    Viewed viewed;
    const auto lenses = *client::parse_lenses(camchain, "chain.yaml");
    viewed.data = LiveData(viewed.instance, lenses);
    auto nmea = *ring::Writer::create(viewed.directory.path(),
                                      {"nmea0", ring::StreamKind::nmea, 8, 8, 4096});
    auto frames = *ring::Writer::create(viewed.directory.path(),
                                        {"cam0", ring::StreamKind::frames, 8, 8, 4096});
    std::map<std::string, int> channels;
    for (auto text = viewed.next_text(); !text.is_null(); text = viewed.next_text())
        if (text["op"] == "advertise")
            for (const auto& channel : text["channels"])
                channels[channel["topic"].get<std::string>()] = channel["id"].get<int>();
    for (const auto& [id, topic] :
         {std::pair(1, "/nmea0/nmea_sentence"), std::pair(2, "/cam0/camera_info")})
        viewed.session.receive(
            nlohmann::json{{"op", "subscribe"},
                           {"subscriptions", {{{"id", id}, {"channelId", channels.at(topic)}}}}}
                .dump());
    const auto publish = [](ring::Writer& writer, std::int64_t time, const std::string& payload,
                            const ring::Metadata& metadata) {
        const auto slot = *writer.acquire();
        std::memcpy(writer.slot_data(slot), payload.data(), payload.size());
        writer.publish(slot, static_cast<std::uint32_t>(payload.size()), {time}, metadata);
        return OutputTime{time};
    };
    const auto next = [&] { return viewed.session.next_message(viewed.now).value().substr(13); };
    const std::string sentence = "$GPZDA,000000.00,01,01,2027,00,00*61";
    const OutputTime at = publish(nmea, 5, sentence, pack(NmeaMetadata{}));
    CHECK(next() == client::ros_sentence(at, "nmea0", sentence));
    FrameMetadata frame{};
    frame.width = 320;
    frame.height = 240;
    OutputTime time = publish(frames, 6, "x", pack(frame));
    CHECK(next() == client::ros_camera_info(time, "cam0", frame, lenses.find("cam0")));
    CHECK(viewed.next_text().is_null());
    frame.width = 640;
    time = publish(frames, 7, "x", pack(frame));
    CHECK(next() == client::ros_camera_info(time, "cam0", frame));
    CHECK(viewed.next_text()["message"] ==
          "cam0: it was calibrated at 320 x 240, and its frames have 640 x 240");
}

TEST_CASE("web_foxglove: whatever a viewer sends, the worst is an answer") {
    Viewed viewed;
    viewed.subscribe();
    for (const char* text :
         {"",
          "{",
          "[]",
          "null",
          "7",
          "\"subscribe\"",
          R"({"op":7})",
          R"({"op":{"op":"subscribe"}})",
          R"({"op":"subscribe"})",
          R"({"op":"subscribe","subscriptions":7})",
          R"({"op":"subscribe","subscriptions":[7,null,[],{},{"id":1}]})",
          R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})",
          R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]})",
          R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})",
          R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]})",
          R"({"op":"subscribe","subscriptions":[{"id":7,"channelId":1}]})",
          R"({"op":"unsubscribe","subscriptionIds":[99,"7",-7,null]})",
          R"({"op":"unsubscribe","subscriptionIds":{"7":7}})",
          "\xff\xfe",
          R"({"op":"\u0000"})"})
        viewed.session.receive(text);
    viewed.session.receive(std::string(60000, '['));
    for (int i = 0; i < 5000; ++i) viewed.session.receive("{}");  // it reads nothing meanwhile
    int answers = 0;
    for (; const auto text = viewed.session.next_text(viewed.now); ++answers)
        CHECK(nlohmann::json::parse(*text)["op"] == "status");
    CHECK(answers == 1000);
    viewed.publish(1);
    CHECK(viewed.take() == std::vector<std::int64_t>{1});  // the first subscription is as it was
}
