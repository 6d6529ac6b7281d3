// Hears what `stillmesh run --publish ros2` says on /odom, until nothing has come for five seconds. Debian has Cyclone
// DDS for C: here C++ gives back what it lends. How the messages are made of hal/ros2/messages.idl: docs/guide.md.
#include <dds/dds.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "stillmesh_ros2_messages/messages.h"

using Odometry = nav_msgs_msg_dds__Odometry_;

class Listener {
public:
    explicit Listener(const char* topic_name) {
        const std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> qos{dds_create_qos(), dds_delete_qos};
        dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
        dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 100);
        const auto topic =
            dds_create_topic(participant_, &nav_msgs_msg_dds__Odometry__desc, topic_name, nullptr, nullptr);
        reader_ = dds_create_reader(participant_, topic, qos.get(), nullptr);  // below 0: why not
        dds_set_status_mask(reader_, DDS_DATA_AVAILABLE_STATUS);
        dds_waitset_attach(waitset_, reader_, 0);
    }
    ~Listener() { dds_delete(participant_); }  // and all that was made of it
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    dds_return_t status() const { return reader_ < 0 ? reader_ : 0; }
    bool wait(int seconds) const { return dds_waitset_wait(waitset_, nullptr, 0, DDS_SECS(seconds)) > 0; }
    template <typename Use>
    void take(Use use) const {
        void* sample = nullptr;  // borrowed until it is given back
        for (dds_sample_info_t info; dds_take(reader_, &sample, &info, 1, 1) > 0; dds_return_loan(reader_, &sample, 1))
            if (info.valid_data) use(*static_cast<const Odometry*>(sample));
    }

private:
    const char* domain_ = std::getenv("ROS_DOMAIN_ID");
    dds_entity_t participant_ = dds_create_participant(
        domain_ != nullptr ? static_cast<dds_domainid_t>(std::atoi(domain_)) : 0, nullptr, nullptr);
    dds_entity_t waitset_ = dds_create_waitset(participant_), reader_ = 0;
};

int main() {
    const Listener listener("rt/odom");  // ROS calls it /odom
    if (listener.status() != 0) {
        std::fprintf(stderr, "%s\n", dds_strretcode(listener.status()));
        return 1;
    }
    for (int limit_s = 60; listener.wait(limit_s); limit_s = 5)
        listener.take([](const Odometry& odometry) {
            const auto& at = odometry.pose.pose.position;
            std::printf("%d.%09u: %.2f m ahead, %.2f m to the left, +- %.3f m\n", odometry.header.stamp.sec,
                        odometry.header.stamp.nanosec, at.x, at.y, std::sqrt(odometry.pose.covariance[0]));
        });
}
