// SPDX-License-Identifier: BSD-3-Clause
// Foxglove's WebSocket protocol, for Foxglove and Lichtblick: what a viewer subscribes to, and the
// messages for it, without the connection. Small messages go before images. Images are the newest
// when the connection can take one; samples and stamps fall behind by a second at most. What a
// viewer misses is counted, and it is shown that. Used by one thread.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "live_data.hpp"
#include "versavis/stream.hpp"

namespace versavis::web {

/// Of a request's Sec-WebSocket-Protocol, the one that is spoken; empty: none of them.
std::string_view foxglove_protocol(std::string_view offered);

class FoxgloveSession {
 public:
    FoxgloveSession(std::string instance, LiveData& data);

    /// What a viewer sent as text.
    void receive(std::string_view text);

    /// What is to be sent as text, oldest first; none: nothing.
    std::optional<std::string> next_text(HostTime now);

    /// What is to be sent as binary; none: nothing has come.
    std::optional<std::string> next_message(HostTime now);

 private:
    enum class Content { image, jpeg, camera_info, stamp, imu, event, sentence, status };
    struct Channel {
        std::string topic;
        std::string_view type;
        std::string stream;
        Content content;
    };
    using Reader = std::variant<FrameStream, ImuStream, EventStream, NmeaStream, StatusStream>;
    struct Subscription {
        const Channel* channel;
        Reader reader;
        std::uint64_t number = 0;   ///< of the frame that was sent last, and 1
        std::uint64_t version = 0;  ///< of the JPEG
        std::string problem{};      ///< why there is none, or what is wrong, as it was reported
        std::uint64_t missed = 0;
        std::optional<HostTime> caught_up{};  ///< when nothing newer was left the last time
    };

    void look_for_channels();
    void advertise(const std::string& stream, ring::StreamKind kind);
    void subscribe(const nlohmann::json& subscriptions);
    void report(int level, const std::string& message);
    void report_missed(HostTime now);
    void report_once(Subscription& subscription, const std::string& problem);
    std::optional<std::string> next_message(bool image, HostTime now);
    std::optional<std::string> message_of(std::uint32_t id, Subscription& subscription,
                                          HostTime now);

    std::string instance_;
    LiveData* data_;
    std::deque<nlohmann::json> texts_;
    std::map<std::uint32_t, Channel> channels_;
    std::map<std::string, ring::StreamKind> streams_;
    std::map<std::uint32_t, Subscription> subscriptions_;
    std::array<std::uint32_t, 2> last_{};  ///< served last, of what is small, and of images
    unsigned small_in_a_row_ = 0;
    HostTime searched_{INT64_MIN};
    HostTime reported_{INT64_MIN};
};

}  // namespace versavis::web
