// SPDX-License-Identifier: BSD-3-Clause
#include "export/euroc_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <system_error>
#include <tuple>

#include "base/task_queue.hpp"
#include "export/export_image.hpp"
#include "export/metadata_csv.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

namespace fs = std::filesystem;

constexpr auto imu_columns =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";

/// What is to be written next, in the order of the file.
struct Job {
    ItemPlace place;
    std::uint32_t index;  ///< of the sequence's frame or sample
    bool sample;
};

std::vector<Job> jobs_of(const SelectedSequence& sequence) {
    std::vector<Job> jobs;
    jobs.reserve(sequence.frames.size() + sequence.samples.size());
    for (std::uint32_t i = 0; i < sequence.frames.size(); ++i)
        jobs.push_back({sequence.frames[i].place, i, false});
    for (std::uint32_t i = 0; i < sequence.samples.size(); ++i)
        jobs.push_back({sequence.samples[i].place, i, true});
    std::sort(jobs.begin(), jobs.end(), [](const Job& a, const Job& b) {
        return std::tie(a.place.file, a.place.chunk, a.place.item) <
               std::tie(b.place.file, b.place.chunk, b.place.item);
    });
    return jobs;
}

std::string transform_lines(const Transform& transform) {
    std::string data;
    for (const double one : transform) data += (data.empty() ? "" : ", ") + yaml_number(one);
    return fmt::format("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", data);
}

std::string numbers(const std::vector<double>& values) {
    std::string text;
    for (const double one : values) text += (text.empty() ? "" : ", ") + yaml_number(one);
    return "[" + text + "]";
}

std::string euroc_distortion(const std::string& kalibr) {
    return kalibr == "radtan" ? "radial-tangential" : kalibr;
}

std::string camera_yaml(const SelectedCamera& camera, const ExportFormat& format,
                        const std::optional<CalibratedCamera>& calibrated) {
    std::string text = fmt::format(
        "%YAML:1.0\n# Unknown values are left out.\nsensor_type: camera\n"
        "comment: \"stream {}, pixels {}\"\n",
        camera.name, format.encoding);
    if (calibrated && calibrated->from_imu) text += transform_lines(inverse(*calibrated->from_imu));
    text += fmt::format("rate_hz: {:.6g}\nresolution: [{}, {}]\n", camera.rate_hz, camera.width,
                        camera.height);
    if (calibrated)
        text += fmt::format(
            "camera_model: {}\nintrinsics: {}\ndistortion_model: {}\ndistortion_coefficients: {}\n",
            calibrated->model, numbers(calibrated->intrinsics),
            euroc_distortion(calibrated->distortion), numbers(calibrated->coefficients));
    return text;
}

std::string imu_yaml(const SelectedImu& imu, const std::optional<ImuNoise>& noise) {
    constexpr Transform identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    std::string text = fmt::format(
        "%YAML:1.0\n# Unknown values are left out. The body is the IMU.\nsensor_type: imu\n"
        "comment: \"stream {}\"\n{}rate_hz: {:.6g}\n",
        imu.name, transform_lines(identity), imu.rate_hz);
    if (noise)
        text += fmt::format(
            "gyroscope_noise_density: {}\ngyroscope_random_walk: {}\n"
            "accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n",
            yaml_number(noise->gyroscope_density), yaml_number(noise->gyroscope_walk),
            yaml_number(noise->accelerometer_density), yaml_number(noise->accelerometer_walk));
    return text;
}

class EurocExport {
 public:
    EurocExport(const Recording& recording, const Selection& selection,
                const SelectedSequence& sequence, const std::vector<ExportFormat>& formats,
                const fs::path& directory, const ExportWatch& watch)
        : recording_(recording),
          selection_(selection),
          sequence_(sequence),
          formats_(formats),
          mav_(directory / "mav0"),
          watch_(watch),
          without_exposure_(selection.cameras.size()) {}

