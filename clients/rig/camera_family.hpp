// SPDX-License-Identifier: BSD-3-Clause
// What is particular of a family of cameras, read from data files (clients/rig/models/): its
// description, and what its registers make the camera do.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::rig {

enum class NumberFormat { word, single_float, double_float };

/// A number in the camera's memory.
struct Field {
    std::uint32_t at = 0;
    std::uint32_t bits = 0xFFFFFFFF;  ///< of its word
    NumberFormat format = NumberFormat::word;
};

/// Fields with their values. As a condition: all of them hold; none: it does not hold.
using FieldValues = std::vector<std::pair<Field, double>>;

/// Fields that cannot be written while `when` holds; none in it: while the camera acquires.
struct RegisterLock {
    std::vector<Field> fields;
    FieldValues when;
    std::optional<Field> shown;  ///< reads 1 while it is locked
};

/// Times are in microseconds. A field that a family lacks is nullopt.
struct CameraFamily {
    std::string vendor = "VersaVIS";
    std::string model = "RigCamera";
    std::string nodes;  ///< of its description, beside those that all models have
    bool little_endian = false;
    FieldValues defaults;     ///< its factory settings
    FieldValues left_behind;  ///< what another program made of them, and saved as start-up settings
    std::vector<RegisterLock> locks;
    std::optional<Field> user_set_load;  ///< any write to it loads the set that is selected
    std::optional<Field> user_set;       ///< 0: factory settings, else start-up settings
    std::optional<Field> binning;        ///< in both directions
    FieldValues stalled;                 ///< any of these: it waits for another trigger
    FieldValues triggered;               ///< else it runs freely
    FieldValues listens;                 ///< the trigger line is its trigger
    FieldValues falling;                 ///< it takes the falling edge
    std::optional<Field> trigger_delay;
    std::optional<Field> burst;  ///< frames that one trigger makes
    Field exposure;
    FieldValues exposure_auto;
    std::optional<Field> exposure_limit;
    FieldValues shows_exposure;  ///< on the line that the board sees; none: always
    FieldValues line_inverted;   ///< the camera inverts that line
    std::optional<Field> line_delay;
    std::optional<Field> line_lead;      ///< the line begins earlier by this
    std::optional<Field> line_duration;  ///< 0: as long as the exposure
    FieldValues chunks;                  ///< its frames carry their exposure time
    std::uint32_t image_chunk = 1;
    std::uint32_t exposure_chunk = 0x1001;
    bool chunk_is_integer = false;  ///< little-endian, else a big-endian float
    std::uint32_t gain_chunk = 0;   ///< a big-endian float; 0: none

    /// Bytes of them: the image's own, then each value in four bytes, all with id and length.
    std::uint32_t chunk_bytes() const { return 8 + (gain_chunk != 0 ? 2 : 1) * (4 + 8); }
};

/// The model of that name beside this program. Errors: there is none, or name file and line.
Expected<CameraFamily> load_camera_family(const std::string& name);

/// Another directory's.
Expected<CameraFamily> load_camera_family(const std::string& directory, const std::string& name);

}  // namespace versavis::rig
