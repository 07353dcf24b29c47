// SPDX-License-Identifier: BSD-3-Clause
// The control socket, by its own calls: what the service does with them is what system tests show.
#include "control/control.hpp"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "../support/temporary_directory.hpp"
#include "control/control_interface.hpp"

using namespace versavis;
using namespace versavis::daemon;
using nlohmann::json;

namespace {

const std::string one_camera = "[[camera]]\nname = \"cam0\"\ndevice = \"10.0.0.2\"\nrate_hz = 20\n";

/// Does what it is asked for when the test says so.
struct SlowService final : Controlled {
    void reconfigure(const Configuration& next) override {
        configuration = next;
        ++progress.asked;
    }
    void ask(const std::string& /*camera*/, CameraWish next) override {
        wish = next;
        ++progress.asked;
    }
    ChangeReport changes(const std::string& /*camera*/) const override { return progress; }
    bool report_lidars(const std::vector<LidarReport>& reports) override {
        return lidars.add(reports, {});
    }

    Configuration configuration;
    std::optional<CameraWish> wish;
    ChangeReport progress;
    LidarReports lidars;
};

class ControlClientEnd {
 public:
    explicit ControlClientEnd(const std::filesystem::path& path)
        : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path.native().copy(address.sun_path, sizeof address.sun_path - 1);
        connected = ::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address),
                              sizeof address) == 0;
    }

    void send(const std::string& bytes) const {
        ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    void call(const std::string& method, const json& parameters = json::object(),
              const char* flag = nullptr) const {
        json message{{"method", method}, {"parameters", parameters}};
        if (flag != nullptr) message[flag] = true;
        send(message.dump() + '\0');
    }
    void finish_sending() const { ::shutdown(socket_.get(), SHUT_WR); }

    /// What came and was not taken yet, up to a NUL; discarded: nothing whole is there.
    json take() {
        char bytes[4096];
        for (ssize_t count = 1; count > 0;) {
            count = ::recv(socket_.get(), bytes, sizeof bytes, MSG_DONTWAIT);
            if (count > 0) received_.append(bytes, static_cast<std::size_t>(count));
            if (count == 0) ended = true;
        }
        const std::size_t end = received_.find('\0');
        if (end == std::string::npos) return json::value_t::discarded;
        const json message = json::parse(received_.substr(0, end));
        received_.erase(0, end + 1);
        return message;
    }

    bool connected = false;
    bool ended = false;

 private:
    FileDescriptor socket_;
    std::string received_;
};

struct ControlBench {
    explicit ControlBench(const std::string& text = one_camera)
        : file(directory.write("versavis.toml", text)) {
        auto socket = ControlSocket::create(path, "no-such-group");
        REQUIRE(socket.has_value());
        control.emplace(std::move(*socket), *ConfigurationDocument::load(file), service);
        health.health = Health::ok;
        health.text = "ok";
        health.cameras = {{"cam0", "streaming", Health::ok, ""}};
    }

    /// Time passes until what was sent is handled.
    void step(Duration by = milliseconds(50)) {
        now = now + by;
        control->tick(health, now);
    }
    json answer(ControlClientEnd& client) {
        step();
        return client.take();
    }

    test::TemporaryDirectory directory;
    std::string file;
    std::filesystem::path path = directory.path() / "control";
    SlowService service;
    Summary health;
    HostTime now{1};
    std::optional<Control> control;
};

const std::string own = "org.versavis.service.";

}  // namespace

TEST_CASE("control: it describes itself") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call("org.varlink.service.GetInfo");
    const json info = bench.answer(client);
    CHECK(info["parameters"]["interfaces"] == json{"org.varlink.service", "org.versavis.service"});
    client.call("org.varlink.service.GetInterfaceDescription",
                {{"interface", "org.versavis.service"}});
    CHECK(bench.answer(client)["parameters"]["description"] == control_interface);
    client.call("org.varlink.service.GetInterfaceDescription", {{"interface", "org.nobody"}});
    CHECK(bench.answer(client) == json{{"error", "org.varlink.service.InterfaceNotFound"},
                                       {"parameters", {{"interface", "org.nobody"}}}});
    std::ifstream contract(VERSAVIS_SOURCE_DIR "/docs/contracts/control.md");
    std::stringstream text;
    text << contract.rdbuf();
    CHECK_THAT(text.str(), Catch::Contains(control_interface));
}

