// SPDX-License-Identifier: BSD-3-Clause
#include "check/camera_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "board/board_link.hpp"
#include "camera/aravis_stream.hpp"
#include "camera/camera_discovery.hpp"
#include "camera/camera_setup.hpp"
#include "engine/ring/directory.hpp"
#include "posix/thread.hpp"
#include "publish/clock_recorder.hpp"

namespace versavis::daemon {

namespace {

/// For the board to be found, and its clock to be known.
constexpr Duration board_patience = seconds(15);

/// Frames and edges may follow the last pulse by so much.
constexpr Duration settling = milliseconds(700);

/// Pulses at each output: the pattern's, and some at the camera's rate.
constexpr std::size_t pulses_at_rate = 10;

/// Boards report one edge in 100 ms of an input whose output sends no pulses.
constexpr double check_rate_hz = 10;

/// The longer of the two exposures: the shorter is a quarter of it. Longer ones leave no room for
/// readout; shorter ones are hard to distinguish from the delays of lines.
constexpr double longest_exposure_us = 4000;
constexpr double exposure_of_period = 0.2;

/// By which pulses are longer the second time.
constexpr double least_widening_us = 200;

/// Exchanges that the ring of clocks holds; nobody reads them.
constexpr std::uint32_t clock_items = 1024;

/// Buffers of a camera, so that a late host loses no frame.
constexpr unsigned buffers = 8;

/// What the board reports.
class Recorder final : public BoardListener {
 public:
    struct Records {
        std::vector<wire::Exposure> exposures;
        std::vector<wire::Event> strays;
        std::size_t skipped = 0;  ///< triggers
    };

    void board_restarted() override { set_connected(false); }
    void board_synchronised() override {}
    void board_connected() override { set_connected(true); }
    void cameras_changed(std::uint8_t /*outputs*/, std::uint8_t /*other_rate*/) override {}
    void board_lost() override { set_connected(false); }
    void exposure(const wire::Exposure& record, HostTime /*received*/) override {
        const std::lock_guard lock(mutex_);
        records_.exposures.push_back(record);
        changed_.notify_all();
    }
    bool imu_sample(const wire::ImuSample& /*sample*/, HostTime /*received*/) override {
        return true;
    }
    void exchange_doubted(const Implausibility& /*doubt*/) override {}
    void board_event(const wire::Event& event, HostTime /*received*/) override {
        const std::lock_guard lock(mutex_);
        if (event.kind == wire::BoardEventKind::stray_edge) records_.strays.push_back(event);
        if (event.kind == wire::BoardEventKind::trigger_skipped) ++records_.skipped;
        if (event.kind == wire::BoardEventKind::triggers_skipped) records_.skipped += event.detail;
    }

    bool wait_connected(Duration timeout) {
        std::unique_lock lock(mutex_);
        return changed_.wait_for(lock, std::chrono::nanoseconds(timeout.ns),
                                 [&] { return connected_; });
    }

    /// It did not go or restart since it was connected first.
    bool stayed() {
        const std::lock_guard lock(mutex_);
        return connected_ && !lost_;
    }

    /// Waits until so many pulses of the output are reported, or the board is gone.
    void wait_pulses(unsigned output, std::size_t count, Duration timeout) {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::nanoseconds(timeout.ns), [&] {
            const auto of = [&](const wire::Exposure& record) { return record.camera == output; };
            const auto sent =
                std::count_if(records_.exposures.begin(), records_.exposures.end(), of);
            return lost_ || static_cast<std::size_t>(sent) >= count;
        });
    }

    /// Of the time that passes now; waits it out.
    void wait(Duration duration) {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::nanoseconds(duration.ns), [] { return false; });
    }

    Records take() {
        const std::lock_guard lock(mutex_);
        return std::exchange(records_, {});
    }

 private:
    void set_connected(bool connected) {
        const std::lock_guard lock(mutex_);
        lost_ = lost_ || (connected_ && !connected);
        connected_ = connected;
        changed_.notify_all();
    }

    std::mutex mutex_;
    std::condition_variable changed_;
    bool connected_ = false;
    bool lost_ = false;
    Records records_;
};