    Expected<> run(const ExportCalibration& calibration) {
        if (auto made = make_folders(); !made) return made;
        if (auto written = write_yaml(calibration); !written) return written;
        if (auto opened = open_files(); !opened) return opened;
        if (auto written = write_items(); !written) return written;
        if (auto written = finish_images(); !written) return written;
        for (NewFile& file : files_)
            if (auto closed = file.close(); !closed) return closed;
        return write_lists();
    }

    void note_exposures(std::vector<std::string>& notes) const {
        for (std::size_t i = 0; i < without_exposure_.size(); ++i)
            if (without_exposure_[i] > 0)
                notes.push_back(fmt::format(
                    "{}: the exposure of {} frames is not known; exposure.csv has no row for them",
                    selection_.cameras[i].name, without_exposure_[i]));
    }

 private:
    static constexpr std::size_t files_of_camera = 3;  ///< data, exposure, stamps
    static constexpr std::size_t files_of_imu = 3;     ///< data, the same for Kalibr, stamps

    fs::path camera_folder(std::size_t camera) const { return mav_ / fmt::format("cam{}", camera); }
    fs::path imu_folder(std::size_t imu) const { return mav_ / fmt::format("imu{}", imu); }

    NewFile& camera_file(std::size_t camera, std::size_t which) {
        return files_[camera * files_of_camera + which];
    }
    NewFile& imu_file(std::size_t imu, std::size_t which) {
        return files_[selection_.cameras.size() * files_of_camera + imu * files_of_imu + which];
    }

    Expected<> make_folders() const {
        std::error_code error;
        for (std::size_t i = 0; i < selection_.cameras.size() && !error; ++i)
            fs::create_directories(camera_folder(i) / "data", error);
        for (std::size_t i = 0; i < selection_.imus.size() && !error; ++i)
            fs::create_directories(imu_folder(i), error);
        if (error) return failure(mav_.string(), "cannot be created: " + error.message());
        return {};
    }

    Expected<> write_yaml(const ExportCalibration& calibration) const {
        auto written = write_new_file(mav_ / "body.yaml", "%YAML:1.0\ncomment: VersaVIS\n");
        for (std::size_t i = 0; i < selection_.cameras.size() && written; ++i)
            written = write_new_file(
                camera_folder(i) / "sensor.yaml",
                camera_yaml(selection_.cameras[i], formats_[i], calibration.cameras[i]));
        for (std::size_t i = 0; i < selection_.imus.size() && written; ++i)
            written = write_new_file(imu_folder(i) / "sensor.yaml",
                                     imu_yaml(selection_.imus[i], calibration.noise));
        return written;
    }

    Expected<> open_files() {
        std::vector<std::pair<fs::path, std::string>> list;
        for (std::size_t i = 0; i < selection_.cameras.size(); ++i) {
            list.emplace_back(camera_folder(i) / "data.csv", "#timestamp [ns],filename\n");
            list.emplace_back(camera_folder(i) / "exposure.csv", "#timestamp [ns],exposure [ns]\n");
            list.emplace_back(camera_folder(i) / "stamps.csv",
                              "#name_ns," + csv_columns(ring::StreamKind::frames) + "\n");
        }
        for (std::size_t i = 0; i < selection_.imus.size(); ++i) {
            list.emplace_back(imu_folder(i) / "data.csv", imu_columns);
            list.emplace_back(mav_ / fmt::format("imu{}.csv", i), imu_columns);
            list.emplace_back(imu_folder(i) / "stamps.csv",
                              "#" + csv_columns(ring::StreamKind::imu) + "\n");
        }
        for (const auto& [path, header] : list) {
            auto file = NewFile::create(path);
            if (!file) return Unexpected(file.error());
            file->write(header);
            files_.push_back(std::move(*file));
        }
        return {};
    }

