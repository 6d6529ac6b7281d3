// The engine under Limits::tiny(), with any configuration, any camera and any frames: right ones of a scene that moves,
// and wrong ones. What must be refused is refused and changes nothing, what is right is accepted, poses are poses,
// pools keep their limits, and a second engine in a block full of other garbage does the same, bit by bit.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <type_traits>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"
#include "engine/engine.hpp"
#include "fuzz/fuzz.hpp"
#include "fuzz/pictures.hpp"
#include "platform/linux/cpu_kernels.hpp"

// A failed check says which before it stops.
void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "check failed: %s (%s:%d)\n", expression, file, line);
}

namespace {

using namespace stillmesh;

constexpr std::uint32_t kFramesMax = 16;

// A block of exactly the needed size, so that one byte too many is seen, full of `garbage`.
class Block {
public:
    Block(std::size_t bytes, int garbage)
        : bytes_(bytes), block_(new (std::align_val_t(kArenaAlignment)) std::byte[bytes]) {
        std::memset(block_.get(), garbage, bytes);
    }
    [[nodiscard]] std::span<std::byte> span() const { return {block_.get(), bytes_}; }

private:
    struct Free {
        void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t(kArenaAlignment)); }
    };
    std::size_t bytes_;
    std::unique_ptr<std::byte[], Free> block_;
};

// Up to 7 parameters anywhere in their ranges.
Configuration configuration_from(fuzz::Bytes& bytes) {
    Configuration configuration;
    configuration.features.count = Limits::tiny().features_max;
    configuration.features.levels = Limits::tiny().pyramid_levels_max;
    configuration.mapping.window_keyframes = Limits::tiny().keyframes_max;
    for (int changes = bytes.u8() % 8; changes > 0; --changes) {
        const std::uint32_t which = bytes.u8();
        const double part = bytes.u16() / 65535.0;
        std::uint32_t index = 0;
        visit_parameters(configuration,
                         [&](const char*, auto& value, double min, double max, const char*, const char*) {
                             using Value = std::remove_reference_t<decltype(value)>;
                             if (index++ != which) return;
                             if constexpr (std::is_same_v<Value, bool>) {
                                 value = part < 0.5;
                             } else {
                                 value = static_cast<Value>(min + part * (max - min));
                             }
                         });
    }
    return configuration;
}

CameraModel camera_from(fuzz::Bytes& bytes, bool& is_good) {
    const Limits limits = Limits::tiny();
    CameraModel camera;
    camera.width = limits.image_width_max;
    camera.height = limits.image_height_max;
    camera.fx = camera.fy = 130;
    camera.cx = 79.5;
    camera.cy = 59.5;
    const std::uint8_t how = bytes.u8();
    is_good = how % 4 != 3;
    if (how % 4 == 1) {
        camera.k1 = 0.2624;
        camera.k2 = -0.9531;
        camera.p1 = -0.0054;
        camera.p2 = 0.0026;
        camera.k3 = 1.1633;
    } else if (how % 4 == 2) {
        camera.width = 120;
        camera.height = 100;
        camera.cx = 60;
        camera.cy = 50;
    } else if (how % 4 == 3) {
        camera.width = bytes.u8();
        camera.height = bytes.u8();
        for (double* const number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.k1, &camera.p1}) {
            const std::uint8_t kind = bytes.u8();
            if (kind == 0) *number = std::numeric_limits<double>::quiet_NaN();
            if (kind == 1) *number = std::numeric_limits<double>::infinity();
            if (kind == 2) *number = 0;
            if (kind > 200) *number = kind - 228;
        }
    }
    return camera;
}

// A textured world before the camera that it moves along, with a body that moves otherwise.
struct Scene {
    std::int32_t x = 1000, y = 1000, body_x = 40;
    std::uint32_t depth = 8000;

