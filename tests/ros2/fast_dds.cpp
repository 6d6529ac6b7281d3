#include "tests/ros2/fast_dds.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

namespace stillmesh::test::fast {
namespace {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

constexpr std::uint32_t kBytesMax = 4 << 20;

struct Reading {
    Cdr& cdr;
    template <typename Value>
    void operator()(Value& value) {
        cdr >> value;
    }
    std::size_t count(std::size_t) {
        std::uint32_t n = 0;
        cdr >> n;
        return std::min<std::size_t>(n, kBytesMax);
    }
};
struct Writing {
    Cdr& cdr;
    template <typename Value>
    void operator()(const Value& value) {
        cdr << value;
    }
    std::size_t count(std::size_t n) {
        cdr << static_cast<std::uint32_t>(n);
        return n;
    }
};

struct Filling {
    std::uint32_t next = 0;
    template <typename Value>
    void operator()(Value& value) {
        value = static_cast<Value>(next++);
    }
    void operator()(bool& value) { value = next++ % 2 != 0; }
    void operator()(std::string& text) {
        text.resize(next++ % 6);
        for (char& letter : text) letter = static_cast<char>('a' + next++ % 26);
    }
    template <typename Item, std::size_t kCount>
    void operator()(std::array<Item, kCount>& items) {
        for (Item& item : items) (*this)(item);
    }
    template <typename Item>
    void operator()(std::vector<Item>& items) {
        items.resize(count(0));
        for (Item& item : items) (*this)(item);
    }
    std::size_t count(std::size_t) { return next++ % 4; }
};

// Defined before it is used: items may be any of those below.
template <typename Io, typename Item>
void fields(Io& io, std::vector<Item>& items);

template <typename Io>
void fields(Io& io, Header& m) {
    io(m.sec), io(m.nanosec), io(m.frame_id);
}
template <typename Io>
void fields(Io& io, Pose& m) {
    io(m.p), io(m.q);
}
template <typename Io>
void fields(Io& io, PoseStamped& m) {
    fields(io, m.header), fields(io, m.pose);
}
template <typename Io>
void fields(Io& io, PoseWithCovarianceStamped& m) {
    fields(io, m.header), fields(io, m.pose), io(m.covariance);
}
template <typename Io>
void fields(Io& io, Odometry& m) {
    fields(io, m.header), io(m.child_frame_id), fields(io, m.pose), io(m.pose_covariance);
    io(m.twist), io(m.twist_covariance);
}
template <typename Io>
void fields(Io& io, TransformStamped& m) {
    fields(io, m.header), io(m.child_frame_id), fields(io, m.transform);
}
template <typename Io>
void fields(Io& io, Tf& m) {
    fields(io, m.transforms);
}
template <typename Io>
void fields(Io& io, Path& m) {
    fields(io, m.header), fields(io, m.poses);
}
template <typename Io>
void fields(Io& io, OccupancyGrid& m) {
    fields(io, m.header), io(m.load_sec), io(m.load_nanosec), io(m.resolution), io(m.width), io(m.height);
    fields(io, m.origin), io(m.data);
}
template <typename Io>
void fields(Io& io, Empty& m) {
    io(m.nothing);
}
template <typename Io>
void fields(Io& io, Bool& m) {
    io(m.data);
}
template <typename Io>
void fields(Io& io, PointField& m) {
    io(m.name), io(m.offset), io(m.datatype), io(m.count);
}
template <typename Io>
void fields(Io& io, PointCloud& m) {
    fields(io, m.header), io(m.height), io(m.width), fields(io, m.fields), io(m.is_bigendian);
    io(m.point_step), io(m.row_step), io(m.data), io(m.is_dense);
}
template <typename Io>
void fields(Io& io, std::pair<std::string, std::string>& m) {
    io(m.first), io(m.second);
}
template <typename Io>
void fields(Io& io, DiagnosticStatus& m) {
    io(m.level), io(m.name), io(m.message), io(m.hardware_id), fields(io, m.values);
}
template <typename Io>
void fields(Io& io, DiagnosticArray& m) {
    fields(io, m.header), fields(io, m.status);
}
template <typename Io>
void fields(Io& io, Image& m) {
    fields(io, m.header), io(m.height), io(m.width), io(m.encoding), io(m.is_bigendian), io(m.step), io(m.data);
}
template <typename Io>
void fields(Io& io, CompressedImage& m) {
    fields(io, m.header), io(m.format), io(m.data);
}
template <typename Io>
void fields(Io& io, Imu& m) {
    fields(io, m.header), io(m.orientation), io(m.orientation_covariance);
    io(m.angular_velocity), io(m.angular_velocity_covariance);
    io(m.linear_acceleration), io(m.linear_acceleration_covariance);
}
template <typename Io>
void fields(Io& io, CameraInfo& m) {
    fields(io, m.header), io(m.height), io(m.width), io(m.distortion_model), io(m.d), io(m.k), io(m.r), io(m.p);
    io(m.binning_x), io(m.binning_y);
    io(m.x_offset), io(m.y_offset), io(m.roi_height), io(m.roi_width), io(m.do_rectify);
}
template <typename Io, typename Item>
void fields(Io& io, std::vector<Item>& items) {
    items.resize(io.count(items.size()));
    for (Item& item : items) fields(io, item);
}

template <typename Message>
class MessageType final : public dds::TopicDataType {
public:
    MessageType() {
        setName(Message::kType);
        m_typeSize = kBytesMax;
        m_isGetKeyDefined = false;
        auto_fill_type_object(false);
        auto_fill_type_information(false);
    }
    bool serialize(void* data, Payload* payload) override {
        FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        payload->encapsulation = cdr.endianness() == Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
        cdr.serialize_encapsulation();
        Writing io{cdr};
        fields(io, *static_cast<Message*>(data));
        payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
        return true;
    }
    bool deserialize(Payload* payload, void* data) override try {
        FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.read_encapsulation();
        Reading io{cdr};
        fields(io, *static_cast<Message*>(data));
        // All of it was read, but for what pads the end to four bytes.
        return payload->length - cdr.getSerializedDataLength() < 4;
    } catch (const eprosima::fastcdr::exception::Exception&) {
        return false;
    }
    std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return kBytesMax; };
    }
    void* createData() override { return new Message; }
    void deleteData(void* data) override { delete static_cast<Message*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

template <typename QosType>
void set(QosType& out, const Qos& qos) {
    out.reliability().kind = qos.is_reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
    out.durability().kind = qos.is_latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
    out.history().kind = qos.is_stuck ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
    out.history().depth = qos.is_stuck ? 1 : qos.depth;
    if (qos.is_stuck) {
        out.resource_limits().max_samples = 1;
        out.resource_limits().max_instances = 1;
        out.resource_limits().max_samples_per_instance = 1;
        out.resource_limits().allocated_samples = 1;
    }
    out.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
}

}  // namespace

struct Node::Inside {
    dds::DomainParticipant* participant = nullptr;
    dds::Subscriber* subscriber = nullptr;
    dds::Publisher* publisher = nullptr;

