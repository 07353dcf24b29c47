// SPDX-License-Identifier: BSD-3-Clause
#include "export/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>

#include "export/bag_export.hpp"
#include "export/csv_export.hpp"
#include "export/euroc_export.hpp"
#include "export/export_directory.hpp"
#include "posix/file.hpp"
#include "verify/verification.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

constexpr auto camchain_attachment = "calibration/camchain.yaml";
constexpr auto imu_attachment = "calibration/imu.yaml";

struct NamedText {
    std::string where;
    std::string text;
};

/// The file that the user named, else the attachment; none: there is neither.
Expected<std::optional<NamedText>> find_yaml(const Recording& recording, const std::string& file,
                                             const char* attachment) {
    if (file.empty()) {
        const Attachment* found = recording.attachment(attachment);
        if (found == nullptr) return std::optional<NamedText>();
        return std::optional(NamedText{fmt::format("attachment {}", attachment), found->content});
    }
    std::ifstream in(file, std::ios::binary);
    if (!in) return failure(file, "cannot be read", "check its name and permissions");
    return std::optional(NamedText{file, std::string(std::istreambuf_iterator<char>(in), {})});
}

/// Where each camera that is exported stands in the camchain; none: it does not.
using Places = std::vector<std::optional<std::size_t>>;

/// By their topics where all of the camchain, or all that are exported, are named by them, else by
/// their order. Empty: neither fits.
Places places_in(const std::vector<CalibratedCamera>& chain, const Selection& selection,
                 ExportReport& report) {
    Places places(selection.cameras.size());
    std::size_t named = 0;
    for (std::size_t i = 0; i < places.size(); ++i)
        for (std::size_t place = 0; place < chain.size() && !places[i]; ++place)
            if (chain[place].topic == image_topic(selection.cameras[i].name)) {
                places[i] = place;
                ++named;
            }
    if (named > 0 && (named == chain.size() || named == places.size())) return places;
    if (chain.size() != places.size()) {
        report.notes.push_back(fmt::format(
            "the camchain has {} cameras, and their topics do not name the {} of the recording: it "
            "is not used",
            chain.size(), places.size()));
        return {};
    }
    report.notes.emplace_back("cameras of the camchain are matched by their order");
    for (std::size_t i = 0; i < places.size(); ++i) places[i] = i;
    return places;
}

void drop_other_sizes(const std::vector<CalibratedCamera>& chain, const Selection& selection,
                      Places& places, ExportReport& report) {
    for (std::size_t i = 0; i < places.size(); ++i) {
        if (!places[i]) continue;
        const CalibratedCamera& camera = chain[*places[i]];
        const auto& selected = selection.cameras[i];
        if (camera.width == selected.width && camera.height == selected.height) continue;
        report.notes.push_back(fmt::format(
            "{} was calibrated with {} x {} pixels and recorded with {} x {}: its "
            "calibration is not used",
            selected.name, camera.width, camera.height, selected.width, selected.height));
        places[i].reset();
    }
}

/// Cameras of camchain.yaml are numbered as those that are exported, without holes.
void note_chain(const std::vector<CalibratedCamera>& cameras, const Places& places,
                const Selection& selection, ExportReport& report) {
    for (std::size_t i = 1; i < cameras.size(); ++i)
        if (!cameras[i].to_previous)
            report.notes.push_back(fmt::format(
                "the camchain does not say how {} lies to {}: T_cn_cnm1 is not in camchain.yaml",
                selection.cameras[i].name, selection.cameras[i - 1].name));
    for (std::size_t i = cameras.size(); i < places.size(); ++i)
        report.notes.push_back(
            fmt::format("{} is not in camchain.yaml: {}", selection.cameras[i].name,
                        !places[i] ? "its calibration is not known"
                                   : "that of " + selection.cameras[cameras.size()].name +
                                         ", before it, is not known; --streams sets the order"));
}

void assign_cameras(const std::vector<CalibratedCamera>& chain, ExportReport& report,
                    ExportCalibration& calibration) {
    const Selection& selection = report.selection;
    Places places = places_in(chain, selection, report);
    if (places.empty()) return;
    drop_other_sizes(chain, selection, places, report);
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < places.size() && places[i]; ++i) order.push_back(*places[i]);
    calibration.chain = rearranged(chain, order);
    for (std::size_t i = 0; i < places.size(); ++i)
        if (places[i]) calibration.cameras[i] = chain[*places[i]];
    note_chain(calibration.chain, places, selection, report);
}