TEST_CASE("control: a call is answered when the camera has done it") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call(own + "StopCamera", {{"camera", "cam0"}});
    CHECK(bench.answer(client).is_discarded());
    CHECK(bench.service.wish == CameraWish::stop);
    // The next call waits for its turn.
    client.call(own + "GetState");
    CHECK(bench.answer(client).is_discarded());
    bench.service.progress.done = 1;
    CHECK(bench.answer(client) == json{{"parameters", json::object()}});
    CHECK(bench.answer(client)["parameters"]["cameras"][0]["state"] == "streaming");
}

TEST_CASE("control: a camera that does not do it in time is no reason to wait for ever") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call(own + "RestartCamera", {{"camera", "cam0"}});
    CHECK(bench.answer(client).is_discarded());
    bench.step(seconds(11));
    CHECK(client.take()["error"] == own + "NoAnswer");
}

TEST_CASE("control: values change, and what a camera refuses is taken back") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call(own + "SetCamera", {{"camera", "cam0"}, {"values", {{"rate_hz", 30}}}});
    CHECK(bench.answer(client).is_discarded());
    CHECK(bench.service.configuration.cameras[0].rate_hz == 30);
    bench.service.progress.done = 1;
    CHECK(bench.answer(client)["parameters"]["changed"] == json{"camera.cam0.rate_hz"});
    // The same again is no change.
    client.call(own + "SetCamera", {{"camera", "cam0"}, {"values", {{"rate_hz", 30}}}});
    CHECK(bench.answer(client)["parameters"]["changed"] == json::array());

    client.call(own + "SetCamera", {{"camera", "cam0"}, {"values", {{"Gain", 99}}}});
    CHECK(bench.answer(client).is_discarded());
    CHECK(bench.service.configuration.cameras[0].features.size() == 1);
    bench.service.progress.done = 2;
    bench.service.progress.refused = "Gain: at most 24";
    CHECK(bench.answer(client) ==
          json{{"error", own + "Refused"}, {"parameters", {{"problems", {"Gain: at most 24"}}}}});
    CHECK(bench.service.configuration.cameras[0].features.empty());
    CHECK(bench.service.configuration.cameras[0].rate_hz == 30);
}

TEST_CASE("control: a bad request changes nothing, and says why") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    const auto refused = [&](const json& values) {
        client.call(own + "SetCamera", {{"camera", "cam0"}, {"values", values}});
        return bench.answer(client);
    };
    CHECK(refused({{"rate_hz", -1}})["error"] == own + "Refused");
    CHECK(refused({{"output", 3}}) == json{{"error", own + "NeedsRestart"},
                                           {"parameters", {{"keys", {"camera.cam0.output"}}}}});
    CHECK(refused({{"rate_hz", {{"a", 1}}}})["parameters"]["parameter"] == "rate_hz");
    CHECK(refused({{"rate_hz", {{1}, {2}}}})["parameters"]["parameter"] == "rate_hz");
    CHECK(refused(json::array())["parameters"]["parameter"] == "values");
    client.call(own + "StopCamera", {{"camera", "cam7"}});
    CHECK(bench.answer(client) ==
          json{{"error", own + "UnknownCamera"},
               {"parameters", {{"camera", "cam7"}, {"cameras", {"cam0"}}}}});
    client.call(own + "Explode");
    CHECK(bench.answer(client)["error"] == "org.varlink.service.MethodNotFound");
    for (const char* nonsense : {"", "{", "[1]", "{\"method\": 3}", "\xff\xfe"}) {
        client.send(nonsense + std::string(1, '\0'));
        CHECK(bench.answer(client)["error"] == "org.varlink.service.InvalidParameter");
    }
    CHECK(bench.service.progress.asked == 0);
}

