#include "platform/ros2/ros_wishes.hpp"

#include <array>
#include <system_error>
#include <thread>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_context.hpp"
#include "hal/ros2/ros_loan.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kLookAround_ns = 50'000'000;  // between two looks whether to end

}  // namespace

class RosWishes::Listener {
public:
    explicit Listener(ViewCommands& commands) : commands_(commands) {}
    ~Listener() {
        if (thread_.joinable()) {
            thread_.request_stop();
            thread_.join();
        }
        for (const dds_entity_t entity : {waiting_, save_, reset_, localise_}) {
            if (entity > 0) static_cast<void>(dds_delete(entity));
        }
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    [[nodiscard]] bool open(const std::string& own, std::string& message) {
        context_ = RosContext::get(message);
        if (context_ == nullptr) return false;
        waiting_ = dds_create_waitset(DDS_CYCLONEDDS_HANDLE);
        if (!subscribe(own + "/stillmesh/save_map", ros::kEmpty, save_, message) ||
            !subscribe(own + "/stillmesh/reset", ros::kEmpty, reset_, message) ||
            !subscribe(own + "/stillmesh/localize_only", ros::kBool, localise_, message)) {
            message = "--publish ros2: " + message;
            return false;
        }
        try {
            thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
        } catch (const std::system_error& failure) {
            message = std::string("--publish ros2: there is no thread to listen from: ") + failure.what() + ".";
            return false;
        }
        return true;
    }

private:
    [[nodiscard]] bool subscribe(const std::string& topic, const dds_topic_descriptor_t& type, dds_entity_t& reader,
                                 std::string& message) const {
        reader = context_->reader(topic, type, {}, message);
        if (reader < 0) return false;
        static_cast<void>(dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS));
        static_cast<void>(dds_waitset_attach(waiting_, reader, 0));
        return true;
    }
    void serve(const std::stop_token& stop) {
        while (!stop.stop_requested()) {
            static_cast<void>(dds_waitset_wait(waiting_, nullptr, 0, kLookAround_ns));
            while (take<ros::Empty>(save_, [](const ros::Empty&) { return ViewCommand{ViewVerb::kSaveMap}; })) {
            }
            while (take<ros::Empty>(reset_, [](const ros::Empty&) { return ViewCommand{ViewVerb::kReset}; })) {
            }
            while (take<ros::Bool>(localise_, [](const ros::Bool& wish) {
                return ViewCommand{ViewVerb::kLocaliseOnly, wish.data ? 1.0 : 0.0};
            })) {
            }
        }
    }
    // True: there may be more.
    template <typename Message, typename ToCommand>
    bool take(dds_entity_t reader, ToCommand&& to_command) {
        const RosLoan<Message> loan(reader);
        if (loan.message() == nullptr) return loan.is_any();
        static_cast<void>(commands_.put(to_command(*loan.message())));
        return true;
    }

    ViewCommands& commands_;
    std::shared_ptr<RosContext> context_;
    dds_entity_t waiting_ = 0, save_ = 0, reset_ = 0, localise_ = 0;
    std::jthread thread_;
};

RosWishes::RosWishes() = default;
RosWishes::~RosWishes() = default;

bool RosWishes::open(const std::string& name_space, std::string& message) {
    listener_ = std::make_unique<Listener>(commands_);
    return listener_->open(name_space.empty() ? "" : "/" + name_space, message);
}

}  // namespace stillmesh
