// SPDX-License-Identifier: BSD-3-Clause
#include "live_verification.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/stream_names.hpp"
#include "evaluate/camera_calibration.hpp"
#include "evaluate/picture_offsets.hpp"
#include "progress_line.hpp"
#include "verify/offset_watch.hpp"
#include "verify/picture_judge.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// Two or three departing ones fit into a minute, whenever they begin.
constexpr Duration live_stretch = seconds(15);

/// Rotations over this time are compared: shorter ones show less of the motion, and cost more.
constexpr Duration least_interval = milliseconds(90);

/// Pictures are reduced to this, or up to twice as much.
constexpr std::uint32_t least_width = 240;

/// Half as many features as of a recording: tracking them is most of the work.
constexpr int features = 150;

/// So long without any frame, the samples are read all the same, and a signal is noticed.
constexpr Duration patience = milliseconds(200);

double ms(Duration d) { return static_cast<double>(d.ns) * 1e-6; }

/// Time of day of an instant that is so long ago.
std::string time_of_day(Duration ago) {
    const std::time_t then = std::time(nullptr) - ago.ns / seconds(1).ns;
    return fmt::format("{:%H:%M:%S}", fmt::localtime(then));
}

/// One camera: its stream, the rotation between its frames, and what became of the comparison.
class LiveCamera {
 public:
    LiveCamera(std::string name, FrameStream stream, const LiveVerificationSettings& settings,
               const std::optional<Camchain>& camchain)
        : name_(std::move(name)),
          stream_(std::move(stream)),
          settings_(settings),
          camchain_(camchain) {}

    const std::string& name() const { return name_; }
    FrameStream& stream() { return stream_; }
    const std::optional<OffsetWatch>& watch() const { return watch_; }
    bool departed() const { return departed_; }
    OutputTime latest() const { return latest_; }

    void restart() {
        comparison_.restart();
        tracker_.reset();
    }
    void add(const GyroSample& sample) { comparison_.add(sample); }
    std::optional<StretchComparison> take() { return comparison_.take(); }

    /// Errors: the camera's calibration is not for these frames.
    Expected<> add(const Frame& frame, const EpochTime& gyro_time) {
        latest_ = frame.time.output();
        const bool suspect = (frame.data.flags & flag_suspect) != 0;
        if (suspect || !frame.time.compares_with(gyro_time)) {
            tracker_.reset();
            return {};
        }
        const auto since = frame.time.since(followed_);
        if (tracker_ && since && *since < least_interval) return {};
        const auto view = frame.image();
        if (!view) return {};  // it has fewer pixels than it should
        if (view->layout.channels == 0)
            return failure(name_,
                           fmt::format("its pixel format, {}, cannot be compared",
                                       pixel_format_name(frame.data.pixel_format)),
                           "choose an unpacked one, such as Mono8, or name the other cameras");
        const std::uint32_t factor = reduction(*view, least_width);
        GreyImage image = reduced_image(*view, factor);
        if (!frame.valid()) return {};  // overtaken by the writer while it was read
        if (!tracker_)
            if (auto begun = begin(*view, factor); !begun) return begun;
        followed_ = frame.time;
        auto rotation = tracker_->add(std::move(image), latest_);
        if (!rotation) {  // the size changed
            tracker_.reset();
            return {};
        }
        if (*rotation) comparison_.add(**rotation);
        return {};
    }

    void judge(const PictureOffset& offset) {
        watch_->add(offset);
        departed_ = departed_ || watch_->departure();
    }

 private:
    Expected<> begin(const ImageView& view, std::uint32_t factor) {
        CameraCalibration calibration{pinhole(settings_.focal, view.width, view.height), {}};
        if (camchain_) {
            auto found = calibration_of(*camchain_, name_, view.width, view.height);
            if (!found) return Unexpected(found.error());
            calibration = *found;
        }
        auto tracker = FeatureRotation::create(reduced(calibration.model, factor), features);
        if (!tracker) return Unexpected(tracker.error());
        tracker_.emplace(std::move(*tracker));
        if (watch_) return {};
        watch_.emplace();
        if (calibration.time_shift_s)
            watch_.emplace(Duration{std::llround(*calibration.time_shift_s * 1e9)});
        return {};
    }

    std::string name_;
    FrameStream stream_;
    const LiveVerificationSettings& settings_;
    const std::optional<Camchain>& camchain_;
    std::optional<FeatureRotation> tracker_;
    std::optional<OffsetWatch> watch_;
    PictureComparison comparison_{live_stretch};
    EpochTime followed_;  ///< the last frame that was compared
    OutputTime latest_;
    bool departed_ = false;
};