TEST_CASE("control: what LiDARs do is reported whole, or not at all") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    const json good{{"source", "10.0.0.3"}, {"maker", "Livox"},    {"verdict", "off"},
                    {"hint", "37 s ahead"}, {"behind_ns", 301000}, {"ahead_ns", nullptr}};
    const auto reported = [&](const std::vector<json>& lidars) {
        client.call(own + "ReportLidars", {{"lidars", lidars}});
        return bench.answer(client).value("error", "");
    };
    CHECK(reported({good}).empty());
    const auto known = bench.service.lidars.report({});
    REQUIRE(known.size() == 1);
    CHECK(known[0].source == "10.0.0.3");
    CHECK(known[0].verdict == "off");
    CHECK(known[0].hint == "37 s ahead");
    CHECK(known[0].behind == microseconds(301));
    CHECK_FALSE(known[0].ahead);
    const std::string invalid = "org.varlink.service.InvalidParameter";
    for (const char* key : {"source", "maker", "verdict", "hint"}) {
        json other = good;
        other["source"] = "10.0.0.4";
        json bad = other;
        bad.erase(key);
        CHECK(reported({other, bad}) == invalid);
        bad[key] = 3;
        CHECK(reported({other, bad}) == invalid);
    }
    json bad = good;
    bad["verdict"] = "perhaps";
    CHECK(reported({bad}) == invalid);
    for (const char* source : {"", "cam0", "10.0.0.3\n", "10.0.0.3\x1b[2J", "10.0.0.3\xc2\x9b"}) {
        bad = good;
        bad["source"] = source;
        CHECK(reported({bad}) == invalid);
    }
    bad = good;
    bad["hint"] = std::string(513, 'x');
    CHECK(reported({bad}) == invalid);
    for (const json& figure : {json("3"), json(0.5), json(INT64_MIN), json(UINT64_MAX)}) {
        bad = good;
        bad["ahead_ns"] = figure;
        CHECK(reported({bad}) == invalid);
    }
    CHECK(reported({"all"}) == invalid);
    client.call(own + "ReportLidars", {{"lidars", "all"}});
    CHECK(bench.answer(client)["error"] == invalid);
    std::vector<json> many;
    for (int i = 0; i < 32; ++i) {
        many.push_back(good);
        many.back()["source"] = "10.0.1." + std::to_string(i);
    }
    CHECK(reported(many) == own + "Refused");  // with the first one, 33
    CHECK(bench.service.lidars.report({}).size() == 1);
    many.pop_back();
    CHECK(reported(many).empty());
    CHECK(reported({good}).empty());
}

TEST_CASE("control: the file is read again, whole or not at all") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    const auto reloaded = [&](const std::string& text) {
        std::ofstream(bench.file) << text;
        client.call(own + "Reload");
        return bench.answer(client);
    };
    const json done = reloaded(one_camera + "max_temperature_c = 50\n[memory]\nlock = true\n");
    CHECK(done["parameters"] ==
          json{{"changed", {"camera.cam0.max_temperature_c"}}, {"need_restart", {"memory.lock"}}});
    CHECK(bench.service.configuration.cameras[0].max_temperature_c == 50);
    CHECK_FALSE(bench.service.configuration.memory.lock);
    const json bad = reloaded(one_camera + "max_temperature_c = 40\nrate = 3\n");
    CHECK(bad["error"] == own + "Refused");
    CHECK_THAT(bad["parameters"]["problems"][0].get<std::string>(),
               Catch::Contains("versavis.toml:6:1") && Catch::Contains("rate_hz"));
    CHECK(bench.service.configuration.cameras[0].max_temperature_c == 50);
    CHECK(bench.service.progress.asked == 1);
}