Expected<ExportCalibration> find_calibration(const Recording& recording,
                                             const ExportSettings& settings, ExportReport& report) {
    ExportCalibration calibration;
    calibration.cameras.resize(report.selection.cameras.size());
    const auto chain = find_yaml(recording, settings.camchain, camchain_attachment);
    const auto noise = find_yaml(recording, settings.imu_yaml, imu_attachment);
    if (!chain) return Unexpected(chain.error());
    if (!noise) return Unexpected(noise.error());
    if (*chain) {
        const auto cameras = parse_camchain((*chain)->text, (*chain)->where);
        if (!cameras) return Unexpected(cameras.error());
        assign_cameras(*cameras, report, calibration);
    }
    if (*noise) {
        const auto parsed = parse_imu_noise((*noise)->text, (*noise)->where);
        if (!parsed) return Unexpected(parsed.error());
        calibration.noise = *parsed;
    } else if (!report.selection.imus.empty()) {
        report.notes.emplace_back(
            "the IMU's noise is not known, so there is no imu.yaml: give a file with --imu");
    }
    return calibration;
}

Expected<> write_kalibr(const Selection& selection, const ExportCalibration& calibration,
                        const std::filesystem::path& directory) {
    std::vector<CalibratedCamera> cameras = calibration.chain;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        cameras[i].key = fmt::format("cam{}", i);
        cameras[i].topic = image_topic(selection.cameras[i].name);
    }
    if (!cameras.empty())
        if (auto written = write_new_file(directory / "camchain.yaml", camchain_text(cameras));
            !written)
            return written;
    for (std::size_t i = 0; i < selection.imus.size() && calibration.noise; ++i) {
        const auto& imu = selection.imus[i];
        const std::string name = i == 0 ? "imu.yaml" : fmt::format("imu{}.yaml", i);
        if (auto written = write_new_file(
                directory / name, imu_text(*calibration.noise, imu_topic(imu.name), imu.rate_hz));
            !written)
            return written;
    }
    return {};
}

Expected<> write_left_out(const Selection& selection, const std::filesystem::path& directory) {
    std::string text = "stream,time_ns,number,tick,reason\n";
    for (const auto& item : selection.left_out)
        text += fmt::format("{},{},{},{},{}\n", selection.stream(item.stream), item.time.ns,
                            item.number, item.tick, to_string(item.reason));
    return write_new_file(directory / "left_out.csv", text);
}

void note_peculiarities(const std::vector<ExportFormat>& formats, ExportKind kind,
                        ExportReport& report) {
    const Selection& selection = report.selection;
    for (std::size_t i = 0; i < formats.size(); ++i) {
        const auto& camera = selection.cameras[i];
        if (formats[i].shift != 0)
            report.notes.push_back(fmt::format(
                "{}: values of {} are shifted left by {} bits, to the full 16-bit range",
                camera.name, pixel_format_name(camera.pixel_format), formats[i].shift));
        if (formats[i].encoding.starts_with("bayer"))
            report.notes.push_back(fmt::format(
                "{}: images are raw mosaics ({}), not colour{}", camera.name, formats[i].encoding,
                kind == ExportKind::bag && formats[i].bytes == 2
                    ? "; Kalibr refuses bags with mosaics of more than 8 bits: record "
                      "a format of 8 bits for it, or export with --to euroc"
                    : ""));
    }
    if (selection.seconds_doubted > 0)
        report.notes.push_back(fmt::format(
            "{} stamps may be off by whole seconds, all alike: receiver and host differed",
            selection.seconds_doubted));
    if (selection.sequences.size() == 1 && selection.sequences[0].bounds.joined)
        report.notes.emplace_back(
            "--join: all is one sequence, across restarts, epochs and holes of the IMU");
    for (const auto& imu : selection.imus) {
        if (imu.samples == 0)
            report.notes.push_back(fmt::format("{}: has no sample to export", imu.name));
        if (imu.accel_age_ns != 0)
            report.notes.push_back(fmt::format(
                "{}: accelerations are up to {:.3f} ms older than the angular rates in their row; "
                "the column accel_age_ns of its metadata says by how much",
                imu.name, imu.accel_age_ns / 1e6));
    }
}

void note_recording(const Recording& recording, ExportReport& report) {
    if (!recording.facts().defect.empty())
        report.notes.push_back(fmt::format("the recording: {}; only what can be read is exported",
                                           recording.facts().defect));
    for (const std::string& file : recording.facts().missing)
        report.notes.push_back(fmt::format("the recording: {} is missing", file));
    for (const std::string& damage : recording.damages())
        report.notes.push_back(fmt::format("the recording: {}; it is left out", damage));
    const auto gaps = recording.gaps();
    if (!gaps) return;
    std::map<std::string, std::uint64_t> lost;
    for (const auto& gap : *gaps)
        if (gap.reason == "lost") lost[gap.stream] += gap.items;
    for (const auto& [stream, items] : lost)
        report.notes.push_back(
            fmt::format("{}: {} items were lost while recording", stream, items));
}

