// SPDX-License-Identifier: BSD-3-Clause
// Lenses of cameras for CameraInfo, from calibrations that Kalibr wrote.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "recording/ros_messages.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct Lenses {
    std::map<std::string, RosLens> by_topic;
    std::vector<std::string> left_out;  ///< whose model CameraInfo has no name for, and why

    /// Those of `others` replace those of the same camera.
    void add(Lenses others);

    /// The one whose topic begins with the name of the stream, /cam0/...; else the only one whose
    /// topic has it before /image_raw, as /car/cam0/image_raw. nullptr: not calibrated.
    const RosLens* find(const std::string& stream) const;

    /// Why frames of this size are not described by a lens; empty: they are, or there are none.
    std::string misfit(const std::string& stream, std::uint32_t width, std::uint32_t height) const;
};

/// Of a camchain.yaml, whose cameras are known by their topics. `where` names the file in errors.
Expected<Lenses> parse_lenses(const std::string& camchain, const std::string& where);

/// Of several files. Errors: one cannot be read, or is no camchain.yaml.
Expected<Lenses> read_lenses(const std::vector<std::string>& paths);

/// The text of a file of Kalibr. Errors: it cannot be read.
Expected<std::string> read_kalibr_file(const std::string& path);

}  // namespace versavis::client
