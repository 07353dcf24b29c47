// SPDX-License-Identifier: BSD-3-Clause
// A recording as files for others' tools: an EuRoC folder, a ROS 1 bag, or CSV.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "export/bag_writer.hpp"
#include "export/selection.hpp"
#include "recording/kalibr_yaml.hpp"

namespace versavis::client {

enum class ExportKind { euroc, bag, csv };

struct ExportSettings {
    std::string recording;
    std::string directory;
    ExportKind kind = ExportKind::euroc;
    ExportChoice choice;
    BagCompression compression = BagCompression::none;
    std::string camchain;  ///< file of Kalibr's; empty: the recording's attachment
    std::string imu_yaml;  ///< likewise
    ExportWatch watch;
};

/// What is known of the cameras, in the order of the selection, and of the IMUs' noise.
struct ExportCalibration {
    std::vector<std::optional<CalibratedCamera>> cameras;
    std::vector<CalibratedCamera> chain;  ///< the first of them, up to one that is not known
    std::optional<ImuNoise> noise;
};

struct ExportReport {
    std::string directory;
    Selection selection;               ///< of euroc and bag
    std::vector<std::string> written;  ///< of csv: "cam0.csv: 120 rows"
    std::vector<std::string> notes;    ///< what the user should know before believing it
    std::string verdict;               ///< of all stamps; empty: they could not be verified
};

/// Topics of a bag and of the YAML files.
std::string image_topic(const std::string& camera);
std::string imu_topic(const std::string& imu);

/// Errors: the recording or a calibration cannot be read, the directory is not empty, the disk is
/// full, stopped. Then there is no directory.
Expected<ExportReport> export_recording(const ExportSettings& settings);

/// Where in the export a sequence is; empty: it is the only one.
std::string sequence_folder(const Selection& selection, std::size_t index);

std::string to_text(const ExportReport& report, bool json);

/// README.txt of the export.
std::string readme(const ExportReport& report);

}  // namespace versavis::client
