// SPDX-License-Identifier: BSD-3-Clause
// Writes a ROS 1 bag for Kalibr, OpenVINS and VINS-Fusion: messages in the order of their stamps.
#pragma once

#include <string>
#include <vector>

#include "export/bag_writer.hpp"
#include "export/export_image.hpp"
#include "export/selection.hpp"

namespace versavis::client {

/// `formats` are those of the selection's cameras. Errors: the file is damaged, the disk is full, a
/// stamp that a bag cannot hold, stopped.
Expected<> export_bag(const Recording& recording, const Selection& selection,
                      const SelectedSequence& sequence, const std::vector<ExportFormat>& formats,
                      const std::string& path, BagCompression compression,
                      const ExportWatch& watch);

}  // namespace versavis::client