class LiveVerification {
 public:
    LiveVerification(const LiveVerificationSettings& settings, std::optional<Camchain> camchain)
        : settings_(settings), camchain_(std::move(camchain)) {}

    Expected<Grade> run() {
        const HostTime begin = host_now();
        const auto ends = [&] {
            return settings_.stop() ||
                   (settings_.seconds > 0 &&
                    static_cast<double>((host_now() - begin).ns) >= settings_.seconds * 1e9);
        };
        while (!imu_ && !ends())
            if (const auto opened = open_streams(); !opened) return Unexpected(opened.error());
        while (!ends())
            if (const auto read = read_streams(); !read) return Unexpected(read.error());
        progress_.end();
        return grade();
    }

 private:
    void say(const std::string& text, bool alarm = false) {
        progress_.end();
        settings_.say(text, alarm);
    }

    /// Waits for a second when there is no IMU or no camera yet.
    Expected<> open_streams() {
        StreamOptions options;
        options.instance = settings_.instance;
        std::vector<std::string> imus;
        std::vector<std::string> frames;
        for (const std::string& name : stream_names(settings_.instance)) {
            if (FrameStream::open(name, options)) frames.push_back(name);
            if (ImuStream::open(name, options)) imus.push_back(name);
        }
        const auto imu = settings_.imu.empty() && imus.size() == 1 ? imus.front() : settings_.imu;
        if (imu.empty() && imus.size() > 1)
            return failure("--imu", fmt::format("there are several: {}", fmt::join(imus, ", ")),
                           "choose one");
        const std::vector<std::string> wanted =
            settings_.cameras.empty() ? frames : settings_.cameras;
        const bool there = !wanted.empty() &&
                           std::find(imus.begin(), imus.end(), imu) != imus.end() &&
                           std::all_of(wanted.begin(), wanted.end(), [&](const std::string& one) {
                               return std::find(frames.begin(), frames.end(), one) != frames.end();
                           });
        if (!there) return wait_for(wanted, imu);
        imu_.emplace(*ImuStream::open(imu, options));
        imu_name_ = imu;
        for (const std::string& name : wanted) {
            auto stream = FrameStream::open(name, options);
            if (!stream) return Unexpected(stream.error());
            cameras_.push_back(
                std::make_unique<LiveCamera>(name, std::move(*stream), settings_, camchain_));
        }
        if (!settings_.json)
            say(
                fmt::format("{} against {}: learning the usual offset takes about a minute of "
                            "motion",
                            fmt::join(wanted, ", "), imu_name_));
        return {};
    }

    Expected<> wait_for(const std::vector<std::string>& cameras, const std::string& imu) {
        if (!waiting_)
            fmt::print(stderr,
                       "versavis: waiting for {} and {} of instance {}; 'versavis list' shows what "
                       "there is\n",
                       cameras.empty() ? "a camera" : fmt::format("{}", fmt::join(cameras, ", ")),
                       imu.empty() ? "an IMU" : imu, settings_.instance);
        waiting_ = true;
        const timespec second{1, 0};
        nanosleep(&second, nullptr);  // a signal ends it early
        return {};
    }

    Expected<> read_streams() {
        // The frames of one camera set the pace: waking for each sample would cost more.
        auto frame = cameras_.front()->stream().next(patience);
        read_samples();
        for (const auto& camera : cameras_) {
            if (camera != cameras_.front()) frame = camera->stream().next();
            for (; frame || frame.error().why != Pause::nothing; frame = camera->stream().next()) {
                if (!frame && frame.error().why == Pause::gone) break;
                if (!frame) continue;
                if (auto added = camera->add(*frame, gyro_time_); !added) return added;
            }
            while (const auto stretch = camera->take()) report(*camera, *stretch);
        }
        show_progress();
        return {};
    }

    void read_samples() {
        for (auto sample = imu_->next(); sample || sample.error().why != Pause::nothing;
             sample = imu_->next()) {
            if (!sample && sample.error().why == Pause::gone) return;
            if (!sample) continue;
            const auto since = sample->time.since(gyro_time_);
            if (since && *since <= Duration{}) continue;
            if (!since)
                for (const auto& camera : cameras_) camera->restart();
            gyro_time_ = sample->time;
            if ((sample->data.flags & (flag_sensor_error | flag_repeated)) != 0) continue;
            const auto& gyro = sample->data.gyro;
            for (const auto& camera : cameras_)
                camera->add(GyroSample{gyro_time_.output(), {gyro[0], gyro[1], gyro[2]}});
        }
    }

