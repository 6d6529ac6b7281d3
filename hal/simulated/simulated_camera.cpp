#include "hal/simulated/simulated_camera.hpp"

#include <cmath>

#include "engine/base/numbers.hpp"
#include "hal/simulated/depth_sensor.hpp"
#include "hal/simulated/hand.hpp"
#include "hal/simulated/renderer.hpp"
#include "hal/simulated/row_renderer.hpp"
#include "hal/simulated/world.hpp"

namespace stillmesh {
namespace {

using namespace simulated;

constexpr std::int64_t kFirstFrameNs = 1'000'000'000;
constexpr double kFramesPerSecond = 30.0;
constexpr std::uint32_t kExposures = 4;  // pictures per frame
// Where in a pixel each picture looks: a turned 2 x 2 grid. Together with the time, each quarter of the exposure once.
constexpr double kOffsetX[kExposures] = {-0.125, 0.375, -0.375, 0.125};
constexpr double kOffsetY[kExposures] = {-0.375, -0.125, 0.125, 0.375};
constexpr double kInstant[kExposures] = {-0.375, 0.125, 0.375, -0.125};  // of the exposure
// Four samples a pixel allow a somewhat finer mip level than one would.
constexpr float kLevelOffset[kExposures] = {0.0F, 0.125F, 0.25F, 0.375F};
// First row to last, of a Kinect: its colour was measured at 26 (Ringaby and Forssen 2011) to 30 ms.
constexpr double kColourReadoutS = 0.028, kDepthReadoutS = 0.017;

[[nodiscard]] std::array<double, 4> quaternion(const Mat3& m) noexcept {
    // The largest of the four first: no division by next to nothing.
    const double trace = m.a.x + m.b.y + m.c.z;
    double x = 0;
    double y = 0;
    double z = 0;
    double w = 0;
    if (trace > 0) {
        w = 1 + trace;
        x = m.b.z - m.c.y;
        y = m.c.x - m.a.z;
        z = m.a.y - m.b.x;
    } else if (m.a.x > m.b.y && m.a.x > m.c.z) {
        x = 1 + m.a.x - m.b.y - m.c.z;
        y = m.a.y + m.b.x;
        z = m.c.x + m.a.z;
        w = m.b.z - m.c.y;
    } else if (m.b.y > m.c.z) {
        x = m.a.y + m.b.x;
        y = 1 - m.a.x + m.b.y - m.c.z;
        z = m.b.z + m.c.y;
        w = m.c.x - m.a.z;
    } else {
        x = m.c.x + m.a.z;
        y = m.b.z + m.c.y;
        z = 1 - m.a.x - m.b.y + m.c.z;
        w = m.a.y - m.b.x;
    }
    const double norm = std::sqrt(x * x + y * y + z * z + w * w);
    const double s = (w < 0 ? -1.0 : 1.0) / norm;
    return {x * s, y * s, z * s, w * s};
}

}  // namespace

struct SimulatedCamera::State {
    State(const Scene& scene, const SimulationOptions& options, std::uint64_t day, double duration_s,
          const Pinhole& pinhole)
        : dirt(laid_over(scene.dirt, options.dirt)),
          world(scene, options.seed, day, duration_s),
          hand(dirt, day),
          renderer(pinhole),
          row_renderer(pinhole),
          sum(static_cast<std::size_t>(pinhole.width) * pinhole.height),
          grey(sum.size()),
          mask(sum.size()),
          depth(sum.size()),
          depth_sensor(pinhole.width, pinhole.height),
          row_poses(pinhole.height),
          colour_readout_s(kColourReadoutS * dirt.rolling),
          depth_readout_s(kDepthReadoutS * dirt.rolling) {
        Random random(day ^ 0x6578'706f'7375'7265ULL);
        for (double& phase : exposure_phase) phase = random.uniform(0, 2 * kPi);
    }

    [[nodiscard]] Rigid pose_at(double time_s) const { return hand.carry(world.camera().at(time_s), time_s); }
    [[nodiscard]] bool is_rolling() const { return dirt.rolling > 0; }
    // What moves within so long before and after.
    void record(double time_s, double reach_s) {
        recording.begin(time_s - reach_s, time_s + reach_s);
        for (std::uint32_t i = 0; i < recording.count(); ++i) {
            recording.begin_pass(i);
            world.draw_moving(recording, recording.moment_s(i));
        }
        recording.begin_still();
        world.draw_still(recording);
    }
    // A picture of the recording whose middle row is taken at this time, by a camera that stands `aside` of its place.
    void draw_rows(double time_s, double readout_s, const Vec3& aside, double offset_x, double offset_y) {
        for (std::size_t y = 0; y < row_poses.size(); ++y) {
            const double share = (static_cast<double>(y) + 0.5) / static_cast<double>(row_poses.size()) - 0.5;
            RowPose& row = row_poses[y];
            row.time_s = time_s + share * readout_s;
            row.world_from_camera = pose_at(row.time_s);
            row.world_from_camera.translation = row.world_from_camera * aside;
        }
        row_renderer.draw(recording, row_poses, offset_x, offset_y);
    }
    // The mean of pictures spread over the exposure, into `sum`; in the end the middle of it is recorded.
    void take_colour(double time_s, double exposure_s);
    void take_mask(const Picture& picture);

    Dirt dirt;
    World world;
    Hand hand;
    Renderer renderer;
    RowRenderer row_renderer;
    Recording recording;
    std::vector<float> sum;
    std::vector<std::uint8_t> grey;
    std::vector<std::uint8_t> mask;
    std::vector<std::uint16_t> depth;
    DepthSensor depth_sensor;
    std::vector<RowPose> row_poses;
    double colour_readout_s, depth_readout_s;
    double exposure_phase[3] = {};
    std::size_t dynamic_count = 0;
};

void SimulatedCamera::State::take_colour(double time_s, double exposure_s) {
    for (float& value : sum) value = 0;
    if (is_rolling()) record(time_s, (colour_readout_s + exposure_s) / 2);
    for (std::uint32_t i = 0; i < kExposures; ++i) {
        const double instant = time_s + exposure_s * kInstant[i];
        if (is_rolling()) {
            draw_rows(instant, colour_readout_s, {}, kOffsetX[i], kOffsetY[i]);
            row_renderer.shade_into(sum, kLevelOffset[i]);
            continue;
        }
        renderer.begin(pose_at(instant), kOffsetX[i], kOffsetY[i]);
        world.draw(renderer, instant);
        renderer.shade_into(sum, kLevelOffset[i]);
    }
}

void SimulatedCamera::State::take_mask(const Picture& picture) {
    dynamic_count = 0;
    const std::vector<std::uint32_t>& ids = picture.face_ids();
    for (std::size_t i = 0; i < ids.size(); ++i) {
        const bool is_dynamic = ids[i] != kNoFace && picture.face(ids[i]).material.is_dynamic;
        mask[i] = is_dynamic ? 255 : 0;
        dynamic_count += is_dynamic;
    }
}

std::span<const SimulatedScene> simulated_scenes() noexcept {
    constexpr std::size_t kScenesMax = 32;
    static std::array<SimulatedScene, kScenesMax> list;
    std::size_t count = 0;
    for (const Scene& scene : scenes()) list[count++] = {scene.name, scene.frames, scene.dirt};
    return {list.data(), count};
}

SimulatedCamera::SimulatedCamera(SimulationOptions options) : options_(std::move(options)) {}
SimulatedCamera::~SimulatedCamera() = default;

Status SimulatedCamera::open() noexcept {
    close();
    const Scene* found = nullptr;
    for (const Scene& scene : scenes()) {
        if (options_.scene == scene.name) found = &scene;
    }
    if (found == nullptr) {
        message_ = "there is no scene '" + options_.scene + "'; there are:";
        for (const Scene& scene : scenes()) message_ += std::string(" ") + scene.name;
        return Status::kInvalid;
    }
    const auto is_within = [](std::uint32_t side) { return side >= 32 && side <= 2047; };
    if (!is_within(options_.width) || !is_within(options_.height)) {
        message_ = "the image must be 32 to 2047 pixels wide and high, not " + std::to_string(options_.width) + " x " +
                   std::to_string(options_.height);
        return Status::kInvalid;
    }
    if (options_.depth_lag_ns < -33'000'000 || options_.depth_lag_ns > 33'000'000) {
        message_ = "the lag between colour and depth must be within +-33 ms";
        return Status::kInvalid;
    }
    if (options_.exposure_ns < 0 || options_.exposure_ns > 33'000'000) {
        message_ = "the exposure must be 0 to 33 ms";
        return Status::kInvalid;
    }
    if (!(options_.depth_baseline_m > -1 && options_.depth_baseline_m < 1)) {
        message_ = "the depth camera must stand within 1 m of the colour camera";
        return Status::kInvalid;
    }
    frame_count_ = options_.frames == 0 ? found->frames : options_.frames;
    if (frame_count_ > 1'000'000) {
        message_ = "at most 1000000 frames";
        return Status::kInvalid;
    }
    Pinhole pinhole;
    pinhole.width = options_.width;
    pinhole.height = options_.height;
    pinhole.fx = 528.0 * options_.width / 640.0;
    pinhole.fy = pinhole.fx;
    pinhole.cx = (options_.width - 1) / 2.0;
    pinhole.cy = (options_.height - 1) / 2.0;
    info_ = {};
    info_.model.width = pinhole.width;
    info_.model.height = pinhole.height;
    info_.model.fx = pinhole.fx;
    info_.model.fy = pinhole.fy;
    info_.model.cx = pinhole.cx;
    info_.model.cy = pinhole.cy;
    info_.depth_units_per_m = 5000.0;
    info_.frames_per_s = kFramesPerSecond;
    day_ = options_.day == 0 ? options_.seed : options_.day;
    state_ = std::make_unique<State>(*found, options_, day_, frame_count_ / kFramesPerSecond, pinhole);
    next_ = 0;
    message_.clear();
    return Status::kOk;
}

const CameraInfo& SimulatedCamera::info() const noexcept {
    STILLMESH_CHECK(state_ != nullptr);
    return info_;
}

Status SimulatedCamera::poll(Frame& frame) noexcept {
    if (state_ == nullptr) return Status::kUnavailable;
    if (next_ >= frame_count_) return Status::kEnd;
    State& s = *state_;
    const std::int64_t since_start_ns = static_cast<std::int64_t>(next_) * 1'000'000'000 / 30;
    const double t = static_cast<double>(since_start_ns) * 1e-9;
    const double lag = static_cast<double>(options_.depth_lag_ns) * 1e-9;
    const double exposure = static_cast<double>(options_.exposure_ns) * 1e-9;
    s.take_colour(t, exposure);
    // Automatic exposure, hunting slowly, and noise of the sensor: more of it where there is more light.
    const double gain = 1.2 + 0.10 * sine(0.43 * t + s.exposure_phase[0]) +
                        0.06 * sine(1.31 * t + s.exposure_phase[1]) + 0.02 * sine(4.1 * t + s.exposure_phase[2]);
    const auto factor = static_cast<float>(gain / kExposures);
    const std::uint32_t key = scramble(static_cast<std::uint32_t>(day_) * 7919U + next_);
    for (std::size_t i = 0; i < s.sum.size(); ++i) {
        const float value = s.sum[i] * factor;
        const float noise = (1.3F + 0.008F * value) * bell(scramble(static_cast<std::uint32_t>(i) * 2891336453U + key));
        float out = value + noise + 0.5F;
        out = out < 0.0F ? 0.0F : (out > 255.0F ? 255.0F : out);
        s.grey[i] = static_cast<std::uint8_t>(out);
    }

    // The truth at the middle of the exposure, and depth at its own time.
    const Rigid pose = s.pose_at(t);
    if (s.is_rolling()) {
        s.draw_rows(t, s.colour_readout_s, {}, 0, 0);
        s.take_mask(s.row_renderer);
        s.record(t + lag, s.depth_readout_s / 2);
        s.draw_rows(t + lag, s.depth_readout_s, {-options_.depth_baseline_m, 0, 0}, 0, 0);
        s.depth_sensor.sense(s.row_renderer, scramble(key), static_cast<float>(info_.depth_units_per_m), s.depth);
    } else {
        s.renderer.begin(pose, 0, 0);
        s.world.draw(s.renderer, t);
        s.take_mask(s.renderer);
        if (options_.depth_lag_ns != 0 || options_.depth_baseline_m != 0) {
            Rigid depth_pose = s.pose_at(t + lag);
            depth_pose.translation = depth_pose * Vec3{-options_.depth_baseline_m, 0, 0};
            s.renderer.begin(depth_pose, 0, 0);
            s.world.draw(s.renderer, t + lag);
        }
        s.depth_sensor.sense(s.renderer, scramble(key), static_cast<float>(info_.depth_units_per_m), s.depth);
    }
    dynamic_share_ = static_cast<double>(s.dynamic_count) / static_cast<double>(s.mask.size());

    pose_.time_ns = kFirstFrameNs + since_start_ns;
    pose_.t = {pose.translation.x, pose.translation.y, pose.translation.z};
    pose_.q = quaternion(pose.rotation);
    frame.time_ns = pose_.time_ns;
    frame.depth_time_ns = pose_.time_ns + options_.depth_lag_ns;
    frame.format = PixelFormat::kGrey8;
    frame.colour = {s.grey.data(), options_.width, options_.height, options_.width};
    frame.depth = {s.depth.data(), options_.width, options_.height, options_.width};
    frame.depth_units_per_m = info_.depth_units_per_m;
    ++next_;
    return Status::kOk;
}

Status SimulatedCamera::wait(std::uint32_t timeout_ms) noexcept {
    static_cast<void>(timeout_ms);
    if (state_ == nullptr) return Status::kUnavailable;
    return next_ < frame_count_ ? Status::kOk : Status::kEnd;
}

void SimulatedCamera::close() noexcept {
    state_.reset();
}

ImageView<std::uint8_t> SimulatedCamera::dynamic_mask() const noexcept {
    STILLMESH_CHECK(state_ != nullptr);
    return {state_->mask.data(), options_.width, options_.height, options_.width};
}

}  // namespace stillmesh