/// A camera that is set up and streams; what it sends is counted. It gets its exposure back.
class CountedCamera {
 public:
    CountedCamera(const CameraConfiguration& configuration, OpenCamera opened)
        : configuration_(configuration),
          opened_(std::move(opened)),
          nodes_(arv_camera_get_device(opened_.camera.get())) {}
    ~CountedCamera() {
        stop_ = true;
        if (thread_.joinable()) thread_.join();
        arv_camera_stop_acquisition(opened_.camera.get(), nullptr);
        if (working_.ns != 0) set_exposure(working_);
        if (!auto_.empty()) static_cast<void>(nodes_.set("ExposureAuto", auto_));
    }
    CountedCamera(const CountedCamera&) = delete;
    CountedCamera& operator=(const CountedCamera&) = delete;

    const CameraConfiguration& configuration() const { return configuration_; }
    FrameCount frames() const { return {arrived_, incomplete_}; }
    Duration latency() const { return setup_.lines.trigger.delay; }

    Expected<> start(const std::vector<CameraPreset>& presets) {
        ArvCamera* camera = opened_.camera.get();
        if (auto done = set_up_camera(camera, nodes_, configuration_, presets, setup_); !done)
            return done;
        if (nodes_.available("ExposureAuto")) {
            auto_ = nodes_.read("ExposureAuto");
            static_cast<void>(nodes_.set("ExposureAuto", "Off"));
        }
        working_ = read_exposure();
        if (arv_camera_is_gv_device(camera))
            if (auto done = set_up_packets(camera, configuration_); !done) return done;
        GlibError error;
        stream_.reset(arv_camera_create_stream(camera, nullptr, nullptr, error.out()));
        for (unsigned i = 0; stream_ && i < buffers; ++i)
            arv_stream_push_buffer(stream_.get(), arv_buffer_new_allocate(setup_.payload));
        if (!error.set()) arv_camera_start_acquisition(camera, error.out());
        if (error.set()) return failure(configuration_.name, error.text());
        thread_ = start_thread("receive", [this] { receive(); });
        return {};
    }

    /// Returns what the camera made of it.
    Duration set_exposure(Duration exposure) {
        const std::string us = fmt::format("{:.3f}", static_cast<double>(exposure.ns) * 1e-3);
        if (!setup_.exposure_feature.empty())
            static_cast<void>(nodes_.set(setup_.exposure_feature, us));
        return read_exposure();
    }
    Duration working_exposure() const { return working_; }

    bool answers() const {
        GlibError error;
        arv_camera_get_payload(opened_.camera.get(), error.out());
        return !error.set();
    }

 private:
    Duration read_exposure() const { return fixed_exposure(nodes_, setup_.exposure_feature); }

    void receive() {
        while (!stop_) {
            constexpr guint64 poll_us = 50'000;
            ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream_.get(), poll_us);
            if (buffer == nullptr) continue;
            // One without all of its packets was triggered, too.
            ++arrived_;
            if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS) ++incomplete_;
            arv_stream_push_buffer(stream_.get(), buffer);
        }
    }

    const CameraConfiguration& configuration_;
    OpenCamera opened_;
    AravisNodeMap nodes_;
    CameraSetup setup_;
    std::string auto_;  ///< its ExposureAuto, and
    Duration working_;  ///< its exposure, before the check
    Object<ArvStream> stream_;
    std::atomic<std::size_t> arrived_{0};
    std::atomic<std::size_t> incomplete_{0};
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

/// Both exposures, and widths of pulses, that the cameras of a configuration can all take.
struct Probe {
    double exposure_us = 0;
    double pulse_us = 0;
};

/// Each camera by itself, and nothing else.
CameraConfiguration alone(CameraConfiguration camera) {
    camera.trigger = TriggerSource::board;
    camera.master.clear();
    camera.phase_us = 0;
    if (camera.strobe == Strobe::none) camera.strobe = Strobe::active_high;
    return camera;
}

/// The cameras at the rate and exposure that they are configured with.
Configuration at_work(const Configuration& configuration) {
    Configuration work;
    work.board = configuration.board;
    work.board.keep_configuration = false;
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.trigger == TriggerSource::board) work.cameras.push_back(alone(camera));
    return work;
}

