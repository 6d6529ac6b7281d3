#include "hal/simulated/simulated_camera.hpp"

#include <cmath>
#include <optional>

#include "engine/base/numbers.hpp"
#include "hal/simulated/colour_dirt.hpp"
#include "hal/simulated/depth_dirt.hpp"
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
// Of the calibration given out: focal length, and px of the centre in 640.
constexpr double kFocalOff = 0.003, kCentreOffPx = 1.5;
constexpr double kGapEveryS = 4.0;  // between two holes; each of 2 to 6 frames
constexpr double kStampOffNs = 2e6;
constexpr double kJpegLoss = 30;  // of a quality of 100

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

[[nodiscard]] Rigid rigid(const RigidTransform& pose) {
    const RotationMatrix r = matrix_of(pose.rotation_xyzw);
    return {{{r[0], r[3], r[6]}, {r[1], r[4], r[7]}, {r[2], r[5], r[8]}},
            {pose.translation_m[0], pose.translation_m[1], pose.translation_m[2]}};
}

}  // namespace

struct SimulatedCamera::State {
    State(const Scene& scene, const SimulationOptions& options, const Dirt& with, std::uint64_t day, double duration_s,
          const Pinhole& pinhole)
        : dirt(with),
          takes_rows(dirt.rolling > 0 || dirt.borders > 0 || dirt.late > 0 || dirt.shadows > 0),
          world(scene, options.seed, day, duration_s, dirt),
          hand(dirt, day),
          colour_dirt(dirt, day),
          depth_dirt(dirt, day, pinhole),
          renderer(pinhole),
          sum(static_cast<std::size_t>(pinhole.width) * pinhole.height),
          grey(sum.size()),
          mask(sum.size()),
          depth(sum.size()),
          depth_sensor(pinhole.width, pinhole.height),
          row_poses(pinhole.height),
          colour_readout_s(kColourReadoutS * dirt.rolling),
          depth_readout_s(kDepthReadoutS * dirt.rolling) {
        if (takes_rows) row_renderer.emplace(pinhole);
        if (options.separate_depth) {
            const CameraModel& m = options.separate_depth->model;
            depth_renderer.emplace(Pinhole{m.width, m.height, m.fx, m.fy, m.cx, m.cy});
            depth_sensor = DepthSensor(m.width, m.height);
            depth.resize(std::size_t{m.width} * m.height);
            colour_from_depth = rigid(options.separate_depth->colour_from_depth);
        }
        Random random(day ^ 0x6578'706f'7375'7265ULL);
        for (double& phase : exposure_phase) phase = random.uniform(0, 2 * kPi);
    }

    [[nodiscard]] Rigid pose_at(double time_s) const { return hand.carry(world.camera().at(time_s), time_s); }
    // From the middle of the picture to this row.
    [[nodiscard]] double row_time_s(std::size_t y, double readout_s) const {
        return ((static_cast<double>(y) + 0.5) / static_cast<double>(row_poses.size()) - 0.5) * readout_s;
    }
    void record(double time_s, double reach_s);
    void draw_rows(double time_s, double readout_s, const Rigid& in_camera, double offset_x, double offset_y);
    void take_colour(double time_s, double exposure_s);
    void take_middle(double time_s);
    void take_mask(const Picture& picture);
    void cast_shadows(double time_s);
    void develop(double time_s, std::uint32_t key);
    void take_depth(double time_s, const SimulationOptions& options, std::uint32_t key, float units_per_m);

    Dirt dirt;
    bool takes_rows;  // one by one; else the picture as a whole
    World world;
    Hand hand;
    ColourDirt colour_dirt;
    DepthDirt depth_dirt;
    Renderer renderer;
    std::optional<RowRenderer> row_renderer;  // with takes_rows
    std::optional<Renderer> depth_renderer;   // of a depth camera of its own
    Rigid colour_from_depth;
    Recording recording;
    std::vector<float> sum;
    std::vector<std::uint8_t> grey;
    std::vector<std::uint8_t> mask;
    std::vector<std::uint16_t> depth;
    DepthSensor depth_sensor;
    std::vector<RowPose> row_poses;
    std::vector<Post> posts;
    double colour_readout_s, depth_readout_s;
    double exposure_phase[3] = {};
    std::size_t dynamic_count = 0;
};

// What moves within so long before and after.
void SimulatedCamera::State::record(double time_s, double reach_s) {
    recording.begin(time_s - reach_s, time_s + reach_s);
    for (std::uint32_t i = 0; i < recording.count(); ++i) {
        recording.begin_pass(i);
        world.draw_moving(recording, recording.moment_s(i));
    }
    recording.begin_still();
    world.draw_still(recording);
}

// A picture of the recording whose middle row is taken at this time, by a camera that stands so in the other.
void SimulatedCamera::State::draw_rows(double time_s, double readout_s, const Rigid& in_camera, double offset_x,
                                       double offset_y) {
    for (std::size_t y = 0; y < row_poses.size(); ++y) {
        RowPose& row = row_poses[y];
        row.time_s = time_s + row_time_s(y, readout_s);
        const Rigid pose = pose_at(row.time_s);
        row.world_from_camera = {pose.rotation * in_camera.rotation, pose * in_camera.translation};
    }
    row_renderer->draw(recording, row_poses, offset_x, offset_y);
}

// The mean of pictures spread over the exposure, into `sum`.
void SimulatedCamera::State::take_colour(double time_s, double exposure_s) {
    for (float& value : sum) value = 0;
    if (takes_rows) {
        row_renderer->set_camera(renderer.camera());
        record(time_s, (colour_readout_s + exposure_s) / 2);
    }
    for (std::uint32_t i = 0; i < kExposures; ++i) {
        const double instant = time_s + exposure_s * kInstant[i];
        if (takes_rows) {
            draw_rows(instant, colour_readout_s, {}, kOffsetX[i], kOffsetY[i]);
            row_renderer->shade_into(sum, kLevelOffset[i]);
            continue;
        }
        renderer.begin(pose_at(instant), kOffsetX[i], kOffsetY[i]);
        world.draw(renderer, instant);
        renderer.shade_into(sum, kLevelOffset[i]);
    }
}

// The middle of the exposure: what moves there, and who casts a shadow.
void SimulatedCamera::State::take_middle(double time_s) {
    if (!takes_rows) {
        renderer.begin(pose_at(time_s), 0, 0);
        world.draw(renderer, time_s);
        take_mask(renderer);
        return;
    }
    draw_rows(time_s, colour_readout_s, {}, 0, 0);
    take_mask(*row_renderer);
    if (dirt.shadows > 0) cast_shadows(time_s);
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

void SimulatedCamera::State::cast_shadows(double time_s) {
    world.find_posts(time_s, posts);
    if (posts.empty()) return;
    const Pinhole& camera = renderer.camera();
    for (std::uint32_t y = 0; y < camera.height; ++y) {
        const Rigid& pose = row_poses[y].world_from_camera;
        const std::size_t row = std::size_t{y} * camera.width;
        float factor = 1;
        for (std::uint32_t x = 0; x < camera.width; ++x) {
            const std::size_t i = row + x;
            const float w = row_renderer->inverse_depth()[i];
            if (mask[i] != 0 || !(w > 0)) continue;
            // A shadow is softer than two pixels of one face.
            if (x % 2 == 0 || mask[i - 1] != 0 || row_renderer->face_ids()[i] != row_renderer->face_ids()[i - 1]) {
                const double z = 1 / static_cast<double>(w);
                const Vec3 p = pose * Vec3{(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z};
                factor = static_cast<float>(light_left(posts, p, dirt.shadows));
            }
            sum[i] *= factor;
        }
    }
}

// From `sum` to grey: automatic exposure, hunting slowly, and noise of the sensor: more of it where there is more
// light.
void SimulatedCamera::State::develop(double time_s, std::uint32_t key) {
    double gain = 1.2 + 0.10 * sine(0.43 * time_s + exposure_phase[0]) +
                  0.06 * sine(1.31 * time_s + exposure_phase[1]) + 0.02 * sine(4.1 * time_s + exposure_phase[2]);
    if (dirt.hunting > 0) gain *= colour_dirt.exposure(time_s);
    auto factor = static_cast<float>(gain / kExposures);
    std::size_t i = 0;
    for (std::size_t y = 0; y < row_poses.size(); ++y) {
        if (dirt.flicker > 0) {  // lamps do not wait for a shutter: the rows of any Kinect
            factor = static_cast<float>(gain * colour_dirt.lamps(time_s + row_time_s(y, kColourReadoutS)) / kExposures);
        }
        for (const std::size_t end = i + renderer.camera().width; i < end; ++i) {
            const float value = sum[i] * factor;
            const float noise =
                (1.3F + 0.008F * value) * bell(scramble(static_cast<std::uint32_t>(i) * 2891336453U + key));
            float out = value + noise + 0.5F;
            out = out < 0.0F ? 0.0F : (out > 255.0F ? 255.0F : out);
            grey[i] = static_cast<std::uint8_t>(out);
        }
    }
    if (dirt.jpeg > 0) {
        compress(grey, renderer.camera().width, renderer.camera().height,
                 round_clamped(100 - kJpegLoss * dirt.jpeg, 5, 100));
    }
}

// Depth at this time of its own; after the middle was taken.
void SimulatedCamera::State::take_depth(double time_s, const SimulationOptions& options, std::uint32_t key,
                                        float units_per_m) {
    if (depth_renderer) {
        const Rigid world_from_colour = pose_at(time_s);
        depth_renderer->begin({world_from_colour.rotation * colour_from_depth.rotation,
                               world_from_colour * colour_from_depth.translation},
                              0, 0);
        world.draw(*depth_renderer, time_s);
        depth_sensor.sense(*depth_renderer, scramble(key), units_per_m, depth);
        return;
    }
    const Vec3 aside{-options.depth_baseline_m, 0, 0};
    for (float& value : sum) value *= 1.0F / kExposures;
    const DepthErrors errors = dirt.scale > 0 || dirt.dark > 0 || dirt.noise > 0 || dirt.ragged > 0
                                   ? depth_dirt.errors(time_s, sum)
                                   : DepthErrors{};
    if (takes_rows) {
        Rigid place = depth_dirt.place();
        place.translation = place.translation + aside;
        record(time_s, depth_readout_s / 2);
        row_renderer->set_camera(depth_dirt.pinhole());
        draw_rows(time_s, depth_readout_s, place, 0, 0);
        depth_sensor.sense(*row_renderer, scramble(key), units_per_m, depth, errors);
        return;
    }
    if (options.depth_lag_ns != 0 || options.depth_baseline_m != 0) {
        Rigid pose = pose_at(time_s);
        pose.translation = pose * aside;
        renderer.begin(pose, 0, 0);
        world.draw(renderer, time_s);
    }
    depth_sensor.sense(renderer, scramble(key), units_per_m, depth, errors);
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
    if (options_.separate_depth &&
        (!is_within(options_.separate_depth->model.width) || !is_within(options_.separate_depth->model.height))) {
        message_ = "the depth image must be 32 to 2047 pixels wide and high";
        return Status::kInvalid;
    }
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
    info_.separate_depth = options_.separate_depth;
    day_ = options_.day == 0 ? options_.seed : options_.day;
    const Dirt dirt = laid_over(found->dirt, options_.dirt);
    if (dirt.calibration > 0) {
        Random random(day_ ^ 0x6361'6c69'6272'0001ULL);
        const auto side = [&] { return dirt.calibration * (random.uniform() < 0.5 ? -1.0 : 1.0); };
        const double focal = 1 + side() * kFocalOff;
        info_.model.fx *= focal;
        info_.model.fy *= focal;
        info_.model.cx += side() * kCentreOffPx * options_.width / 640.0;
        info_.model.cy += side() * kCentreOffPx * options_.width / 640.0;
    }
    choose_frames(dirt.gaps);
    state_ = std::make_unique<State>(*found, options_, dirt, day_, (taken_.back() + 1) / kFramesPerSecond, pinhole);
    next_ = 0;
    message_.clear();
    return Status::kOk;
}

// So many frames of a run that has holes.
void SimulatedCamera::choose_frames(double gaps) {
    taken_.clear();
    Random random(day_ ^ 0x6761'7073'0000'0001ULL);
    std::uint32_t number = 0;
    // The first hole comes after half a period to a whole one, and the next ones 4 s apart.
    auto hole = static_cast<std::uint32_t>(kGapEveryS * kFramesPerSecond * random.uniform(0.5, 1.0));
    while (taken_.size() < frame_count_) {
        if (gaps > 0 && number == hole) {
            number += static_cast<std::uint32_t>(round_clamped(gaps * (2 + random.below(5)), 1, 100));
            hole += static_cast<std::uint32_t>(kGapEveryS * kFramesPerSecond);
            continue;
        }
        taken_.push_back(number++);
    }
}

const CameraInfo& SimulatedCamera::info() const noexcept {
    STILLMESH_CHECK(state_ != nullptr);
    return info_;
}

Status SimulatedCamera::poll(Frame& frame) noexcept {
    if (state_ == nullptr) return Status::kUnavailable;
    if (next_ >= frame_count_) return Status::kEnd;
    State& s = *state_;
    const std::uint32_t number = taken_[next_];
    const std::int64_t since_start_ns = static_cast<std::int64_t>(number) * 1'000'000'000 / 30;
    const double t = static_cast<double>(since_start_ns) * 1e-9;
    const double lag = static_cast<double>(options_.depth_lag_ns) * 1e-9;
    const double late = s.depth_dirt.late_s(t);
    const std::uint32_t key = scramble(static_cast<std::uint32_t>(day_) * 7919U + number);
    s.take_colour(t, static_cast<double>(options_.exposure_ns) * 1e-9);
    s.take_middle(t);
    s.develop(t, key);
    s.take_depth(t + lag + late, options_, key, static_cast<float>(info_.depth_units_per_m));
    dynamic_share_ = static_cast<double>(s.dynamic_count) / static_cast<double>(s.mask.size());

    const Rigid pose = s.pose_at(t);
    pose_.time_ns = kFirstFrameNs + since_start_ns;
    if (s.dirt.stamps > 0) {
        pose_.time_ns += round_clamped_64(Random(key).uniform(-1, 1) * s.dirt.stamps * kStampOffNs);
    }
    pose_.t = {pose.translation.x, pose.translation.y, pose.translation.z};
    pose_.q = quaternion(pose.rotation);
    frame.time_ns = pose_.time_ns;
    frame.depth_time_ns = pose_.time_ns + options_.depth_lag_ns + round_clamped_64(late * 0.5e9);
    frame.format = PixelFormat::kGrey8;
    frame.colour = {s.grey.data(), options_.width, options_.height, options_.width};
    const CameraModel& depth_model = info_.separate_depth ? info_.separate_depth->model : info_.model;
    frame.depth = {s.depth.data(), depth_model.width, depth_model.height, depth_model.width};
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