    template <typename Message>
    dds::Topic* topic(const std::string& name) {
        dds::TypeSupport type(new MessageType<Message>);
        type.register_type(participant);
        const std::string mangled = "rt" + name;
        if (auto* const known = static_cast<dds::Topic*>(participant->lookup_topicdescription(mangled))) return known;
        return participant->create_topic(mangled, Message::kType, dds::TOPIC_QOS_DEFAULT);
    }
};

Node::Node() : inside_(std::make_unique<Inside>()) {
    dds::DomainParticipantQos qos;
    qos.transport().use_builtin_transports = false;
    const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.emplace_back("127.0.0.1");
    qos.transport().user_transports.push_back(udp);
    const char* const domain = std::getenv("ROS_DOMAIN_ID");
    const auto id = static_cast<std::uint32_t>(std::strtoul(domain != nullptr ? domain : "0", nullptr, 10));
    inside_->participant = dds::DomainParticipantFactory::get_instance()->create_participant(id, qos);
    inside_->subscriber = inside_->participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
    inside_->publisher = inside_->participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
}

Node::~Node() {
    inside_->participant->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(inside_->participant);
}

template <typename Message>
struct Node::Reader<Message>::Listener final : dds::DataReaderListener {
    dds::Subscriber* subscriber = nullptr;
    dds::DataReader* reader = nullptr;
    bool is_stuck = false;
    std::atomic<int> matched = 0;
    std::mutex mutex;
    std::vector<Message> taken;