    void move(fuzz::Bytes& bytes) {
        const std::uint8_t by = bytes.u8();
        x += (by & 7) - 3;
        y += (by >> 3 & 3) - 1;
        body_x += (by >> 5) - 3;
        depth += bytes.u8() % 16U;
    }
    void draw(fuzz::Picture<std::uint8_t>& colour, fuzz::Picture<std::uint16_t>& depths, std::uint32_t channels) const {
        const auto width = static_cast<std::int32_t>(depths.view.width);
        const auto height = static_cast<std::int32_t>(depths.view.height);
        for (std::int32_t v = 0; v < height; ++v) {
            for (std::int32_t u = 0; u < width; ++u) {
                const bool is_body = u >= body_x && u < body_x + 50 && v > 20;
                const std::int32_t s = is_body ? u - body_x + 5000 : u + x;
                const std::int32_t t = is_body ? v : v + y;
                std::uint32_t cell =
                    static_cast<std::uint32_t>(s / 5) * 2654435761U ^ static_cast<std::uint32_t>(t / 5) * 2246822519U;
                cell ^= cell >> 15;
                const std::size_t at =
                    static_cast<std::size_t>(v) * colour.view.stride + static_cast<std::size_t>(u) * channels;
                for (std::uint32_t c = 0; c < channels; ++c)
                    colour.pixels[at + c] = static_cast<std::uint8_t>(cell * 97);
                depths.pixels[static_cast<std::size_t>(v) * depths.view.stride + static_cast<std::size_t>(u)] =
                    static_cast<std::uint16_t>(is_body ? depth / 2 : depth + 3U * static_cast<std::uint32_t>(u));
            }
        }
    }
};

void expect_pose(const PoseEstimate& pose) {
    for (const RigidTransform* const transform : {&pose.odom_from_camera, &pose.map_from_odom}) {
        double squared = 0;
        for (const double number : transform->rotation_xyzw) squared += number * number;
        fuzz::expect(std::abs(squared - 1) < 1e-6, "rotations are unit quaternions");
        for (const double number : transform->translation_m)
            fuzz::expect(std::isfinite(number), "positions are finite");
    }
    for (std::size_t i = 0; i < 36; ++i) {
        fuzz::expect(std::isfinite(pose.covariance[i]), "covariances are finite");
        fuzz::expect(i % 7 != 0 || pose.covariance[i] >= 0, "variances are not negative");
    }
}

