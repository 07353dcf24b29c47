// SPDX-License-Identifier: BSD-3-Clause
#include "camera/ptp_reader.hpp"

#include <fmt/format.h>

#include "camera/gvcp.hpp"

namespace versavis::daemon {

namespace {

bool execute(ArvDevice* device, const std::string& command) {
    GlibError error;
    arv_device_execute_command(device, command.c_str(), error.out());
    return !error.set();
}

std::optional<std::int64_t> integer(ArvDevice* device, const std::string& feature) {
    GlibError error;
    const std::int64_t value =
        arv_device_get_integer_feature_value(device, feature.c_str(), error.out());
    return error.set() ? std::nullopt : std::optional(value);
}

}  // namespace

Expected<PtpReader> PtpReader::create(AravisNodeMap& nodes, const std::string& camera) {
    PtpReader reader(nodes);
    reader.state_ = nodes.first_of({"PtpStatus", "GevIEEE1588Status"});
    reader.latch_data_ = nodes.first_of({"PtpDataSetLatch", "GevIEEE1588DataSetLatch"});
    reader.servo_ = nodes.first_of({"PtpServoStatus"});
    reader.offset_ = nodes.first_of({"PtpOffsetFromMaster", "GevIEEE1588OffsetFromMaster"});
    reader.grandmaster_ =
        nodes.first_of({"PtpGrandmasterClockID", "PtpParentClockID", "GevIEEE1588ParentClockId"});
    reader.latch_ = nodes.first_of({"TimestampLatch", "GevTimestampControlLatch"});
    reader.latched_ = nodes.first_of({"TimestampLatchValue", "GevTimestampValue"});
    const auto lacks = [&](const char* what) {
        return failure(camera, fmt::format("the camera has no {}", what),
                       "trigger = \"ptp\" needs it: trigger this camera by the board");
    };
    GlibError error;
    reader.ticks_per_second_ =
        arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(nodes.device()), error.out());
    if (error.set() || reader.ticks_per_second_ == 0) return lacks("clock of a known frequency");
    if (reader.state_.empty()) return lacks("PtpStatus or GevIEEE1588Status");
    if (reader.latch_.empty() || reader.latched_.empty())
        return lacks("TimestampLatch or GevTimestampControlLatch");
    return reader;
}

std::optional<PtpStatus> PtpReader::status() {
    if (!latch_data_.empty() && !execute(nodes_->device(), latch_data_)) return std::nullopt;
    PtpStatus status;
    status.state = nodes_->read(state_);
    if (status.state.empty()) return std::nullopt;
    if (!servo_.empty()) status.servo_locked = nodes_->read(servo_) == "Locked";
    // Registers of 32 bits without a sign are read as large numbers.
    if (const auto ns = offset_.empty() ? std::nullopt : integer(nodes_->device(), offset_)) {
        const bool unsigned_32 = *ns > INT32_MAX && *ns <= UINT32_MAX;
        status.offset = Duration{unsigned_32 ? static_cast<std::int32_t>(*ns) : *ns};
    }
    if (grandmaster_.empty()) return status;
    if (const auto id = integer(nodes_->device(), grandmaster_))  // a double has too few bits
        status.grandmaster = fmt::format("{:016x}", static_cast<std::uint64_t>(*id));
    return status;
}

std::optional<clock::ClockReading> PtpReader::clock() {
    clock::ClockReading reading;
    reading.before = host_now();
    if (!execute(nodes_->device(), latch_)) return std::nullopt;
    reading.after = host_now();
    const auto shown = integer(nodes_->device(), latched_);
    if (!shown || *shown <= 0) return std::nullopt;
    reading.shown = camera_time(static_cast<std::uint64_t>(*shown), ticks_per_second_);
    return reading;
}

}  // namespace versavis::daemon
