// Readers of Cyclone DDS that one thread waits for together. They end with this: that thread has to end before, and the
// context after. Inner: sees Cyclone's headers.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hal/ros2/ros_context.hpp"

namespace stillmesh {

class RosReaders {
public:
    RosReaders() = default;
    ~RosReaders() {
        for (const dds_entity_t reader : readers_) static_cast<void>(dds_delete(reader));
        if (waiting_ > 0) static_cast<void>(dds_delete(waiting_));
    }
    RosReaders(const RosReaders&) = delete;
    RosReaders& operator=(const RosReaders&) = delete;

    // As RosContext::reader.
    [[nodiscard]] dds_entity_t add(const RosContext& context, std::string_view topic,
                                   const dds_topic_descriptor_t& type, const RosQos& qos, std::string& message) {
        if (waiting_ == 0) waiting_ = dds_create_waitset(DDS_CYCLONEDDS_HANDLE);
        const dds_entity_t reader = context.reader(topic, type, qos, message);
        if (reader < 0) return reader;
        readers_.push_back(reader);
        static_cast<void>(dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS));
        static_cast<void>(dds_waitset_attach(waiting_, reader, 0));
        return reader;
    }
    // Until one of them has something, and no longer than somebody who wants the thread to end may wait.
    void wait() const {
        constexpr std::int64_t kLookAround_ns = 50'000'000;
        static_cast<void>(dds_waitset_wait(waiting_, nullptr, 0, kLookAround_ns));
    }

private:
    dds_entity_t waiting_ = 0;
    std::vector<dds_entity_t> readers_;
};

}  // namespace stillmesh
