// bench_projector [SCENE [SEED [FRAMES]]]: which way to run a RealSense, on rendered data and through the whole camera
// layer: the emulated D435 streams a simulated room, V4l2Camera opens it, the engine tracks what comes. Colour with
// depth of a camera of its own, registered here (a rolling shutter, and without); infrared with a projector that takes
// turns; and infrared with the dots of a projector that is on all the time, which nobody should track. Depth is
// as good everywhere, with noise of a Kinect; without the projector there is none at all. By turns depth is older than
// its picture: as it comes, moved to the picture by the motion that the engine's last two poses predict (as the program
// does it), turned by the true rotation (a perfect gyroscope), and moved by the true motion.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "hal/live/depth_registration.hpp"
#include "hal/live/moved_depth_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/v4l2/emulated_device.hpp"

namespace stillmesh {
namespace {

enum class Way { kColour, kColourRolling, kAlternate, kPredicted, kTurned, kMoved, kDots };

[[nodiscard]] constexpr bool has_turns(Way way) {
    return way >= Way::kAlternate && way <= Way::kMoved;
}

struct Shown {
    std::vector<std::uint8_t> grey, dotted;
    std::vector<std::uint8_t> depth;  // as it is transferred
    SimulatedPose pose;
};

constexpr std::uint32_t kWidth = 640, kHeight = 480;

// The projector stands 29 mm beside the left camera: where a dot is seen depends a little on how far it falls.
void draw_dots(const Frame& frame, const CameraModel& model, std::vector<std::uint8_t>& grey) {
    std::mt19937 random(1);
    const auto add = [&grey](int x, int y, int light) {
        if (x < 0 || y < 0 || x >= int{kWidth} || y >= int{kHeight}) return;
        std::uint8_t& pixel = grey[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)];
        pixel = static_cast<std::uint8_t>(std::min(255, pixel + light));
    };
    for (int i = 0; i < 5000; ++i) {
        const auto u = static_cast<std::uint32_t>(random() % kWidth),
                   v = static_cast<std::uint32_t>(random() % kHeight);
        const double z_m = frame.depth.at(u, v) / 5000.0;
        if (z_m <= 0) continue;
        const int x = static_cast<int>(std::lround(u + model.fx * 0.029 * (1 / z_m - 0.5))), y = static_cast<int>(v);
        add(x, y, 100);
        for (const int d : {-1, 1}) add(x + d, y, 50), add(x, y + d, 50);
    }
}

// Frames of the simulation by their number, as the device asks for them.
class Room {
public:
    Room(const std::string& scene, std::uint64_t seed, std::uint32_t frames, Way way) : way_(way) {
        SimulationOptions options;
        options.scene = scene;
        options.seed = seed;
        options.frames = frames;
        options.dirt.rolling = way == Way::kColourRolling ? 1 : 0;
        if (has_turns(way)) options.depth_lag_ns = -16'666'667;
        if (is_colour()) {
            SeparateDepth depth;
            depth.model.width = 848, depth.model.height = 480;
            depth.model.fx = depth.model.fy = 424, depth.model.cx = 424.6, depth.model.cy = 238.2;
            depth.colour_from_depth.translation_m[0] = 0.015;
            options.separate_depth = depth;
        }
        camera_ = std::make_unique<SimulatedCamera>(options);
    }
    [[nodiscard]] bool open() { return camera_->open() == Status::kOk; }
    [[nodiscard]] bool is_colour() const { return way_ == Way::kColour || way_ == Way::kColourRolling; }
    [[nodiscard]] const CameraInfo& info() const { return camera_->info(); }
    [[nodiscard]] std::uint32_t count() const { return camera_->frame_count(); }

    // nullptr: there is none.
    [[nodiscard]] const Shown* at(std::uint32_t number) {
        while (next_ <= number) {
            Frame frame;
            if (camera_->poll(frame) != Status::kOk) break;
            Shown shown;
            shown.grey.assign(frame.colour.data, frame.colour.data + kWidth * kHeight);
            if (!is_colour()) {
                shown.dotted = shown.grey;
                draw_dots(frame, info().model, shown.dotted);
            }
            for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
                for (std::uint32_t x = 0; x < frame.depth.width; ++x) {
                    const std::uint16_t z = frame.depth.at(x, y);
                    shown.depth.push_back(static_cast<std::uint8_t>(z));
                    shown.depth.push_back(static_cast<std::uint8_t>(z >> 8U));
                }
            }
            shown.pose = camera_->true_pose();
            shown_[next_++] = std::move(shown);
            if (next_ > 30) shown_.erase(next_ - 30);
        }
        const auto found = shown_.find(number);
        return found == shown_.end() ? nullptr : &found->second;
    }

