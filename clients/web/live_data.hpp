// SPDX-License-Identifier: BSD-3-Clause
// What the page shows: the newest of each stream of an instance, and the last seconds of exposures,
// IMU samples and events. It reads only while somebody looks, keeps one copy of each picture for
// all clients, and holds neither the service nor other readers up. Used by one thread.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "picture.hpp"
#include "recording/lenses.hpp"
#include "versavis/stream.hpp"
#include "wiring/wired_parts.hpp"

namespace versavis::web {

/// A picture with what a client shows beside it.
struct ShownPicture {
    std::uint64_t version = 0;   ///< of the picture; 0: there was no frame yet
    HostTime looked{INT64_MIN};  ///< for a newer one
    std::uint64_t life = 0;      ///< of the service, and
    std::uint64_t number = 0;    ///< of the frame in it
    OutputTime time;             ///< its stamp
    HostTime arrival;
    std::string jpeg;
    nlohmann::json facts;
    std::string problem;  ///< why it cannot be shown; empty: it can
};

class LiveData {
 public:
    explicit LiveData(std::string instance, client::Lenses lenses = {})
        : instance_(std::move(instance)), lenses_(std::move(lenses)) {}

    /// Reads what has come. To be called ten times a second; without a client it reads nothing.
    void advance(HostTime now);

    /// The document of docs/user/web.md; a client is there from now on.
    const std::string& state(HostTime now);

    /// The newest picture of a camera; `whole`: each pixel of it. At most five a second are made.
    /// None: there is no such camera.
    const ShownPicture* picture(const std::string& camera, bool whole, HostTime now);

    /// The circuits of the service's configuration. Errors: it cannot be read; no part is at the
    /// board.
    Expected<client::WiredParts> wiring() const;

    /// OpenMetrics.
    std::string metrics(HostTime now) const;

    const client::Lenses& lenses() const { return lenses_; }

 private:
    struct Moment {
        HostTime time;
        nlohmann::json facts;
    };
    struct Camera {
        FrameStream frames;              ///< metadata of each
        FrameStream pictures;            ///< the newest
        std::deque<Moment> exposures{};  ///< by their middles
        ShownPicture overview{};
        ShownPicture whole{};
        std::map<std::string, std::uint64_t> withheld{};  ///< by reason
    };
    struct Sample {
        HostTime time;
        std::array<float, 6> values;
    };
    struct Imu {
        ImuStream samples;
        std::deque<Sample> shown{};
    };

    void watch(HostTime now);
    void look_for_streams();
    void read_frames(Camera& camera, HostTime now);
    void read_samples(Imu& imu, HostTime now);
    void read_events();
    void read_status(HostTime now);
    nlohmann::json document(HostTime now) const;

    std::string instance_;
    client::Lenses lenses_;
    HostTime watched_{INT64_MIN};  ///< when somebody looked last
    HostTime searched_{INT64_MIN};
    HostTime asked_{INT64_MIN};   ///< for the status
    HostTime stated_{INT64_MIN};  ///< when `state_` was made
    std::string state_;
    std::map<std::string, Camera> cameras_;
    std::map<std::string, Imu> imus_;
    std::optional<EventStream> event_stream_;
    std::deque<Moment> events_;
    std::deque<Moment> clock_;
    std::int64_t clock_base_ns_ =
        0;  ///< of the output clock, less the host's, at the first of them
    std::optional<nlohmann::json> status_;
    std::string silence_;  ///< why there is no status
};

}  // namespace versavis::web
