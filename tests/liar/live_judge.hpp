// SPDX-License-Identifier: BSD-3-Clause
// Holds each stamp against what really happened, while the service publishes it.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "damage.hpp"
#include "engine/clock/output_clock.hpp"
#include "scenario.hpp"
#include "versavis/stream.hpp"

namespace versavis::liar {

/// An item that was published as good and is not.
struct Wrong {
    std::uint64_t camera = 0;  ///< frames only
    std::uint64_t number = 0;  ///< true trigger or sample number
    bool is_stamp = true;      ///< false: the stamp is right, but its label is not
    std::string what;
};

/// What became of the items that there should have been.
struct Tally {
    std::uint64_t items = 0;  ///< frames sent and samples taken
    std::uint64_t good = 0;
    std::uint64_t flagged = 0;  ///< published, and said to be suspect or of unknown sigma

    Tally& operator+=(const Tally& more);
};

struct JudgedSystem {
    rig::Scenario scenario;
    std::string instance;
    std::string truth_path;
    double magnetic_lsb = 0;
    Duration floor;  ///< errors below it are never held against a stamp
};

class LiveJudge {
 public:
    /// The service must stamp in monotonic_raw: stamps are compared with the rig's as they are.
    LiveJudge(JudgedSystem system, const Liar& liar);

    /// Reads what is new; returns what is wrong with it.
    std::vector<Wrong> poll();

    /// From now on, camera 0 is also compared with the other cameras, whose stamps have the same
    /// error of the clock but honest edges; none: only with the truth.
    void set_edge_floor(std::optional<Duration> floor) { edge_floor_ = floor; }

    Tally tally(HostTime begin, HostTime end) const;

    /// How long after `begin` every stream was whole again, judged up to `end`; nothing: one is
    /// not.
    std::optional<Duration> recovery(HostTime begin, HostTime end) const;

    /// Newest epoch among the frames and samples.
    std::uint32_t epoch() const { return epoch_; }

    /// Greatest error of a stamp published as good and right, since the last call.
    Duration take_worst() { return std::exchange(worst_, {}); }

 private:
    enum class Fate { missing, good, flagged };
    struct TrueItem {
        HostTime at;
        std::uint64_t number = 0;
        Fate fate = Fate::missing;
    };
    struct Judged {
        std::map<std::uint64_t, TrueItem> truth;  ///< by serial of the frame, number of the sample
        OutputTime last;
        std::uint32_t last_epoch = 0;
    };

    void read_truth();
    void take(unsigned camera, const Frame& item);
    void take(const ImuSample& item);
    void take(const Event& item);
    bool edges_are_honest(unsigned camera, Duration error, std::uint32_t sigma_ns);
    bool compare(const std::string& name, Judged& judged, TrueItem& truth, OutputTime stamp,
                 std::uint32_t sigma_ns, std::uint32_t epoch, Wrong wrong);
    std::vector<const Judged*> all() const;

    JudgedSystem system_;
    std::optional<Duration> edge_floor_;
    Duration clock_error_;  ///< of the newest frame that is not camera 0's
    const Liar& liar_;
    clock::OutputClock utc_;
    std::ifstream truth_file_;
    std::string line_;
    std::vector<std::optional<FrameStream>> frames_;
    std::optional<ImuStream> imu_;
    std::optional<EventStream> events_;
    std::vector<Judged> cameras_;
    Judged samples_;
    std::uint32_t epoch_ = 0;
    Duration worst_;
    std::vector<Wrong> wrongs_;
};

}  // namespace versavis::liar
