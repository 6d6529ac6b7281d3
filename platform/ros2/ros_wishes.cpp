#include "platform/ros2/ros_wishes.hpp"

#include <array>
#include <system_error>
#include <thread>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "hal/ros2/ros_readers.hpp"

namespace stillmesh {
class RosWishes::Listener {
public:
    explicit Listener(ViewCommands& commands) : commands_(commands) {}
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    [[nodiscard]] bool open(const std::string& own, std::string& message) {
        context_ = RosContext::get(message);
        if (context_ == nullptr) return false;
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
                                 std::string& message) {
        reader = readers_.add(*context_, topic, type, {}, message);
        return reader >= 0;
    }
    void serve(const std::stop_token& stop) {
        while (!stop.stop_requested()) {
            readers_.wait();
            bool is_any = true;
            while (is_any && !stop.stop_requested()) {
                is_any = take<ros::Empty>(save_, [](const ros::Empty&) { return ViewCommand{ViewVerb::kSaveMap}; });
                is_any |= take<ros::Empty>(reset_, [](const ros::Empty&) { return ViewCommand{ViewVerb::kReset}; });
                is_any |= take<ros::Bool>(localise_, [](const ros::Bool& wish) {
                    return ViewCommand{ViewVerb::kLocaliseOnly, wish.data ? 1.0 : 0.0};
                });
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
    RosReaders readers_;
    dds_entity_t save_ = 0, reset_ = 0, localise_ = 0;
    std::jthread thread_;  // ends before what it reads
};

RosWishes::RosWishes() = default;
RosWishes::~RosWishes() = default;

bool RosWishes::open(const std::string& name_space, std::string& message) {
    listener_ = std::make_unique<Listener>(commands_);
    return listener_->open(name_space.empty() ? "" : "/" + name_space, message);
}

}  // namespace stillmesh