    Expected<> write_items() {
        const std::vector<Job> jobs = jobs_of(sequence_);
        for (std::size_t done = 0; done < jobs.size(); ++done) {
            if (watch_.stopped()) return stopped_error();
            const Job& job = jobs[done];
            Expected<> written;
            auto read = recording_.at(job.place, [&](const RecordedItem& item) {
                if (job.sample)
                    write_sample(sequence_.samples[job.index].imu, item);
                else
                    written = write_frame(sequence_.frames[job.index], item);
                return true;
            });
            if (!read) return read;
            if (!written) return written;
            if (!job.sample) watch_.show("images", ++frames_, sequence_.frames.size());
        }
        return {};
    }

    Expected<> write_frame(const SelectedFrame& frame, const RecordedItem& item) {
        const auto data = unpack<FrameMetadata>(item.metadata);
        const ExportFormat& format = formats_[frame.camera];
        const std::string name = fmt::format("{}.png", frame.name.ns);
        const fs::path path = camera_folder(frame.camera) / "data" / name;
        camera_file(frame.camera, 0).write(fmt::format("{},{}\n", frame.name.ns, name));
        if (data.exposure.ns != 0)
            camera_file(frame.camera, 1)
                .write(fmt::format("{},{}\n", frame.name.ns, data.exposure.ns));
        else
            ++without_exposure_[frame.camera];
        camera_file(frame.camera, 2).write(fmt::format("{},{}\n", frame.name.ns, csv_row(item)));
        if (!item.png.empty() && !item.payload.empty() && format.shift == 0)
            return write_new_file(
                path, {reinterpret_cast<const char*>(item.png.data()), item.png.size()});
        auto pixels = export_pixels(format, data, item.payload);
        if (pixels.empty())
            return failure(item.stream,
                           fmt::format("the pixels of frame {} are damaged", item.number),
                           "record again, or leave this camera out");
        if (images_.full())
            if (auto written = *images_.take(true); !written) return written;
        images_.push([path, format, data, pixels = std::move(pixels)] {
            return write_png(path, format, data.width, data.height, pixels);
        });
        return {};
    }

    /// Error: of the first image that could not be written.
    Expected<> finish_images() {
        Expected<> result;
        while (auto written = images_.take(true))
            if (result && !*written) result = *written;
        return result;
    }

    void write_sample(std::uint32_t imu, const RecordedItem& item) {
        const auto data = unpack<ImuMetadata>(item.metadata);
        const std::string row =
            fmt::format("{},{},{},{},{},{},{}\n", item.time.ns, data.gyro[0], data.gyro[1],
                        data.gyro[2], data.accel[0], data.accel[1], data.accel[2]);
        imu_file(imu, 0).write(row);
        imu_file(imu, 1).write(row);
        imu_file(imu, 2).write(csv_row(item) + "\n");
    }

    Expected<> write_lists() const {
        std::string times;
        for (const SelectedFrame& frame : sequence_.frames)
            if (frame.camera == 0) times += fmt::format("{}\n", frame.name.ns);
        return write_new_file(mav_ / "times.txt", times);
    }

    const Recording& recording_;
    const Selection& selection_;
    const SelectedSequence& sequence_;
    const std::vector<ExportFormat>& formats_;
    const fs::path mav_;
    const ExportWatch& watch_;
    std::vector<NewFile> files_;
    TaskQueue<Expected<>> images_{1};
    std::uint64_t frames_ = 0;
    std::vector<std::uint64_t> without_exposure_;  ///< frames of each camera
};

}  // namespace

Expected<> export_euroc(const Recording& recording, const Selection& selection,
                        const SelectedSequence& sequence, const std::vector<ExportFormat>& formats,
                        const ExportCalibration& calibration, const fs::path& directory,
                        const ExportWatch& watch, std::vector<std::string>& notes) {
    EurocExport exported(recording, selection, sequence, formats, directory, watch);
    auto written = exported.run(calibration);
    exported.note_exposures(notes);
    return written;
}

}  // namespace versavis::client