/// All of the board's outputs send the same pulses, each on demand, and all of its inputs are
/// looked at.
Configuration for_check(const Configuration& configuration, std::uint32_t present,
                        const Probe& probe) {
    Configuration all = at_work(configuration);
    all.cameras.clear();
    for (unsigned output = 0; output < wire::camera_count; ++output) {
        if ((present >> output & 1U) == 0) continue;
        const CameraConfiguration* own = find_camera_at(configuration, output);
        CameraConfiguration camera = alone(own == nullptr ? CameraConfiguration{} : *own);
        camera.name = fmt::format("output {}", output);
        camera.output = output;
        camera.rate_hz = std::min(camera.rate_hz, check_rate_hz);
        camera.gap_us = 0;
        camera.exposure_us = probe.exposure_us;
        camera.max_exposure_us = 2 * probe.exposure_us;
        camera.pulse_us = probe.pulse_us;
        all.cameras.push_back(camera);
    }
    return all;
}

/// One connection to the board, with a configuration of its own.
class Session {
 public:
    Session(const Configuration& configuration, ClockRecorder& clock_recorder,
            clock::Translator& translator)
        : link_([board = configuration.board] { return open_byte_stream(board); }, configuration,
                configuration.clock.exchange_rate_hz, translator, clock_recorder, recorder_) {
        link_.start();
    }
    ~Session() { link_.stop(); }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    Expected<> connect() {
        if (recorder_.wait_connected(board_patience)) return {};
        const BoardReport report = link_.report();
        return failure("board", fmt::format("{}: {}", to_string(report.state), report.hint),
                       "connect it, and stop the service while this runs");
    }

    std::uint32_t present() const { return link_.report().present; }

    /// What happens without a trigger.
    void idle(PulseRun& run) {
        recorder_.take();
        recorder_.wait(seconds(1));
        fill(run, 0);
    }

    /// Error: the board went, or sends none.
    Expected<> pulse(unsigned output, double rate_hz, PulseRun& run) {
        recorder_.take();
        std::size_t patterned = 0;
        for (unsigned tick = 0; tick < wire::start_pattern_length; ++tick)
            patterned += wire::start_pattern_bits[output] >> tick & 1U;
        const auto mask = static_cast<std::uint8_t>(1U << output);
        const double longest_s = (wire::start_pattern_length + 3 * pulses_at_rate) / rate_hz + 2;
        link_.start_cameras(mask, pairing::Start::pattern);
        recorder_.wait_pulses(output, patterned + pulses_at_rate,
                              Duration{std::llround(longest_s * 1e9)});
        link_.stop_cameras(mask);
        recorder_.wait(settling);
        fill(run, output);
        if (!recorder_.stayed())
            return failure("board", "it restarted or went during the check",
                           "check its USB cable and power, and check again");
        if (run.pulses.size() + run.skipped >= patterned) return {};
        return failure("board",
                       fmt::format("it reports {} pulses of output {} in {:.0f} s, not {}",
                                   run.pulses.size(), output, longest_s, patterned),
                       "see what 'versavis board info' says of it");
    }

 private:
    void fill(PulseRun& run, unsigned output) {
        const Recorder::Records records = recorder_.take();
        run.skipped = records.skipped;
        for (const wire::Exposure& record : records.exposures) {
            if (run.output && record.camera == output)
                run.pulses.push_back(BoardTime{record.trigger_ns});
            if (record.start_ns != wire::no_time)
                run.inputs[record.camera].push_back({BoardTime{record.start_ns}, true});
            if (record.end_ns != wire::no_time)
                run.inputs[record.camera].push_back({BoardTime{record.end_ns}, false});
        }
        for (const wire::Event& stray : records.strays)
            if (stray.source < wire::camera_count)
                run.inputs[stray.source].push_back({BoardTime{stray.time_ns}, stray.value != 0});
        std::sort(run.pulses.begin(), run.pulses.end());
        for (auto& edges : run.inputs)
            std::sort(edges.begin(), edges.end(),
                      [](const LineEdge& a, const LineEdge& b) { return a.at < b.at; });
    }

