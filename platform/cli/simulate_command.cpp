#include "platform/cli/simulate_command.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "hal/calibration/calibration.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/linux/process.hpp"
#include "platform/motion/simulated_accelerometer.hpp"
#include "platform/motion/simulated_motion.hpp"
#include "platform/motion/triple_lines.hpp"
#include "platform/record/png_file.hpp"

namespace stillmesh {
namespace {

struct FileCloser {
    void operator()(std::FILE* file) const { static_cast<void>(std::fclose(file)); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

int complain(int code, const std::string& sentence) {
    std::fprintf(stderr, "stillmesh: %s\n", sentence.c_str());
    return code;
}

// One of the text files, each line flushed as it is complete.
class List {
public:
    [[nodiscard]] bool open(const std::string& path, const std::string& head) {
        path_ = path;
        // "x": whoever comes second into the same folder fails here.
        file_.reset(std::fopen(path.c_str(), "wx"));
        return file_ != nullptr && add(head);
    }
    [[nodiscard]] bool add(const std::string& text) {
        return std::fwrite(text.data(), 1, text.size(), file_.get()) == text.size() && std::fflush(file_.get()) == 0;
    }
    [[nodiscard]] const std::string& path() const { return path_; }

private:
    std::string path_;
    File file_;
};

[[nodiscard]] std::string camera_yaml(const CameraInfo& info) {
    char text[512];
    std::snprintf(text, sizeof(text),
                  "Camera.fx: %.6f\nCamera.fy: %.6f\nCamera.cx: %.6f\nCamera.cy: %.6f\n"
                  "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.k3: 0.0\n"
                  "Camera.width: %u\nCamera.height: %u\nCamera.fps: %.1f\nDepthMapFactor: %.0f\n",
                  info.model.fx, info.model.fy, info.model.cx, info.model.cy, info.model.width, info.model.height,
                  info.frames_per_s, info.depth_units_per_m);
    return text;
}

// Beside the colour camera, as in a RealSense D435: 90 degrees wide, 15 mm to the right of it, and turned a little.
[[nodiscard]] SeparateDepth wide_depth_camera() {
    SeparateDepth out;
    out.model.width = 848;
    out.model.height = 480;
    out.model.fx = out.model.fy = 424;
    out.model.cx = 424.6;
    out.model.cy = 238.2;
    out.colour_from_depth = {{0.0022, -0.0031, 0.0017, 0.99999132}, {0.0149, 0.0003, 0.0002}};
    return out;
}

// What wheels, a gyroscope and an accelerometer would say of the frames.
class MotionLists {
public:
    explicit MotionLists(std::uint64_t seed) : motion_(seed), accelerometer_(seed) {}
    [[nodiscard]] bool open(const std::string& odometry, const std::string& gyroscope, const std::string& accelerometer,
                            const std::string& what) {
        is_open_ =
            odometry_.open(odometry, what + "# timestamp tx ty tz qx qy qz qw (camera in a frame that drifts)\n") &&
            gyroscope_.open(gyroscope, what + "# timestamp wx wy wz (rad/s in the camera's frame)\n") &&
            accelerations_.open(accelerometer, what + "# timestamp ax ay az (m/s^2 in the camera's axes)\n");
        return is_open_;
    }
    [[nodiscard]] bool add(const TrajectoryPose& truth) {
        if (!is_open_) return true;
        if (accelerometer_.step(truth) &&
            !accelerations_.add(triple_line(accelerometer_.reading().time_ns, accelerometer_.reading().m_s2))) {
            return false;
        }
        if (!motion_.step(truth)) {
            pose_.time_ns = truth.time_ns;
            return odometry_.add(pose_line(pose_));
        }
        // The rate holds for the whole step: a line at both of its ends.
        const std::int64_t begin_ns = pose_.time_ns + (is_first_step_ ? 0 : 1);
        is_first_step_ = false;
        pose_ = moved_by(pose_, motion_.wheels().last_from_camera, truth.time_ns);
        return odometry_.add(pose_line(pose_)) && gyroscope_.add(triple_line(begin_ns, motion_.gyroscope_rad_s())) &&
               gyroscope_.add(triple_line(truth.time_ns, motion_.gyroscope_rad_s()));
    }

private:
    SimulatedMotion motion_;
    SimulatedAccelerometer accelerometer_;
    List odometry_, gyroscope_, accelerations_;
    TrajectoryPose pose_;
    bool is_open_ = false;
    bool is_first_step_ = true;
};

}  // namespace

int simulate_command(const SimulateOptions& options) {
    SceneName scene = options.scene;
    std::string wrong;
    if (!parse_scene_name(options.scene.name, scene, wrong)) return complain(kExitUsage, wrong + ".");
    Dirt dirt;
    if (!parse_dirt(options.dirt, dirt, wrong)) return complain(kExitUsage, "--dirt: " + wrong + ".");
    SimulatedCamera camera(
        {.scene = scene.name,
         .seed = scene.seed,
         .day = scene.day,
         .frames = options.frames,
         .width = options.width,
         .height = options.height > 0 ? options.height : options.width * 3 / 4,
         .dirt = dirt,
         .separate_depth = options.is_depth_separate ? std::optional(wide_depth_camera()) : std::nullopt});
    if (camera.open() != Status::kOk) return complain(kExitUsage, camera.message() + ".");

    std::error_code error;
    const std::filesystem::path out(options.out);
    std::filesystem::create_directories(out, error);
    if (error) return complain(kExitUsage, options.out + ": cannot be made: " + error.message() + ".");
    const bool is_empty = std::filesystem::is_empty(out, error);
    if (error) return complain(kExitUsage, options.out + ": " + error.message() + ".");
    if (!is_empty) return complain(kExitUsage, options.out + ": is not empty; give a new folder, nothing was changed.");
    for (const char* name : {"rgb", "depth", "masks"}) {
        if (!std::filesystem::create_directory(out / name, error)) {
            return complain(kExitUsage, (out / name).string() + ": cannot be made, or somebody else is writing here.");
        }
    }
    const std::string what = "# simulated: " + scene.name + ", seed " + std::to_string(scene.seed) + "\n";
    List rgb_list;
    List depth_list;
    List mask_list;
    List truth_list;
    List calibration;
    const auto path_of = [&](const char* name) { return (out / name).string(); };
    if (!rgb_list.open(path_of("rgb.txt"), what + "# timestamp filename\n") ||
        !depth_list.open(path_of("depth.txt"), what + "# timestamp filename\n") ||
        !mask_list.open(path_of("masks.txt"), what + "# timestamp filename; 255: a moving body\n") ||
        !truth_list.open(path_of("groundtruth.txt"), what + "# timestamp tx ty tz qx qy qz qw (camera to world)\n") ||
        !calibration.open(path_of(options.is_depth_separate ? "camera.toml" : "camera.yaml"),
                          options.is_depth_separate ? calibration_toml(camera.info()) : camera_yaml(camera.info()))) {
        return complain(kExitUsage, options.out + ": cannot be written: " + std::strerror(errno) + ".");
    }
    MotionLists motion(scene.seed);
    if (options.has_motion &&
        !motion.open(path_of("odometry.txt"), path_of("gyro.txt"), path_of("accelerometer.txt"), what)) {
        return complain(kExitUsage, options.out + ": cannot be written: " + std::strerror(errno) + ".");
    }

    catch_stop_signals();
    const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
    const std::int64_t begin_ns = monotonic_ns();
    std::int64_t shown_ns = begin_ns;
    std::uint32_t count = 0;
    std::uint32_t above = 0;
    double share_sum = 0;
    std::string problem;
    Frame frame;
    const std::uint32_t every = std::max(options.every, 1U);
    const std::uint32_t frame_count = (camera.frame_count() + every - 1) / every;
    while (stop_signal() == 0 && count < frame_count) {
        camera.seek(count * every);
        if (camera.poll(frame) != Status::kOk) break;
        const std::string colour_time = time_text(frame.time_ns);
        const std::string depth_time = time_text(frame.depth_time_ns);
        const std::string rgb = "rgb/" + colour_time + ".png";
        const std::string depth = "depth/" + depth_time + ".png";
        const std::string mask = "masks/" + colour_time + ".png";
        const std::uint32_t width = frame.colour.width;
        const std::uint32_t height = frame.colour.height;
        problem = write_png_file(path_of(rgb.c_str()), frame.colour.data, width, height, PngPixels::kGrey8);
        if (problem.empty()) {
            problem = write_png_file(path_of(depth.c_str()), frame.depth.data, frame.depth.width, frame.depth.height,
                                     PngPixels::kGrey16);
        }
        if (problem.empty()) {
            problem =
                write_png_file(path_of(mask.c_str()), camera.dynamic_mask().data, width, height, PngPixels::kGrey8);
        }
        if (!problem.empty()) break;
        const SimulatedPose& pose = camera.true_pose();
        if (!truth_list.add(pose_line({pose.time_ns, pose.t, pose.q})) || !motion.add({pose.time_ns, pose.t, pose.q}) ||
            !mask_list.add(colour_time + " " + mask + "\n") || !depth_list.add(depth_time + " " + depth + "\n") ||
            !rgb_list.add(colour_time + " " + rgb + "\n")) {
            problem = options.out + ": " + std::strerror(errno) + ".";
            break;
        }
        ++count;
        share_sum += camera.dynamic_share();
        above += camera.dynamic_share() > 0.3;
        const std::int64_t now_ns = monotonic_ns();
        if (!options.is_json && now_ns - shown_ns > (is_terminal ? 200'000'000 : 10'000'000'000)) {
            const double left_s = static_cast<double>(now_ns - begin_ns) * 1e-9 / count * (frame_count - count);
            std::fprintf(stderr, "%s%s: frame %u of %u, %.0f s left%s", is_terminal ? "\r\033[K" : "",
                         scene.name.c_str(), count, frame_count, left_s, is_terminal ? "" : "\n");
            shown_ns = now_ns;
        }
    }
    if (is_terminal && shown_ns != begin_ns) std::fprintf(stderr, "\r\033[K");
    const double mean = count > 0 ? share_sum / count : 0.0;
    const double above_share = count > 0 ? static_cast<double>(above) / count : 0.0;
    if (options.is_json) {
        const nlohmann::ordered_json summary = {{"scene", scene.name},        {"seed", scene.seed},
                                                {"folder", options.out},      {"frames", count},
                                                {"dynamic_share_mean", mean}, {"frames_above_30_percent", above_share}};
        std::printf("%s\n", summary.dump(2).c_str());
    } else {
        std::printf(
            "%s, seed %llu: %u frames in %s; moving pixels %.1f %% in the mean, above 30 %% in %.0f %% of the frames\n",
            scene.name.c_str(), static_cast<unsigned long long>(scene.seed), count, options.out.c_str(), 100 * mean,
            100 * above_share);
    }
    if (!problem.empty()) {
        return complain(kExitFailed, problem + " The " + std::to_string(count) + " frames before are complete.");
    }
    if (stop_signal() != 0) {
        return complain(128 + stop_signal(), "stopped; the " + std::to_string(count) + " frames written are complete.");
    }
    return kExitDone;
}

}  // namespace stillmesh
