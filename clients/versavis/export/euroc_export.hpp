// SPDX-License-Identifier: BSD-3-Clause
// Writes one folder `mav0/` that EuRoC's readers, Basalt, ORB-SLAM3 and Kalibr's bag maker read.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "export/export.hpp"
#include "export/export_image.hpp"

namespace versavis::client {

/// `formats` are those of the selection's cameras. Errors: the file is damaged, the disk is full,
/// stopped.
Expected<> export_euroc(const Recording& recording, const Selection& selection,
                        const SelectedSequence& sequence, const std::vector<ExportFormat>& formats,
                        const ExportCalibration& calibration,
                        const std::filesystem::path& directory, const ExportWatch& watch,
                        std::vector<std::string>& notes);

}  // namespace versavis::client