    Recorder recorder_;
    BoardLink link_;
};

/// All that a check holds, and the order of its steps.
class CameraCheck {
 public:
    CameraCheck(const Configuration& configuration, clock::Translator& translator,
                ClockRecorder& recorder, const std::function<void(const std::string&)>& say)
        : configuration_(configuration), translator_(translator), recorder_(recorder), say_(say) {}

    /// Cameras that cannot be set up have a finding instead.
    Expected<> prepare() {
        const auto presets = load_presets(preset_directory(configuration_));
        if (!presets) return Unexpected(presets.error());
        for (const CameraConfiguration& camera : configuration_.cameras) {
            if (camera.trigger != TriggerSource::board) continue;
            say_(fmt::format("setting up {}", camera.name));
            if (const auto done = prepare(camera, *presets); !done)
                report_.cameras.push_back(not_ready(camera.name, done.error().message()));
        }
        if (!cameras_.empty()) return {};
        return failure("cameras", report_.cameras.empty()
                                      ? "the configuration has none that a board triggers"
                                      : report_.cameras.front().findings.front().text);
    }

    Expected<CameraCheckReport> run() {
        if (auto done = work(); !done) return Unexpected(done.error());
        for (const unsigned scale : {1U, 4U})
            if (auto done = pulse_all(probes(scale)); !done) return Unexpected(done.error());
        const std::vector<CameraWiring> judged = judge_wiring(wired_cameras(), runs_);
        for (std::size_t i = 0; i < judged.size(); ++i)
            report_.cameras.push_back(
                cameras_[i]->answers()
                    ? judged[i]
                    : not_ready(
                          judged[i].name,
                          "it stopped answering during the check: check its power and cable"));
        return report_;
    }

 private:
    static CameraWiring not_ready(const std::string& camera, const std::string& why) {
        return {camera, false, {{"not_ready", why}}};
    }

    Expected<> prepare(const CameraConfiguration& camera,
                       const std::vector<CameraPreset>& presets) {
        auto opened = open_camera(camera.name, camera.device, {descriptions_, claims_, aravis_},
                                  [] { return false; });
        if (!opened) return Unexpected(opened.error().error);
        auto counted = std::make_unique<CountedCamera>(camera, std::move(*opened));
        if (auto started = counted->start(presets); !started) return started;
        cameras_.push_back(std::move(counted));
        return {};
    }

    /// `scale` 1 or 4: exposures and widths that no signal of fixed length matches twice.
    Probe probes(unsigned scale) const {
        double longest_us = longest_exposure_us;
        double pulse_us = longest_us;
        for (const CameraConfiguration& camera : configuration_.cameras) {
            longest_us = std::min(longest_us, exposure_of_period * 1e6 / camera.rate_hz);
            pulse_us = std::min(pulse_us, camera.pulse_us);
        }
        const double wider_us = std::max(2 * pulse_us, pulse_us + least_widening_us);
        return {longest_us * scale / 4, scale == 1 ? pulse_us : wider_us};
    }

    /// Without triggers, and with those of the configuration.
    Expected<> work() {
        const Configuration configured = at_work(configuration_);
        Session session(configured, recorder_, translator_);
        if (auto connected = session.connect(); !connected) return connected;
        present_ = session.present();
        say_("looking for what happens without a trigger");
        static_cast<void>(observe({}, false, [&](PulseRun& run) {
            session.idle(run);
            return Expected<>{};
        }));
        std::vector<Duration> exposures;
        for (const auto& camera : cameras_) exposures.push_back(camera->working_exposure());
        for (const CameraConfiguration& camera : configured.cameras)
            if (auto done = pulse(session, camera, exposures, true); !done) return done;
        return {};
    }

    Expected<> pulse_all(const Probe& probe) {
        std::vector<Duration> exposures;
        for (const auto& camera : cameras_)
            exposures.push_back(camera->set_exposure(from_us(probe.exposure_us)));
        const Configuration all = for_check(configuration_, present_, probe);
        Session session(all, recorder_, translator_);
        if (auto connected = session.connect(); !connected) return connected;
        for (const CameraConfiguration& output : all.cameras)
            if (auto done = pulse(session, output, exposures, false); !done) return done;
        return {};
    }

