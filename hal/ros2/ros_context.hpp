// This process among the processes of a ROS 2 system, without ROS: a participant of Cyclone DDS in the domain that
// ROS_DOMAIN_ID names (0), on this machine alone with ROS_LOCALHOST_ONLY=1, and beyond that as CYCLONEDDS_URI says.
// There is one in a process, shared by whoever publishes and whoever subscribes, and gone with the last of them.
// Topics get the names that ROS 2's middleware gives them: rt/NAME. Memory and threads: Cyclone's own (some 8 threads).
// Limits: domains 0 to 232. Errors: a sentence, with what to do.
#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace stillmesh {

enum class RosHistory : std::uint8_t {
    kVolatile,  // whoever comes later sees what is sent from then on
    kLatched,   // and what was sent last
};

struct RosQos {
    bool is_reliable = true;
    RosHistory history = RosHistory::kVolatile;
    std::int32_t depth = 10;
};

class RosContext {
public:
    // That of this process. nullptr: `message` says why.
    [[nodiscard]] static std::shared_ptr<RosContext> get(std::string& message);
    ~RosContext();
    RosContext(const RosContext&) = delete;
    RosContext& operator=(const RosContext&) = delete;

    // Of a topic with ROS's name, as /odom. Below 0: `message` says why. They end with their context, or by dds_delete.
    [[nodiscard]] dds_entity_t writer(std::string_view topic, const dds_topic_descriptor_t& type, const RosQos& qos,
                                      std::string& message) const;
    [[nodiscard]] dds_entity_t reader(std::string_view topic, const dds_topic_descriptor_t& type, const RosQos& qos,
                                      std::string& message) const;

private:
    RosContext() = default;
    [[nodiscard]] bool open(std::string& message);

    dds_entity_t domain_ = 0;
    dds_entity_t participant_ = 0;
};

}  // namespace stillmesh