TEST_CASE("control: the folder of the file is read again, too, and a request goes before it") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    std::filesystem::create_directory(bench.file + ".d");
    const auto reloaded = [&](const std::string& text) {
        std::ofstream(bench.file + ".d/10.toml") << "[[camera]]\nname = \"cam0\"\n" << text;
        client.call(own + "Reload");
        return bench.answer(client);
    };
    CHECK(reloaded("max_temperature_c = 50\n")["parameters"]["changed"] ==
          json{"camera.cam0.max_temperature_c"});
    CHECK(bench.service.configuration.cameras[0].max_temperature_c == 50);
    client.call(own + "SetCamera", {{"camera", "cam0"}, {"values", {{"max_temperature_c", 60}}}});
    bench.step();
    CHECK(bench.service.configuration.cameras[0].max_temperature_c == 60);
    bench.service.progress.done = bench.service.progress.asked;
    CHECK(bench.answer(client)["parameters"]["changed"] == json{"camera.cam0.max_temperature_c"});
    CHECK_THAT(reloaded("rate = 3\n")["parameters"]["problems"][0].get<std::string>(),
               Catch::Contains("versavis.toml.d/10.toml:3:1: unknown key 'rate'"));
    CHECK(bench.service.configuration.cameras[0].max_temperature_c == 60);
}

TEST_CASE("control: subscribers get the state, and each change of it once") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call(own + "GetState", json::object(), "more");
    bench.step();
    json state = bench.answer(client);
    CHECK(state["continues"] == true);
    CHECK(state["parameters"]["health"] == "ok");
    CHECK(bench.answer(client).is_discarded());
    bench.health.cameras[0].state = "silent";
    CHECK(bench.answer(client)["parameters"]["cameras"][0]["state"] == "silent");
    CHECK(bench.answer(client).is_discarded());
}

TEST_CASE("control: who wants no answer gets none, and who asks and leaves gets his") {
    ControlBench bench;
    ControlClientEnd client(bench.path);
    client.call(own + "StopCamera", {{"camera", "cam0"}}, "oneway");
    client.call(own + "GetState");
    bench.step();
    bench.service.progress.done = 1;
    bench.step();
    CHECK(bench.answer(client)["parameters"]["health"] == "ok");
    ControlClientEnd brief(bench.path);
    brief.call(own + "GetState");
    brief.finish_sending();
    CHECK(bench.answer(brief)["parameters"]["health"] == "ok");
    bench.step();
    CHECK(brief.take().is_discarded());
    CHECK(brief.ended);
}

TEST_CASE("control: hostile clients take neither places nor memory nor anybody's turn") {
    ControlBench bench;
    ControlClientEnd endless(bench.path);
    for (int i = 0; i < 40; ++i) {
        endless.send(std::string(4096, 'x'));
        bench.step();
    }
    CHECK(endless.take().is_discarded());
    CHECK(endless.ended);

    ControlClientEnd deaf(bench.path);  // asks, and never reads
    for (int i = 0; i < 4000; ++i) {
        deaf.call("org.varlink.service.GetInterfaceDescription",
                  {{"interface", "org.versavis.service"}});
        bench.step();
    }
    std::vector<std::unique_ptr<ControlClientEnd>> crowd;
    for (int i = 0; i < 100; ++i) {
        crowd.push_back(std::make_unique<ControlClientEnd>(bench.path));
        REQUIRE(crowd.back()->connected);
        bench.step();
    }
    CHECK(crowd.front()->take().is_discarded());
    CHECK(crowd.front()->ended);
    ControlClientEnd honest(bench.path);
    honest.call(own + "GetState");
    CHECK(bench.answer(honest)["parameters"]["health"] == "ok");
    // All that the deaf one got is what the kernel and the limit hold.
    std::size_t answers = 0;
    while (!deaf.take().is_discarded()) ++answers;
    CHECK(deaf.ended);
    CHECK(answers < 1000);
}

TEST_CASE("control: only its own user may connect where the group is missing") {
    ControlBench bench;
    struct stat status {};
    REQUIRE(::stat(bench.path.c_str(), &status) == 0);
    CHECK((status.st_mode & 0777U) == 0600);
    CHECK(S_ISSOCK(status.st_mode));
    bench.control.reset();
    CHECK_FALSE(std::filesystem::exists(bench.path));
    CHECK_FALSE(ControlSocket::create(std::string(200, 'x'), "").has_value());
    CHECK_FALSE(ControlSocket::create("/nowhere/control", "").has_value());
}