    // What the device shows. Images with odd numbers have the projector's light where it takes turns; the simulation's
    // depth is taken half a frame before its picture then.
    void paint(std::size_t node, std::uint32_t number, bool is_lit, test::Bytes& bytes) {
        if (first_ == 0) first_ = number + number % 2;
        if (number < first_) return;
        const Shown* const shown = at(has_turns(way_) ? (number - first_ + 1) / 2 : number - first_);
        std::fill(bytes.begin(), bytes.end(), std::uint8_t{0});
        if (shown == nullptr) return;
        const bool has_light = way_ == Way::kDots || is_lit;
        if (node == 0 && has_light) std::copy(shown->depth.begin(), shown->depth.end(), bytes.begin());
        const bool is_dotted = node == 2 && has_light;
        const auto& picture = is_dotted ? shown->dotted : shown->grey;
        if (node != 0) std::copy(picture.begin(), picture.end(), bytes.begin());
    }
    [[nodiscard]] std::uint32_t first() const { return first_; }

private:
    Way way_;
    std::unique_ptr<SimulatedCamera> camera_;
    std::uint32_t next_ = 0, first_ = 0;
    std::map<std::uint32_t, Shown> shown_;
};

// Depth as it would be seen where and when its picture was taken, by one who knows the truth.
class DepthTurn {
public:
    explicit DepthTurn(const CameraInfo& info)
        : model_(info.model), units_per_m_(info.depth_units_per_m), depth_(kWidth * kHeight) {}

    // `motion` takes points of the camera when depth was taken into the camera when the picture was.
    void apply(const RigidTransform& motion, Frame& frame) {
        DepthRegistration(model_, model_, motion, units_per_m_).reproject(frame.depth, depth_.data());
        frame.depth = {depth_.data(), kWidth, kHeight, kWidth};
    }
    // Half of the motion since the picture before, in which depth was taken.
    [[nodiscard]] RigidTransform true_motion(const Shown& shown, bool with_translation) {
        const RigidTransform now{{shown.pose.q[0], shown.pose.q[1], shown.pose.q[2], shown.pose.q[3]},
                                 {shown.pose.t[0], shown.pose.t[1], shown.pose.t[2]}};
        RigidTransform half;
        if (has_true_) {
            const RigidTransform step = compose(inverse_of(now), true_);
            const double sign = step.rotation_xyzw[3] < 0 ? -1 : 1;
            double rest = 1;
            for (std::size_t i = 0; i < 3; ++i) {
                half.rotation_xyzw[i] = 0.5 * sign * step.rotation_xyzw[i];
                rest -= half.rotation_xyzw[i] * half.rotation_xyzw[i];
                half.translation_m[i] = with_translation ? 0.5 * step.translation_m[i] : 0;
            }
            half.rotation_xyzw[3] = std::sqrt(rest);
        }
        true_ = now;
        has_true_ = true;
        return half;
    }

private:
    CameraModel model_;
    double units_per_m_;
    std::vector<std::uint16_t> depth_;
    RigidTransform true_;
    bool has_true_ = false;
};

void write_calibration(const std::string& file, const CameraInfo& info) {
    std::ofstream out(file);
    const auto lens = [&out](const CameraModel& m) {
        out << "width = " << m.width << "\nheight = " << m.height << "\nfx = " << m.fx << "\nfy = " << m.fy
            << "\ncx = " << m.cx << "\ncy = " << m.cy << "\n";
    };
    out.precision(12);
    out << std::showpoint;
    lens(info.model);
    if (!info.separate_depth) return;
    const RigidTransform& pose = info.separate_depth->colour_from_depth;
    out << "[depth]\n";
    lens(info.separate_depth->model);
    out << "tx = " << pose.translation_m[0] << "\nty = " << pose.translation_m[1] << "\ntz = " << pose.translation_m[2]
        << "\nqx = 0.0\nqy = 0.0\nqz = 0.0\nqw = 1.0\n";
}

void offer(test::EmulatedDevice& device, Way way) {
    const std::uint32_t rate = has_turns(way) ? 60 : 30;
    device.answers[9 * 256 + 0x2c] = test::answer(0x2c, test::depth_unit(200));
    const bool is_colour = way == Way::kColour || way == Way::kColourRolling;
    device.depth().modes = {{v4l2::kZ16, is_colour ? 848U : kWidth, kHeight, {rate}}};
    const std::vector<test::EmulatedMode> grey = {{v4l2::kGrey, kWidth, kHeight, {rate}}};
    device.infrared().modes = is_colour ? std::vector<test::EmulatedMode>() : grey;
    device.colour().modes = is_colour ? grey : std::vector<test::EmulatedMode>{{v4l2::kYuyv, kWidth, kHeight, {30}}};
}