    void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override {
        matched = status.current_count;
    }
    void on_data_available(dds::DataReader* from) override {
        if (is_stuck) return;
        Message message;
        dds::SampleInfo info;
        while (from->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
            const std::lock_guard lock(mutex);
            if (info.valid_data) taken.push_back(message);
        }
    }
};

template <typename Message>
Node::Reader<Message>::Reader(Node& node, const std::string& topic, const Qos& qos)
    : listener_(std::make_unique<Listener>()) {
    dds::DataReaderQos reader_qos;
    set(reader_qos, qos);
    listener_->is_stuck = qos.is_stuck;
    listener_->subscriber = node.inside_->subscriber;
    listener_->reader =
        listener_->subscriber->create_datareader(node.inside_->topic<Message>(topic), reader_qos, listener_.get());
}
template <typename Message>
Node::Reader<Message>::~Reader() {
    listener_->reader->set_listener(nullptr);
    listener_->subscriber->delete_datareader(listener_->reader);
}
template <typename Message>
std::vector<Message> Node::Reader<Message>::take() {
    const std::lock_guard lock(listener_->mutex);
    return std::exchange(listener_->taken, {});
}
template <typename Message>
bool Node::Reader<Message>::is_matched() const {
    return listener_->matched > 0;
}

template <typename Message>
struct Node::Writer<Message>::Inside {
    dds::Publisher* publisher = nullptr;
    dds::DataWriter* writer = nullptr;
};

template <typename Message>
Node::Writer<Message>::Writer(Node& node, const std::string& topic, const Qos& qos)
    : inside_(std::make_unique<Inside>()) {
    dds::DataWriterQos writer_qos;
    set(writer_qos, qos);
    writer_qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
    inside_->publisher = node.inside_->publisher;
    inside_->writer = inside_->publisher->create_datawriter(node.inside_->topic<Message>(topic), writer_qos);
}
template <typename Message>
Node::Writer<Message>::~Writer() {
    inside_->publisher->delete_datawriter(inside_->writer);
}
template <typename Message>
bool Node::Writer<Message>::write(const Message& message) {
    Message copy = message;
    return inside_->writer->write(&copy);
}
template <typename Message>
bool Node::Writer<Message>::is_matched() const {
    dds::PublicationMatchedStatus status;
    inside_->writer->get_publication_matched_status(status);
    return status.current_count > 0;
}

template <typename Message>
Message filled(std::uint32_t number) {
    Message message;
    Filling io{number};
    fields(io, message);
    return message;
}

template <typename Message>
std::vector<std::uint8_t> bytes_of(const Message& message) {
    Message copy = message;
    std::vector<std::uint8_t> bytes(kBytesMax);  // 0 where nothing but padding lies
    FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    Writing io{cdr};
    fields(io, copy);
    bytes.resize(cdr.getSerializedDataLength());
    return bytes;
}

#define FOR_MESSAGE(Message)                         \
    template class Node::Reader<Message>;            \
    template class Node::Writer<Message>;            \
    template Message filled<Message>(std::uint32_t); \
    template std::vector<std::uint8_t> bytes_of<Message>(const Message&);
FOR_MESSAGE(Odometry)
FOR_MESSAGE(Tf)
FOR_MESSAGE(PoseWithCovarianceStamped)
FOR_MESSAGE(Path)
FOR_MESSAGE(PointCloud)
FOR_MESSAGE(OccupancyGrid)
FOR_MESSAGE(DiagnosticArray)
FOR_MESSAGE(Empty)
FOR_MESSAGE(Bool)
FOR_MESSAGE(Imu)
FOR_MESSAGE(Image)
FOR_MESSAGE(CompressedImage)
FOR_MESSAGE(CameraInfo)
#undef FOR_MESSAGE

}  // namespace stillmesh::test::fast