    void report(LiveCamera& camera, const StretchComparison& stretch) {
        const auto before = camera.watch()->departure();
        const bool learned = camera.watch()->usual().has_value();
        if (stretch.offset) camera.judge(*stretch.offset);
        if (settings_.json) return say(to_json(camera, stretch).dump());
        const auto& usual = camera.watch()->usual();
        const auto& departure = camera.watch()->departure();
        if (usual && !learned)
            say(fmt::format("{}: time of {} = time of {} {:+.3f} ms +- {:.3f} ms from now on",
                            camera.name(), imu_name_, camera.name(), ms(usual->offset),
                            ms(usual->sigma)));
        if (departure && !before) say(alarm(camera, *departure), true);
        if (before && !departure)
            say(fmt::format("{}: pictures and stamps belong together again", camera.name()));
    }

    std::string alarm(const LiveCamera& camera, const Departure& departure) const {
        const auto same = [&](const auto& other) {
            return other->watch() && other->watch()->departure() &&
                   absolute(other->watch()->departure()->by - departure.by) < least_departure;
        };
        std::string what = "its stamps are wrong";
        if (cameras_.size() == 1)
            what = fmt::format("its stamps or those of {} are wrong", imu_name_);
        else if (std::all_of(cameras_.begin(), cameras_.end(), same))
            what = fmt::format("all cameras do, so the stamps of {} are wrong", imu_name_);
        return fmt::format(
            "{}: pictures and stamps differ by {:+.1f} +- {:.1f} ms since {}: {}; for the cause, "
            "record and run 'versavis verify'",
            camera.name(), ms(departure.by), ms(departure.sigma),
            time_of_day(camera.latest() - departure.since), what);
    }

    json to_json(const LiveCamera& camera, const StretchComparison& stretch) const {
        const auto& usual = camera.watch()->usual();
        const auto& departure = camera.watch()->departure();
        json line{{"camera", camera.name()},
                  {"imu", imu_name_},
                  {"from_ns", stretch.from.ns},
                  {"to_ns", stretch.to.ns},
                  {"state", departure ? "differs"
                            : usual   ? "agrees"
                                      : "learning"}};
        const auto add = [&](const char* name, const char* sigma_name, Duration value,
                             Duration sigma) {
            line[name] = value.ns;
            line[sigma_name] = sigma.ns;
        };
        if (stretch.offset)
            add("offset_ns", "sigma_ns", stretch.offset->offset, stretch.offset->sigma);
        else
            line["not_compared"] = stretch.offset.error().message();
        if (usual) add("usual_ns", "usual_sigma_ns", usual->offset, usual->sigma);
        if (!departure) return line;
        add("differs_ns", "differs_sigma_ns", departure->by, departure->sigma);
        line["since_ns"] = departure->since.ns;
        return line;
    }

    void show_progress() {
        std::string text;
        for (const auto& camera : cameras_) {
            const auto& watch = camera->watch();
            text += fmt::format("{}{}: {}", text.empty() ? "" : "   ", camera->name(),
                                !watch               ? "no frames yet"
                                : watch->departure() ? "differs"
                                : !watch->usual()    ? "learning"
                                                     : "agrees");
        }
        progress_.show(text);
    }

    Grade grade() const {
        Grade worst = Grade::proved;
        if (cameras_.empty()) worst = Grade::plausible;
        for (const auto& camera : cameras_) {
            if (!camera->watch() || !camera->watch()->usual())
                worst = std::min(worst, Grade::plausible);
            if (camera->departed()) worst = Grade::untrusted;
        }
        return worst;
    }

    const LiveVerificationSettings& settings_;
    std::optional<Camchain> camchain_;
    std::optional<ImuStream> imu_;
    std::string imu_name_;
    std::vector<std::unique_ptr<LiveCamera>> cameras_;
    EpochTime gyro_time_;
    ProgressLine progress_;
    bool waiting_ = false;
};

}  // namespace

Expected<Grade> verify_live(const LiveVerificationSettings& settings) {
    FeatureRotation::use_one_thread();
    std::optional<Camchain> camchain;
    if (!settings.calibration.empty()) {
        auto read = read_camchain(settings.calibration);
        if (!read) return Unexpected(read.error());
        camchain = std::move(*read);
    }
    if (!camchain && !(settings.focal > 0))
        return failure("verify --live", "does not know the lenses of the cameras",
                       "give --calibration camchain.yaml, or --focal with the focal length in "
                       "pixels");
    return LiveVerification(settings, std::move(camchain)).run();
}

}  // namespace versavis::client
