// SPDX-License-Identifier: BSD-3-Clause
#include "pairing/pair_replay.hpp"

#include <fmt/format.h>

#include "pairing/evidence_json.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;
using namespace pairing;

class Decisions final : public Outcome {
 public:
    explicit Decisions(std::ostream* out) : out_(out) {}

    ReplaySummary summary;

    void judged(const ReceivedRecord& received, const RecordVerdict& verdict) {
        if (!verdict.doubt) return;
        ++summary.records_doubted;
        write({{"decision", "record_doubted"},
               {"trigger", received.record.trigger},
               {"reason", to_string(verdict.doubt->reason)},
               {"stated", verdict.doubt->said},
               {"expected", verdict.doubt->expected}});
    }

 private:
    void paired(const Arrival& arrival, const Exposure& exposure) override {
        ++summary.paired;
        write({{"decision", "paired"},
               {"block_id", arrival.block_id},
               {"trigger", exposure.trigger}});
    }
    void frame_unpaired(const Arrival& arrival, EventReason reason,
                        const Exposure* guess) override {
        ++summary.frames_without_trigger;
        json line{{"decision", "frame_without_trigger"},
                  {"block_id", arrival.block_id},
                  {"reason", to_string(reason)}};
        if (guess != nullptr) line["guess"] = guess->trigger;
        write(line);
    }
    void exposure_unpaired(const Exposure& exposure, EventReason reason) override {
        ++summary.triggers_without_frame;
        write({{"decision", "trigger_without_frame"},
               {"trigger", exposure.trigger},
               {"reason", to_string(reason)}});
    }
    void locked(const Exposure& first) override {
        ++summary.locks;
        write({{"decision", "locked"}, {"trigger", first.trigger}});
    }
    void slipped(const Arrival& at) override {
        ++summary.slips;
        write({{"decision", "slipped"}, {"block_id", at.block_id}});
    }

    void write(const json& line) const {
        if (out_ != nullptr) *out_ << line.dump() << '\n';
    }

    std::ostream* out_;
};

}  // namespace

Expected<ReplaySummary> replay_pairing(std::istream& recording, std::ostream* out) {
    Decisions decisions(out);
    Replay replay(decisions);
    std::uint64_t number = 0;
    for (std::string text; std::getline(recording, text);) {
        const std::string where = fmt::format("line {}", ++number);
        const json line = json::parse(text, nullptr, false);
        if (line.is_discarded())
            return failure(where, "is not valid JSON",
                           "record with: versavis tail CAMERA-evidence --oldest --json");
        auto evidence = to_evidence(line);
        if (!evidence) return failure(where, evidence.error().message());
        if (replay.begun() && std::holds_alternative<Arrival>(*evidence))
            ++decisions.summary.frames;
        replay.apply(*evidence);
        if (const auto* received = std::get_if<ReceivedRecord>(&*evidence);
            received && replay.record_verdict() != nullptr)
            decisions.judged(*received, *replay.record_verdict());
    }
    if (!replay.begun())
        return failure("recording", "does not contain the beginning of the stream",
                       "record from the start of the service, or soon after it with --oldest");
    return decisions.summary;
}

std::string to_text(const ReplaySummary& summary, bool as_json) {
    if (as_json)
        return json{{"frames", summary.frames},
                    {"paired", summary.paired},
                    {"frames_without_trigger", summary.frames_without_trigger},
                    {"triggers_without_frame", summary.triggers_without_frame},
                    {"records_doubted", summary.records_doubted},
                    {"locks", summary.locks},
                    {"slips", summary.slips}}
                   .dump() +
               "\n";
    return fmt::format(
        "{} frames: {} paired, {} without trigger; {} triggers without frame; {} records doubted; "
        "locked {} times, slipped {} times\n",
        summary.frames, summary.paired, summary.frames_without_trigger,
        summary.triggers_without_frame, summary.records_doubted, summary.locks, summary.slips);
}

}  // namespace versavis::client
