// `--poses`, `--publish` and `--mavlink`: each pose with its trust, and what happens to the camera, as lines of JSON to
// any number of readers, as messages of ROS 2 and for an autopilot.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "platform/cli/session.hpp"
#include "platform/mavlink/mavlink_output.hpp"
#include "platform/poses/line_outputs.hpp"
#include "platform/poses/pose_line.hpp"
#include "platform/report/run_record.hpp"
#include "platform/ros2/ros2_module.hpp"

namespace stillmesh {

class PoseOutputs {
public:
    // Sockets first: whether a port is free only opening it tells, and a start that is refused leaves files as they
    // were. False: `message`.
    [[nodiscard]] bool open(const std::vector<std::string>& destinations, const LineOutputOptions& options,
                            std::string& message) {
        for (const bool are_files : {false, true}) {
            for (const std::string& destination : destinations) {
                if (is_file_destination(destination) != are_files) continue;
                auto output = open_line_output(destination, options, message);
                if (output == nullptr) return false;
                outputs_.push_back(std::move(output));
            }
        }
        return true;
    }
    [[nodiscard]] bool publish(const RosOptions& ros, const MavlinkOptions& mavlink, std::string& message) {
        if (!mavlink_.open(mavlink, message)) return false;
        if (!ros.is_on) return true;
        const Ros2Module* const module = ros2_module(message);
        if (module == nullptr) {
            message = "--publish ros2 " + message;
            return false;
        }
        ros_ = module->publisher();
        wishes_ = module->wishes();
        return ros_->open(ros, message) && wishes_->open(ros.name_space, message);
    }
    // Where somebody wants the map's points; nullptr: nobody does.
    [[nodiscard]] MapPoints* points() { return ros_ != nullptr ? ros_->points() : nullptr; }
    // What ROS 2 wants of the run; nullptr: nobody asks there.
    [[nodiscard]] ViewCommands* wishes() { return wishes_ != nullptr ? &wishes_->commands() : nullptr; }
    // And a grid of it; likewise.
    [[nodiscard]] GridShelf* grid() { return ros_ != nullptr ? ros_->grid() : nullptr; }
    // Number `frame` of the run, in its `map`. Here as in event(): what to say when the first line was lost somewhere.
    [[nodiscard]] std::string pose(std::uint64_t frame, std::size_t map, const SessionFrame& out) {
        const bool is_camera_fault = out.state != out.estimate.state;  // the camera check does not trust it
        last_ = {frame,        out.state,      is_camera_fault ? "camera fault" : unsure_reason_name(out.unsure),
                 out.estimate, out.statistics, out.keyframe,
                 map};
        last_.estimate.time_ns = out.world_from_camera.time_ns;
        return write_pose();
    }
    // A frame that was not tracked.
    [[nodiscard]] std::string no_pose(std::uint64_t frame, std::int64_t time_ns, const char* reason) {
        last_.frame = frame;
        last_.state = PoseState::kNone;
        last_.reason = reason;
        last_.estimate.time_ns = time_ns;
        last_.statistics = {};
        return write_pose();
    }
    [[nodiscard]] std::string event(const std::string& sentence) {
        std::string said = ros_ != nullptr ? ros_->event(sentence) : std::string();
        if (outputs_.empty()) return said;
        lines_.event(last_.estimate.time_ns, sentence, line_);
        return write(std::move(said));
    }
    [[nodiscard]] bool reopen(std::string& message) {
        return std::all_of(outputs_.begin(), outputs_.end(), [&message](auto& o) { return o->reopen(message); });
    }
    // Ends what is sent by a thread of its own.
    void account(RunRecord& record) {
        if (std::string problem = ros_ != nullptr ? ros_->close() : std::string(); !problem.empty())
            record.problems.push_back(std::move(problem));
        if (std::string problem = mavlink_.problem(); !problem.empty()) record.problems.push_back(std::move(problem));
        for (const auto& output : outputs_) {
            if (std::string problem = output->problem(); !problem.empty())
                record.problems.push_back(std::move(problem));
        }
    }

private:
    [[nodiscard]] std::string write_pose() {
        std::string said = ros_ != nullptr ? ros_->frame(last_) : std::string();
        if (std::string sentence = mavlink_.frame(last_); !sentence.empty()) said = std::move(sentence);
        if (outputs_.empty()) return said;
        lines_.pose(last_, line_);
        return write(std::move(said));
    }
    [[nodiscard]] std::string write(std::string said) {
        for (const auto& output : outputs_) {
            if (std::string sentence = output->write(line_); !sentence.empty()) said = std::move(sentence);
        }
        return said;
    }

    std::vector<std::unique_ptr<LineOutput>> outputs_;
    std::unique_ptr<RosPublisher> ros_;  // this and the next: empty without --publish ros2
    std::unique_ptr<RosWishes> wishes_;
    MavlinkOutput mavlink_;
    PoseLines lines_;
    std::string line_;  // keeps its memory from frame to frame
    PoseReport last_;
};

}  // namespace stillmesh
