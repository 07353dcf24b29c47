// SPDX-License-Identifier: BSD-3-Clause
// All streams of an instance, read together: those that appear later, too.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "versavis/stream.hpp"
#include "versavis/wait_set.hpp"

namespace versavis::ros_client {

/// Takes what streams bring. An error ends StreamGroup::turn() with it.
class Sink {
 public:
    virtual ~Sink() = default;

    /// A stream was found.
    virtual Expected<> on_stream(const std::string& name, ring::StreamKind kind) = 0;
    virtual Expected<> on_frame(const std::string& name, const Frame& frame) = 0;
    virtual Expected<> on_sample(const std::string& name, const ImuSample& sample) = 0;
    virtual Expected<> on_event(const std::string& name, const Event& event) = 0;

    /// Sentences of a GNSS receiver are read only for those who take them.
    virtual bool takes_sentences() const { return false; }
    virtual Expected<> on_sentence(const std::string& /*name*/, const NmeaSentence& /*sentence*/) {
        return {};
    }
};

/// Used by one thread.
class StreamGroup {
 public:
    /// `wanted`: by name; empty: all. `sink` must outlive it.
    StreamGroup(std::string instance, std::vector<std::string> wanted, Sink& sink);
    ~StreamGroup();

    /// Hands out what has come, waiting for it up to `timeout`. Errors: those of the sink.
    Expected<> turn(Duration timeout);

    /// Items that were overwritten before they were read.
    std::uint64_t lost() const { return lost_; }

    /// Why streams are not read that should be, as long as that is so.
    const std::optional<Error>& problem() const { return problem_; }

 private:
    struct Source;

    Expected<> look_for_streams();
    Expected<> hand_out(Source& source);
    bool is_wanted(const std::string& name) const;

    StreamOptions options_;
    std::vector<std::string> wanted_;
    Sink& sink_;
    std::map<std::string, std::unique_ptr<Source>> sources_;
    std::vector<Source*> waiting_;  ///< in the order of the wait set
    std::optional<WaitSet> wait_set_;
    std::optional<HostTime> searched_;
    std::optional<Error> problem_;
    std::uint64_t lost_ = 0;
};

}  // namespace versavis::ros_client