void expect_limits(Engine& engine, const CameraModel& camera) {
    const Limits limits = Limits::tiny();
    const EngineStatistics statistics = engine.statistics();
    for (const PoolStatistics* const pool : {&statistics.keyframes, &statistics.map_points}) {
        fuzz::expect(pool->size <= pool->high_water && pool->high_water <= pool->capacity, "pools keep their limits");
    }
    fuzz::expect(statistics.keyframes.capacity <= limits.keyframes_max, "as many keyframes as the limits say");
    fuzz::expect(statistics.map_points.capacity <= limits.map_points_max, "as many points as the limits say");
    fuzz::expect(statistics.arena_used_bytes == bytes_needed(limits), "bytes_needed is what is used");
    const FrameStatistics& frame = engine.frame_statistics();
    fuzz::expect(frame.features <= limits.features_max && frame.features_with_depth <= frame.features,
                 "features keep their limit");
    const TrackingView view = engine.tracking_view();
    fuzz::expect(view.features.size() <= limits.features_max, "features keep their limit");
    for (const TrackedFeature& feature : view.features) {
        fuzz::expect(feature.x >= 0 && feature.x < static_cast<float>(camera.width) && feature.y >= 0 &&
                         feature.y < static_cast<float>(camera.height),
                     "features lie in the image");
        fuzz::expect(!(feature.is_static && feature.is_dynamic), "nothing is static and moves");
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const Limits limits = Limits::tiny();
    fuzz::Bytes bytes({data, size_bytes});
    const Configuration configuration = configuration_from(bytes);
    bool is_camera_good = false;
    const CameraModel camera = camera_from(bytes, is_camera_good);

    const Block block(bytes_needed(limits), 0), other_block(bytes_needed(limits), 0xa5);
    const auto made = Engine::create(block.span(), limits, configuration, camera, cpu_kernels());
    // The plain kernels are slow under a fuzzer's instruments: now and then.
    const Kernels& other_kernels = size_bytes % 8 == 0 ? plain_kernels() : cpu_kernels();
    const auto other_made = Engine::create(other_block.span(), limits, configuration, camera, other_kernels);
    fuzz::expect(made.status() == other_made.status(), "the same status from the same arguments");
    if (validate(configuration, limits).key != nullptr) {
        fuzz::expect(made.status() == Status::kInvalid, "a configuration that validate() refuses is kInvalid");
    } else if (is_camera_good) {
        fuzz::expect(made.is_ok(), "what is right is accepted");
    }
    if (!made.is_ok()) {
        fuzz::expect(made.status() == Status::kInvalid, "create says kInvalid when the block is large enough");
        return 0;
    }
    Engine& engine = *made.value();
    Engine& other = *other_made.value();

    Scene scene;
    std::int64_t last_ns = -1;
    for (std::uint32_t frames = 0; frames < kFramesMax && !bytes.is_empty(); ++frames) {
        const std::uint8_t what = bytes.u8();
        if (what == 255) {
            engine.reset();
            other.reset();
            last_ns = -1;  // anew: any time will do
            fuzz::expect(engine.state_hash() == other.state_hash(), "the same bits after reset");
            continue;
        }
        Frame frame;
        frame.format = what % 3 == 0 ? PixelFormat::kRgb8 : what % 3 == 1 ? PixelFormat::kBgr8 : PixelFormat::kGrey8;
        const std::uint32_t channels = channels_of(frame.format);
        fuzz::Bytes texture = what % 16 < 12 ? fuzz::Bytes({}) : bytes;
        auto colour = fuzz::picture_from<std::uint8_t>(texture, camera.width, camera.height, channels);
        auto depth = fuzz::picture_from<std::uint16_t>(texture, camera.width, camera.height, 1);
        if (what % 16 < 12) {
            scene.move(bytes);
            scene.draw(colour, depth, channels);
        } else {
            bytes = texture;
        }
        frame.colour = colour.view;
        frame.depth = depth.view;
        const std::int64_t step_ns = what < 200 ? 33'000'000 : std::int64_t{1} << (what % 60);
        frame.time_ns = last_ns > std::numeric_limits<std::int64_t>::max() - step_ns ? last_ns : last_ns + step_ns;
        frame.depth_time_ns = frame.time_ns;
        bool must_refuse = frame.time_ns <= last_ns || frame.time_ns >= std::int64_t{1} << 62U;
        bool may_refuse = false;
        if (what / 16 % 4 == 3) {  // wrong in one way
            switch (bytes.u8() % 12) {
                case 0:
                    frame.time_ns = last_ns;
                    must_refuse = true;
                    break;
                case 1:
                    frame.time_ns = std::numeric_limits<std::int64_t>::min();
                    must_refuse = true;
                    break;
                case 2:
                    frame.colour.width -= 1;
                    must_refuse = true;
                    break;
                case 3:
                    frame.depth.height -= 1;
                    must_refuse = true;
                    break;
                case 4:
                    frame.colour.data = nullptr;
                    must_refuse = true;
                    break;
                case 5:
                    frame.depth.data = nullptr;
                    must_refuse = true;
                    break;
                case 6:
                    frame.depth_units_per_m = 0;
                    must_refuse = true;
                    break;
                case 7:
                    frame.depth_units_per_m = std::numeric_limits<double>::quiet_NaN();
                    must_refuse = true;
                    break;
                case 8:
                    frame.depth_units_per_m = std::numeric_limits<double>::infinity();
                    may_refuse = true;
                    break;
                case 9:
                    frame.depth_units_per_m = 1e-300;
                    may_refuse = true;
                    break;
                case 10:
                    frame.colour.stride = frame.colour.width * channels - 1;
                    must_refuse = true;
                    break;
                default:
                    frame.depth_time_ns = static_cast<std::int64_t>(bytes.u64());
                    may_refuse = true;
                    break;
            }
        }
        const std::uint64_t hash = engine.state_hash(), refused = engine.statistics().frames_refused;
        const Status status = engine.submit(frame);
        fuzz::expect(other.submit(frame) == status, "the same status for the same frame");
        fuzz::expect(engine.state_hash() == other.state_hash(), "the same bits, whatever the memory held before");
        if (status == Status::kOk) {
            fuzz::expect(!must_refuse, "a wrong frame is refused");
            fuzz::expect(engine.pose().time_ns == frame.time_ns, "the pose is for this frame");
            last_ns = frame.time_ns;
        } else {
            fuzz::expect(status == Status::kInvalid && (must_refuse || may_refuse), "a right frame is accepted");
            fuzz::expect(engine.state_hash() == hash, "a refused frame changes nothing");
            fuzz::expect(engine.statistics().frames_refused == refused + 1, "refused frames are counted");
        }
        expect_pose(engine.pose());
        expect_limits(engine, camera);
    }
    return 0;
}
