// SPDX-License-Identifier: BSD-3-Clause
#include "transport.hpp"

#ifdef VERSAVIS_BENCH_ICEORYX
#include <unistd.h>

#include <iceoryx_hoofs/log/logmanager.hpp>
#include <iceoryx_posh/popo/untyped_publisher.hpp>
#include <iceoryx_posh/popo/untyped_subscriber.hpp>
#include <iceoryx_posh/popo/wait_set.hpp>
#include <iceoryx_posh/runtime/posh_runtime.hpp>
#include <stdexcept>
#include <thread>

#include "../../support/process.hpp"
#include "../../support/temporary_directory.hpp"
#endif

namespace versavis::bench {

#ifdef VERSAVIS_BENCH_ICEORYX

namespace {

constexpr auto memory_pools = R"([general]
version = 1
[[segment]]
[[segment.mempool]]
size = 128
count = 4096
[[segment.mempool]]
size = 2400000
count = 40
)";

// Frames that wait for a reader at most: as many as a reader of a ring may be behind. A pool must
// have room for them.
constexpr std::uint64_t waiting_frames = 8;

iox::capro::ServiceDescription service(const Channel& channel) {
    const std::string name = channel.directory.filename();
    return {"versavis", "bench", iox::capro::IdString_t(iox::cxx::TruncateToCapacity, name)};
}

/// Each process, which is to be quiet, is known to the daemon by a name.
void register_process() {
    using iox::log::LogManager;
    LogManager::GetLogManager().SetDefaultLogLevel(iox::log::LogLevel::kError,
                                                   iox::log::LogLevelOutput::kHideLogLevel);
    const std::string name = "bench-" + std::to_string(::getpid());
    iox::runtime::PoshRuntime::initRuntime(iox::RuntimeName_t(iox::cxx::TruncateToCapacity, name));
}

/// Publishers and subscribers find each other through the daemon.
template <class Condition>
void wait_until(Condition condition) {
    for (int i = 0; !condition(); ++i) {
        if (i == 5000) throw std::runtime_error("iceoryx: publisher and reader did not meet");
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

class IceoryxSender : public Sender {
 public:
    explicit IceoryxSender(const Channel& channel)
        : size_(static_cast<std::uint32_t>(channel.size)), publisher_(service(channel)) {
        wait_until([this] { return publisher_.isOffered(); });
    }
    std::byte* loan() override {
        auto loaned = publisher_.loan(size_);
        if (loaned.has_error()) throw std::runtime_error("iceoryx: no chunk to be had");
        chunk_ = *loaned;
        return static_cast<std::byte*>(chunk_);
    }
    void publish() override { publisher_.publish(chunk_); }

 private:
    std::uint32_t size_;
    iox::popo::UntypedPublisher publisher_;
    void* chunk_ = nullptr;
};

class IceoryxReceiver : public Receiver {
 public:
    explicit IceoryxReceiver(const Channel& channel)
        : polling_(channel.polling), subscriber_(service(channel), options(channel)) {
        if (waiting_.attachState(subscriber_, iox::popo::SubscriberState::HAS_DATA).has_error())
            throw std::runtime_error("iceoryx: the reader cannot wait");
        wait_until([this] {
            return subscriber_.getSubscriptionState() == iox::SubscribeState::SUBSCRIBED;
        });
    }
    ~IceoryxReceiver() override { release(); }
    const std::byte* receive() override {
        release();
        take();
        if (chunk_ == nullptr && !polling_) {
            waiting_.timedWait(iox::units::Duration::fromMilliseconds(20));
            take();
        }
        return static_cast<const std::byte*>(chunk_);
    }

 private:
    static iox::popo::SubscriberOptions options(const Channel& channel) {
        iox::popo::SubscriberOptions options;
        if (channel.size != imu_size) options.queueCapacity = waiting_frames;
        return options;
    }
    void take() {
        subscriber_.take().and_then([this](const void* chunk) { chunk_ = chunk; });
    }
    void release() {
        if (chunk_ != nullptr) subscriber_.release(chunk_);
        chunk_ = nullptr;
    }

    bool polling_;
    iox::popo::UntypedSubscriber subscriber_;
    iox::popo::WaitSet<1> waiting_;
    const void* chunk_ = nullptr;
};

std::unique_ptr<Sender> sender(const Channel& channel) {
    register_process();
    return std::make_unique<IceoryxSender>(channel);
}

std::unique_ptr<Receiver> receiver(const Channel& channel, unsigned) {
    register_process();
    return std::make_unique<IceoryxReceiver>(channel);
}

struct Roudi {
    test::TemporaryDirectory directory;
    test::Process process{{"iox-roudi", "--monitoring-mode", "off", "--config-file",
                           directory.write("roudi.toml", memory_pools)},
                          directory.path() / "log"};
};

}  // namespace

std::optional<Transport> iceoryx() { return Transport{"iceoryx", sender, receiver}; }

std::shared_ptr<void> start_roudi() {
    auto roudi = std::make_shared<Roudi>();
    if (!roudi->process.wait_for_output("RouDi is ready for clients", seconds(10))) return nullptr;
    return roudi;
}

#else

std::optional<Transport> iceoryx() { return std::nullopt; }
std::shared_ptr<void> start_roudi() { return nullptr; }

#endif

}  // namespace versavis::bench