[[nodiscard]] bool track(const std::string& scene, std::uint64_t seed, std::uint32_t frames, Way way) {
    constexpr const char* kNames[] = {"colour + depth registered, global shutter",
                                      "colour + depth registered, rolling",
                                      "infrared + depth by turns",
                                      "the same, depth moved as predicted",
                                      "the same, depth turned by the truth",
                                      "the same, depth moved by the truth",
                                      "infrared with dots"};
    Room room(scene, seed, frames, way);
    if (!room.open()) return false;
    const test::TemporaryFolder scratch;
    write_calibration(scratch.path("camera.toml"), room.info());
    auto device = std::make_shared<test::EmulatedDevice>();
    offer(*device, way);
    device->paint = [&room](std::size_t node, std::uint32_t number, bool is_lit, test::Bytes& bytes) {
        room.paint(node, number, is_lit, bytes);
    };
    V4l2Options options;
    options.has_thread = false;
    options.calibration = scratch.path("camera.toml");
    if (!room.is_colour()) options.device = has_turns(way) ? "alternate" : "ir";
    V4l2Camera camera(options, device);
    if (camera.open() != Status::kOk) {
        std::fprintf(stderr, "%s\n", camera.message().c_str());
        return false;
    }
    test::EngineRig engine(Limits{}, camera.info().model);
    if (engine.status() != Status::kOk) return false;
    Trajectory truth, estimate;
    std::uint64_t tracked = 0, all = 0;
    double lag_ms = 0;
    DepthTurn turn(camera.info());
    MovedDepthCamera moved(camera);
    DepthCamera& served = way == Way::kPredicted ? static_cast<DepthCamera&>(moved) : camera;
    const std::int64_t period_ns = has_turns(way) ? 16'666'666 : 33'333'333;
    const std::int64_t begin_ns = device->now_ns();
    std::int64_t first_ns = 0;
    while (all + 3 < room.count() && device->now_ns() - begin_ns < std::int64_t{room.count()} * 40'000'000) {
        Frame frame;
        static_cast<void>(camera.wait(20));
        if (served.poll(frame) != Status::kOk) continue;
        if (first_ns == 0) first_ns = frame.time_ns - (device->now_ns() / period_ns) * period_ns;
        const auto number = static_cast<std::uint32_t>((frame.time_ns - first_ns + period_ns / 2) / period_ns);
        if (number < room.first()) continue;
        const Shown* const shown = room.at((number - room.first()) / (has_turns(way) ? 2 : 1));
        if (shown == nullptr) continue;
        if (way == Way::kTurned || way == Way::kMoved) turn.apply(turn.true_motion(*shown, way == Way::kMoved), frame);
        ++all;
        lag_ms += static_cast<double>(frame.depth_time_ns - frame.time_ns) * 1e-6;
        if (engine->submit(frame) != Status::kOk) continue;
        const PoseEstimate& pose = engine->pose();
        const bool is_measured = pose.state >= PoseState::kUnsure;
        moved.learn(frame.time_ns, is_measured ? std::optional(pose.odom_from_camera) : std::nullopt);
        tracked += pose.state == PoseState::kTracked;
        TrajectoryPose one;
        one.time_ns = frame.time_ns;
        std::copy_n(shown->pose.t.begin(), 3, one.t.begin());
        std::copy_n(shown->pose.q.begin(), 4, one.q.begin());
        truth.push_back(one);
        std::copy_n(pose.odom_from_camera.translation_m, 3, one.t.begin());
        std::copy_n(pose.odom_from_camera.rotation_xyzw, 4, one.q.begin());
        estimate.push_back(one);
        static_cast<void>(engine->step(20'000));
    }
    const auto result = evaluate(truth, estimate);
    std::printf("%-12s %llu  %-44s ATE %.4f m, RPE %.4f m %.3f degrees; %llu frames, %llu tracked, depth %+.1f ms\n",
                scene.c_str(), static_cast<unsigned long long>(seed), kNames[static_cast<int>(way)],
                result ? result->ate_rmse_m : -1.0, result ? result->rpe_translation_rmse_m : -1.0,
                result ? result->rpe_rotation_rmse_deg : -1.0, static_cast<unsigned long long>(all),
                static_cast<unsigned long long>(tracked),
                lag_ms / static_cast<double>(std::max<std::uint64_t>(all, 1)));
    static_cast<void>(std::fflush(stdout));
    return result.has_value();
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    using stillmesh::Way;
    const std::string scene = argc > 1 ? argv[1] : "walking_xyz";
    const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
    const auto frames = static_cast<std::uint32_t>(argc > 3 ? std::atoi(argv[3]) : 0);
    for (const Way way :
         {Way::kColour, Way::kColourRolling, Way::kAlternate, Way::kPredicted, Way::kTurned, Way::kMoved, Way::kDots}) {
        if (!stillmesh::track(scene, seed, frames, way)) return 1;
    }
    return 0;
}
