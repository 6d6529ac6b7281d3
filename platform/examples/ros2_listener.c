/* Hears what `stillmesh run --publish ros2` says on /odom, until nothing has come for five seconds. On a robot that has
   ROS 2 a node of rclcpp or rclpy does this; here Cyclone DDS alone does. The messages: `idlc -t -x final
   hal/ros2/messages.idl`.
 */
#include <dds/dds.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "stillmesh_ros2_messages/messages.h"

static dds_entity_t reader_of(const char* topic_name, const dds_topic_descriptor_t* type) {
    const char* domain = getenv("ROS_DOMAIN_ID");
    const dds_entity_t participant =
        dds_create_participant(domain != NULL ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 100);
    const dds_entity_t topic = dds_create_topic(participant, type, topic_name, NULL, NULL);
    const dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
    dds_delete_qos(qos);
    return reader; /* below 0: why not */
}

int main(void) {
    const dds_entity_t reader = reader_of("rt/odom", &nav_msgs_msg_dds__Odometry__desc); /* ROS calls it /odom */
    if (reader < 0) {
        fprintf(stderr, "%s\n", dds_strretcode(reader));
        return 1;
    }
    int waited_ms = 0;
    for (int limit_ms = 60000; waited_ms < limit_ms;) {
        void* sample = NULL; /* borrowed until it is given back */
        dds_sample_info_t info;
        if (dds_take(reader, &sample, &info, 1, 1) <= 0) {
            dds_sleepfor(DDS_MSECS(10));
            waited_ms += 10;
            continue;
        }
        if (info.valid_data) {
            const nav_msgs_msg_dds__Odometry_* odometry = sample;
            const geometry_msgs_msg_dds__Point_* at = &odometry->pose.pose.position;
            printf("%d.%09u: %.2f m ahead, %.2f m to the left, +- %.3f m\n", odometry->header.stamp.sec,
                   odometry->header.stamp.nanosec, at->x, at->y, sqrt(odometry->pose.covariance[0]));
        }
        (void)dds_return_loan(reader, &sample, 1);
        waited_ms = 0;
        limit_ms = 5000;
    }
    dds_delete(DDS_CYCLONEDDS_HANDLE);
    return 0;
}