    Expected<> pulse(Session& session, const CameraConfiguration& camera,
                     const std::vector<Duration>& exposures, bool working) {
        say_(fmt::format("pulses at output {}{}", camera.output, working ? ", as configured" : ""));
        return observe(camera.output, working, [&](PulseRun& run) {
            run.width = from_us(camera.pulse_us);
            run.exposures = exposures;
            for (std::size_t i = 0; i < cameras_.size(); ++i)
                if (cameras_[i]->configuration().exposure_by_pulse) run.exposures[i] = run.width;
            return session.pulse(camera.output, camera.rate_hz, run);
        });
    }

    template <class Happen>
    Expected<> observe(std::optional<unsigned> output, bool working, Happen&& happen) {
        PulseRun run;
        run.output = output;
        run.working = working;
        std::vector<FrameCount> before;
        for (const auto& camera : cameras_) before.push_back(camera->frames());
        auto happened = happen(run);
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
            const FrameCount after = cameras_[i]->frames();
            run.frames.push_back(
                {after.arrived - before[i].arrived, after.incomplete - before[i].incomplete});
        }
        runs_.push_back(std::move(run));
        return happened;
    }

    std::vector<WiredCamera> wired_cameras() const {
        std::vector<WiredCamera> wired;
        for (const auto& camera : cameras_)
            wired.push_back({camera->configuration().name, camera->configuration().output,
                             camera->configuration().strobe != Strobe::none, camera->latency()});
        return wired;
    }

    const Configuration& configuration_;
    clock::Translator& translator_;
    ClockRecorder& recorder_;
    const std::function<void(const std::string&)>& say_;
    DescriptionSandbox descriptions_{own_program, "/dev/null"};  // nothing is kept
    DeviceLocks claims_;
    std::timed_mutex aravis_;
    std::vector<std::unique_ptr<CountedCamera>> cameras_;
    std::uint32_t present_ = 0;  ///< outputs of the board
    std::vector<PulseRun> runs_;
    CameraCheckReport report_;
};

}  // namespace

bool CameraCheckReport::right() const {
    return std::all_of(cameras.begin(), cameras.end(),
                       [](const CameraWiring& camera) { return camera.right; });
}

Expected<CameraCheckReport> check_cameras(const Configuration& configuration,
                                          const std::function<void(const std::string&)>& say) {
    // Its directory is claimed, so that no service of this configuration runs meanwhile.
    auto directory = ring::OwnedDirectory::claim(instance_directory(configuration.instance));
    if (!directory) return Unexpected(directory.error());
    auto output = clock::OutputClock::create(clock::OutputClockKind::monotonic_raw);
    if (!output) return Unexpected(output.error());
    clock::Translator translator(std::move(*output));
    auto ring =
        ring::Writer::create({directory->path()}, {"clock", ring::StreamKind::clock, clock_items});
    if (!ring) return Unexpected(ring.error());
    ClockRecorder recorder(std::move(*ring), translator);
    CameraCheck check(configuration, translator, recorder, say);
    if (auto ready = check.prepare(); !ready) return Unexpected(ready.error());
    return check.run();
}

std::string to_text(const CameraCheckReport& report) {
    std::string text;
    for (const CameraWiring& camera : report.cameras)
        for (const WiringFinding& finding : camera.findings)
            text +=
                fmt::format("{}: {}{}\n", camera.name, camera.right ? "ok: " : "", finding.text);
    return text;
}

std::string to_json(const CameraCheckReport& report) {
    nlohmann::json cameras = nlohmann::json::array();
    for (const CameraWiring& camera : report.cameras) {
        nlohmann::json findings = nlohmann::json::array();
        for (const WiringFinding& finding : camera.findings)
            findings.push_back({{"code", finding.code}, {"text", finding.text}});
        cameras.push_back({{"name", camera.name}, {"right", camera.right}, {"findings", findings}});
    }
    return nlohmann::json{{"right", report.right()}, {"cameras", cameras}}.dump(
        2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace versavis::daemon
