// SPDX-License-Identifier: BSD-3-Clause
// cyclone_reader DOMAIN PREFIX: reads what versavis-dds publishes with types that idlc makes of
// ros.idl, and prints each message as one line of JSON. Ends with its input.
#include <dds/dds.h>
#include <poll.h>
#include <sodium.h>

#include <cinttypes>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "ros.h"

namespace {

using nlohmann::json;

json stamp(const std_msgs_msg_dds__Header_& header) {
    return {{"stamp_ns", std::int64_t{header.stamp_.sec_} * 1'000'000'000 + header.stamp_.nanosec_},
            {"frame_id", header.frame_id_}};
}

std::string sha256(const unsigned char* bytes, std::size_t size) {
    unsigned char hash[crypto_hash_sha256_BYTES];
    crypto_hash_sha256(hash, bytes, size);
    std::string text(2 * sizeof hash + 1, '\0');
    sodium_bin2hex(text.data(), text.size(), hash, sizeof hash);
    text.pop_back();
    return text;
}

json to_json(const sensor_msgs_msg_dds__Image_& image) {
    return {{"header", stamp(image.header_)},
            {"height", image.height_},
            {"width", image.width_},
            {"encoding", image.encoding_},
            {"step", image.step_},
            {"size", image.data_._length},
            {"sha256", sha256(image.data_._buffer, image.data_._length)}};
}

json to_json(const sensor_msgs_msg_dds__Imu_& sample) {
    const auto& rate = sample.angular_velocity_;
    const auto& acceleration = sample.linear_acceleration_;
    return {{"header", stamp(sample.header_)},
            {"rate", {rate.x_, rate.y_, rate.z_}},
            {"acceleration", {acceleration.x_, acceleration.y_, acceleration.z_}},
            {"orientation_known", sample.orientation_covariance_[0] >= 0}};
}

json to_json(const sensor_msgs_msg_dds__CompressedImage_& image) {
    const std::uint32_t size = image.data_._length;
    std::string text(2 * size + 1, '\0');
    sodium_bin2hex(text.data(), text.size(), image.data_._buffer, size);
    text.pop_back();
    return {{"header", stamp(image.header_)}, {"format", image.format_}, {"data", text}};
}

json to_json(const sensor_msgs_msg_dds__CameraInfo_& info) {
    const auto* d = info.d_._buffer;
    return {{"header", stamp(info.header_)},
            {"height", info.height_},
            {"width", info.width_},
            {"model", info.distortion_model_},
            {"d", std::vector<double>(d, d + info.d_._length)},
            {"k", info.k_},
            {"p", info.p_}};
}

json to_json(const diagnostic_msgs_msg_dds__DiagnosticArray_& array) {
    json statuses = json::array();
    for (std::uint32_t i = 0; i < array.status_._length; ++i) {
        const auto& status = array.status_._buffer[i];
        json values = json::object();
        for (std::uint32_t k = 0; k < status.values_._length; ++k)
            values[status.values_._buffer[k].key_] = status.values_._buffer[k].value_;
        statuses.push_back({{"level", status.level_},
                            {"name", status.name_},
                            {"message", status.message_},
                            {"hardware_id", status.hardware_id_},
                            {"values", values}});
    }
    return {{"header", stamp(array.header_)}, {"status", statuses}};
}

/// What ROS 2 reads of a writer before any message: its type, and the hash of that.
void print_writers(dds_entity_t reader) {
    void* samples[1]{};
    dds_sample_info_t info[1];
    while (dds_take(reader, samples, info, 1, 1) > 0) {
        const auto* writer = static_cast<const dds_builtintopic_endpoint_t*>(samples[0]);
        void* data = nullptr;
        std::size_t size = 0;
        if (info[0].valid_data && dds_qget_userdata(writer->qos, &data, &size)) {
            const json line{{"topic", "writers"},
                            {"of", writer->topic_name},
                            {"type", writer->type_name},
                            {"userdata", std::string(static_cast<const char*>(data), size)}};
            std::puts(line.dump().c_str());
            dds_free(data);
        }
        dds_return_loan(reader, samples, 1);
    }
}

struct Topic {
    std::string name;
    dds_entity_t reader;
    void (*print)(const std::string&, const void*);
};

template <class Message>
void print(const std::string& topic, const void* message) {
    json line = to_json(*static_cast<const Message*>(message));
    line["topic"] = topic;
    std::puts(line.dump().c_str());
    std::fflush(stdout);
}

template <class Message>
Topic open(dds_entity_t participant, const std::string& name, const dds_topic_descriptor_t& type) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
    const auto topic =
        dds_create_topic(participant, &type, ("rt" + name).c_str(), nullptr, nullptr);
    const auto reader = dds_create_reader(participant, topic, qos, nullptr);
    dds_delete_qos(qos);
    return {name, reader, &print<Message>};
}

void take(const Topic& topic) {
    void* messages[1]{};
    dds_sample_info_t info[1];
    while (dds_take(topic.reader, messages, info, 1, 1) > 0) {
        if (info[0].valid_data) topic.print(topic.name, messages[0]);
        dds_return_loan(topic.reader, messages, 1);
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3 || sodium_init() < 0) return 64;
    const auto domain = static_cast<dds_domainid_t>(std::stoul(argv[1]));
    const std::string prefix = argv[2];
    if (dds_create_domain(domain,
                          "<Domain id=\"any\"><Internal><SocketReceiveBufferSize "
                          "min=\"4MiB\" max=\"8MiB\"/></Internal></Domain>") < 0)
        return 69;
    const auto participant = dds_create_participant(domain, nullptr, nullptr);
    if (participant < 0) return 69;
    std::vector<Topic> topics;
    for (const char* camera : {"/cam0", "/cam1"}) {
        topics.push_back(open<sensor_msgs_msg_dds__Image_>(
            participant, prefix + camera + "/image_raw", sensor_msgs_msg_dds__Image__desc));
        topics.push_back(open<sensor_msgs_msg_dds__CameraInfo_>(
            participant, prefix + camera + "/camera_info", sensor_msgs_msg_dds__CameraInfo__desc));
    }
    topics.push_back(open<sensor_msgs_msg_dds__CompressedImage_>(
        participant, prefix + "/cam1/image_raw/compressed",
        sensor_msgs_msg_dds__CompressedImage__desc));
    topics.push_back(open<sensor_msgs_msg_dds__Imu_>(participant, prefix + "/imu0/data_raw",
                                                     sensor_msgs_msg_dds__Imu__desc));
    topics.push_back(open<diagnostic_msgs_msg_dds__DiagnosticArray_>(
        participant, "/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc));
    const auto writers =
        dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
    pollfd input{0, POLLIN, 0};
    while (::poll(&input, 1, 2) == 0) {
        print_writers(writers);
        for (const Topic& topic : topics) take(topic);
    }
    dds_delete(participant);
    return 0;
}
