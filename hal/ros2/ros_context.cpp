#include "hal/ros2/ros_context.hpp"

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <mutex>

namespace stillmesh {
namespace {

constexpr std::uint32_t kDomainMax = 232;  // beyond, a port's number would not fit
// A writer never waits longer for a reader that does not take what it was promised.
constexpr dds_duration_t kBlockedMax_ns = 10'000'000;

// Nobody beyond this machine. Others are found by multicast on the loopback, at once, and where it has none at the
// first 33 ports that participants have, within some 8 s.
constexpr const char* kLocalhost =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\" multicast=\"true\"/></Interfaces>"
    "<AllowMulticast>spdp</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>"
    "</Domain></CycloneDDS>";

// A writer that is deleted waits for nobody: whoever deletes it has waited as long as he likes.
constexpr const char* kNoLinger =
    "<CycloneDDS><Domain><Internal><WriterLingerDuration>0ms</WriterLingerDuration></Internal></Domain></CycloneDDS>";

[[nodiscard]] bool read_domain(std::uint32_t& domain, std::string& message) {
    const char* const text = std::getenv("ROS_DOMAIN_ID");
    if (text == nullptr || *text == '\0') return true;
    const char* const end = text + std::strlen(text);
    const auto [stop, error] = std::from_chars(text, end, domain);
    if (error == std::errc() && stop == end && domain <= kDomainMax) return true;
    message = std::string("ROS_DOMAIN_ID=") + text + ": is no whole number from 0 to 232; unset it or give one.";
    return false;
}

[[nodiscard]] std::string sentence(const char* what, dds_return_t code) {
    return std::string(what) + ": Cyclone DDS says: " + dds_strretcode(code) +
           "; is CYCLONEDDS_URI right, and is there a network?";
}

struct QosOwner {
    dds_qos_t* qos = dds_create_qos();
    QosOwner() = default;
    QosOwner(const QosOwner&) = delete;
    QosOwner& operator=(const QosOwner&) = delete;
    ~QosOwner() { dds_delete_qos(qos); }
};

void set(dds_qos_t* qos, const RosQos& wanted) {
    dds_qset_reliability(qos, wanted.is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                         kBlockedMax_ns);
    const bool is_latched = wanted.history == RosHistory::kLatched;
    dds_qset_durability(qos, is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, wanted.depth);
    if (is_latched) {
        dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, wanted.depth, DDS_LENGTH_UNLIMITED,
                                    DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
    }
    constexpr dds_data_representation_id_t kPlainCdr[] = {DDS_DATA_REPRESENTATION_XCDR1};
    dds_qset_data_representation(qos, 1, kPlainCdr);
    dds_qset_ignorelocal(qos, DDS_IGNORELOCAL_PARTICIPANT);  // what we publish is not for ourselves
}

using MakeEntity = dds_entity_t (*)(dds_entity_t, dds_entity_t, const dds_qos_t*, const dds_listener_t*);

[[nodiscard]] dds_entity_t make(MakeEntity make_entity, dds_entity_t participant, std::string_view name,
                                const dds_topic_descriptor_t& type, const RosQos& wanted, std::string& message) {
    const std::string mangled = "rt" + std::string(name);
    const QosOwner owner;
    set(owner.qos, wanted);
    const dds_entity_t topic = dds_create_topic(participant, &type, mangled.c_str(), nullptr, nullptr);
    const dds_entity_t entity = topic < 0 ? topic : make_entity(participant, topic, owner.qos, nullptr);
    if (topic > 0) static_cast<void>(dds_delete(topic));  // lives on while somebody uses it
    if (entity < 0) message = sentence(("topic " + std::string(name)).c_str(), entity);
    return entity;
}

}  // namespace

std::shared_ptr<RosContext> RosContext::get(std::string& message) {
    static std::mutex mutex;
    static std::weak_ptr<RosContext> shared;
    const std::lock_guard lock(mutex);
    std::shared_ptr<RosContext> context = shared.lock();
    if (context != nullptr) return context;
    context.reset(new RosContext);
    if (!context->open(message)) return nullptr;
    shared = context;
    return context;
}

bool RosContext::open(std::string& message) {
    std::uint32_t domain = 0;
    if (!read_domain(domain, message)) return false;
    const char* const localhost = std::getenv("ROS_LOCALHOST_ONLY");
    const char* const user = std::getenv("CYCLONEDDS_URI");
    std::string configuration = kNoLinger;
    if (localhost != nullptr && std::strcmp(localhost, "1") == 0) configuration += std::string(",") + kLocalhost;
    if (user != nullptr && *user != '\0') configuration += std::string(",") + user;
    domain_ = dds_create_domain(domain, configuration.c_str());
    if (domain_ < 0) {
        message = sentence("ROS 2's domain cannot be entered", domain_);
        return false;
    }
    // What ROS's middleware looks at in a participant.
    constexpr std::string_view kEnclave = "enclave=/;";
    const QosOwner owner;
    dds_qset_userdata(owner.qos, kEnclave.data(), kEnclave.size());
    participant_ = dds_create_participant(domain, owner.qos, nullptr);
    if (participant_ < 0) message = sentence("ROS 2's domain cannot be entered", participant_);
    return participant_ >= 0;
}

RosContext::~RosContext() {
    if (domain_ > 0) static_cast<void>(dds_delete(domain_));
}

dds_entity_t RosContext::writer(std::string_view topic, const dds_topic_descriptor_t& type, const RosQos& qos,
                                std::string& message) const {
    return make(dds_create_writer, participant_, topic, type, qos, message);
}

dds_entity_t RosContext::reader(std::string_view topic, const dds_topic_descriptor_t& type, const RosQos& qos,
                                std::string& message) const {
    return make(dds_create_reader, participant_, topic, type, qos, message);
}

}  // namespace stillmesh
