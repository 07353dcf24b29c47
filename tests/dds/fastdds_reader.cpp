// SPDX-License-Identifier: BSD-3-Clause
// fastdds_reader DOMAIN TOPIC=TYPE...: reads topics of ROS 2 with Fast DDS, the middleware that is
// ROS 2's default, and prints for each message one line of JSON: topic, size, SHA-256 of all its
// bytes, and the first 12, which of most types are the encoding and the stamp. Ends with its input.
#include <sodium.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <cstdio>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

constexpr std::uint32_t largest_message = 16 * 1024 * 1024;
/// An image of several megabytes arrives at once.
constexpr std::uint32_t receive_buffer = 4 * 1024 * 1024;
/// Behind a message that is sent again, others wait.
constexpr int kept_messages = 500;

using Bytes = std::vector<unsigned char>;

/// Whatever bytes a message has.
class RawType : public fast::TopicDataType {
 public:
    explicit RawType(const std::string& name) {
        setName(name.c_str());
        m_typeSize = largest_message;
        m_isGetKeyDefined = false;
    }
    bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }
    bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return 0U; };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

std::mutex output;

class Printer : public fast::DataReaderListener {
 public:
    explicit Printer(std::string topic) : topic_(std::move(topic)) {}

    void on_data_available(fast::DataReader* reader) override {
        Bytes bytes;
        fast::SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            Bytes hash(crypto_hash_sha256_BYTES);
            crypto_hash_sha256(hash.data(), bytes.data(), bytes.size());
            const auto hex = [](const unsigned char* from, std::size_t size) {
                std::string text(2 * size + 1, '\0');
                sodium_bin2hex(text.data(), text.size(), from, size);
                text.pop_back();
                return text;
            };
            const std::lock_guard lock(output);
            std::printf(
                "{\"topic\": \"%s\", \"size\": %zu, \"sha256\": \"%s\", \"head\": \"%s\"}\n",
                topic_.c_str(), bytes.size(), hex(hash.data(), hash.size()).c_str(),
                hex(bytes.data(), std::min<std::size_t>(12, bytes.size())).c_str());
            std::fflush(stdout);
        }
    }

 private:
    std::string topic_;
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3 || sodium_init() < 0) return 64;
    fast::DomainParticipantQos qos;
    qos.transport().use_builtin_transports = false;
    const auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    transport->receiveBufferSize = receive_buffer;
    qos.transport().user_transports.push_back(transport);
    auto* participant = fast::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<std::uint32_t>(std::stoul(argv[1])), qos);
    if (participant == nullptr) return 69;
    auto* subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    std::vector<std::unique_ptr<Printer>> printers;
    for (int i = 2; i < argc; ++i) {
        const std::string named = argv[i];
        const std::string topic = named.substr(0, named.find('='));
        const std::string type = named.substr(topic.size() + 1);
        fast::TypeSupport support(new RawType(type));
        support.register_type(participant);
        auto* description = participant->create_topic("rt" + topic, type, fast::TOPIC_QOS_DEFAULT);
        fast::DataReaderQos reader_qos;
        reader_qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
        reader_qos.history().kind = fast::KEEP_LAST_HISTORY_QOS;
        reader_qos.history().depth = kept_messages;
        reader_qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        printers.push_back(std::make_unique<Printer>(topic));
        if (subscriber->create_datareader(description, reader_qos, printers.back().get()) ==
            nullptr)
            return 69;
    }
    while (std::getchar() != EOF) {
    }
    participant->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
    return 0;
}
