// What a robot says of how its frames lie to each other: /tf_static, and those in the namespaces of a topic, since of
// several robots in one domain each has its own there (of /a/b/image those are /a and /a/b). Inner: sees Cyclone's
// headers. Of one thread at a time.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hal/calibration/frame_tree.hpp"
#include "hal/ros2/ros_readers.hpp"

namespace stillmesh {

class RosFrames {
public:
    // Who waits for `readers` hears of these, too. False: `message`.
    [[nodiscard]] bool listen(RosReaders& readers, const RosContext& context, std::string_view beside_topic,
                              std::string& message);
    // One message of each topic, into the tree. False: none was there.
    bool take();
    [[nodiscard]] const FrameTree& tree() const { return tree_; }
    // The topic of the last message.
    [[nodiscard]] const std::string& told_by() const { return told_by_; }

private:
    struct Topic {
        std::string name;
        dds_entity_t reader = 0;
    };

    std::vector<Topic> topics_;
    FrameTree tree_;
    std::string told_by_ = "/tf_static";
};

}  // namespace stillmesh