Expected<> export_sequence(const Recording& recording, const ExportSettings& settings,
                           const std::vector<ExportFormat>& formats,
                           const ExportCalibration& calibration, std::size_t index,
                           const std::filesystem::path& directory, ExportReport& report) {
    std::error_code error;
    std::filesystem::create_directories(directory, error);
    if (error) return failure(directory.string(), "cannot be created: " + error.message());
    const SelectedSequence& sequence = report.selection.sequences[index];
    const std::size_t noted = report.notes.size();
    const auto stem = std::filesystem::path(settings.recording).stem().string();
    auto written =
        settings.kind == ExportKind::euroc
            ? export_euroc(recording, report.selection, sequence, formats, calibration, directory,
                           settings.watch, report.notes)
            : export_bag(recording, report.selection, sequence, formats,
                         directory / (stem + ".bag"), settings.compression, settings.watch);
    if (!written) return written;
    if (const std::string folder = sequence_folder(report.selection, index); !folder.empty())
        for (std::size_t i = noted; i < report.notes.size(); ++i)
            report.notes[i] = folder + ": " + report.notes[i];
    return write_kalibr(report.selection, calibration, directory);
}

Expected<> export_selected(const Recording& recording, const ExportSettings& settings,
                           const std::filesystem::path& directory, ExportReport& report) {
    auto selection = select_items(recording, settings.choice, settings.watch);
    if (!selection) return Unexpected(selection.error());
    report.selection = std::move(*selection);
    std::vector<ExportFormat> formats;
    for (const auto& camera : report.selection.cameras) {
        if (camera.width == 0) {  // no frame at all
            formats.emplace_back();
            continue;
        }
        auto format = export_format(camera.name, camera.pixel_format);
        if (!format) return Unexpected(format.error());
        formats.push_back(*format);
    }
    const auto calibration = find_calibration(recording, settings, report);
    if (!calibration) return Unexpected(calibration.error());
    note_peculiarities(formats, settings.kind, report);
    for (std::size_t i = 0; i < report.selection.sequences.size(); ++i)
        if (auto written =
                export_sequence(recording, settings, formats, *calibration, i,
                                directory / sequence_folder(report.selection, i), report);
            !written)
            return written;
    return write_left_out(report.selection, directory);
}

/// The verdict on all stamps, which does not depend on what was selected.
Expected<> write_verification(const ExportSettings& settings,
                              const std::filesystem::path& directory, ExportReport& report) {
    settings.watch.show("stamps verified", 0, 1);
    auto verified = verify_recording(settings.recording, [&] { return !settings.watch.stopped(); });
    if (settings.watch.stopped()) return stopped_error();
    if (!verified) {
        report.notes.push_back("its stamps cannot be verified: " + verified.error().message());
        return {};
    }
    report.verdict = verified->sentence();
    if (auto written = write_new_file(directory / "verification.html", to_html(*verified));
        !written)
        return written;
    return write_new_file(
        directory / "verification.json",
        to_json(*verified).dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace

std::string image_topic(const std::string& camera) { return "/" + camera + "/image_raw"; }
std::string imu_topic(const std::string& imu) { return "/" + imu; }

Expected<ExportReport> export_recording(const ExportSettings& settings) {
    const auto recording = Recording::open(settings.recording);
    if (!recording) return Unexpected(recording.error());
    recording->check();  // sets of frames are chosen before pixels are read
    auto directory = ExportDirectory::create(settings.directory);
    if (!directory) return Unexpected(directory.error());
    ExportReport report;
    report.directory = settings.directory;
    if (settings.kind == ExportKind::csv) {
        auto written =
            export_csv(*recording, settings.choice.streams, directory->part(), settings.watch);
        if (!written) return Unexpected(written.error());
        report.written = std::move(*written);
    } else if (auto written = export_selected(*recording, settings, directory->part(), report);
               !written) {
        return Unexpected(written.error());
    }
    note_recording(*recording, report);
    if (auto written = write_verification(settings, directory->part(), report); !written)
        return Unexpected(written.error());
    if (auto written = write_new_file(directory->part() / "README.txt", readme(report)); !written)
        return Unexpected(written.error());
    if (auto finished = directory->finish(); !finished) return Unexpected(finished.error());
    return report;
}

}  // namespace versavis::client
