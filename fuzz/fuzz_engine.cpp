// The engine under small limits, with any configuration, any camera and any frames: right ones of a scene that moves,
// and wrong ones, with work between them, a vocabulary, maps, and a store of which bytes may change. What must be
// refused is refused and changes nothing, what is right is accepted, poses are poses, pools keep their limits, a map
// that was written is taken, and a second engine in a block full of other garbage does the same, bit by bit: of one
// input in eight, which may have twice as many frames as well. Which ones, a checksum of the bytes says, so that an
// input does the same every time; in Fuzz.engine all.
#include <cmath>
#include <limits>

#include "engine/base/check.hpp"
#include "engine/base/crc.hpp"
#include "fuzz/engine_input.hpp"
#include "fuzz/engine_scene.hpp"
#include "fuzz/memory_store.hpp"
#include "fuzz/pictures.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/place/vocabularies.hpp"
#ifdef STILLMESH_CANARY
#include "fuzz/canary.hpp"
#endif

// A failed check says which before it stops.
void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "check failed: %s (%s:%d)\n", expression, file, line);
}

namespace {

using namespace stillmesh;
using fuzz::kSmallLimits;

constexpr std::uint32_t kActsMax = 16;
constexpr std::uint32_t kFramesMax = 12, kFramesOfMost = 6;
constexpr std::uint32_t kStepUnits = 4000;

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
    const EngineStatistics statistics = engine.statistics();
    for (const PoolStatistics* const pool : {&statistics.keyframes, &statistics.map_points}) {
        fuzz::expect(pool->size <= pool->high_water && pool->high_water <= pool->capacity, "pools keep their limits");
    }
    fuzz::expect(statistics.keyframes.capacity <= kSmallLimits.keyframes_max, "as many keyframes as the limits say");
    fuzz::expect(statistics.map_points.capacity <= kSmallLimits.map_points_max, "as many points as the limits say");
    fuzz::expect(statistics.arena_used_bytes == bytes_needed(kSmallLimits), "bytes_needed is what is used");
    const FrameStatistics& frame = engine.frame_statistics();
    fuzz::expect(frame.features <= kSmallLimits.features_max && frame.features_with_depth <= frame.features,
                 "features keep their limit");
    const TrackingView view = engine.tracking_view();
    fuzz::expect(view.features.size() <= kSmallLimits.features_max, "features keep their limit");
    for (const TrackedFeature& feature : view.features) {
        fuzz::expect(feature.x >= 0 && feature.x < static_cast<float>(camera.width) && feature.y >= 0 &&
                         feature.y < static_cast<float>(camera.height),
                     "features lie in the image");
        fuzz::expect(!(feature.is_static && feature.is_dynamic), "nothing is static and moves");
    }
}

enum class Refusal { kNever, kMay, kMust };

// Makes the frame wrong in one way.
Refusal spoil(Frame& frame, std::int64_t last_ns, fuzz::Bytes& bytes) {
    switch (bytes.u8() % fuzz::kWrongs) {
        case 0: frame.time_ns = last_ns; break;
        case 1: frame.time_ns = std::numeric_limits<std::int64_t>::min(); break;
        case 2: frame.colour.width -= 1; break;
        case 3: frame.depth.height -= 1; break;
        case 4: frame.colour.data = nullptr; break;
        case 5: frame.depth.data = nullptr; break;
        case 6: frame.depth_units_per_m = 0; break;
        case 7: frame.depth_units_per_m = std::numeric_limits<double>::quiet_NaN(); break;
        case 8: frame.depth_units_per_m = std::numeric_limits<double>::infinity(); return Refusal::kMay;
        case 9: frame.depth_units_per_m = 1e-300; return Refusal::kMay;
        case 10: frame.colour.stride = frame.colour.width * channels_of(frame.format) - 1; break;
        default: frame.depth_time_ns = static_cast<std::int64_t>(bytes.u64()); return Refusal::kMay;
    }
    return Refusal::kMust;
}

// One engine, its twin if there is one, and what they are shown.
class Run {
public:
    struct Side {
        Engine* engine;
        fuzz::MemoryStore* store;
    };
    // `twin`: without an engine if there is none.
    Run(const CameraModel& camera, bool is_stepping, Side side, Side twin)
        : camera_(camera),
          is_stepping_(is_stepping),
          engine_(*side.engine),
          twin_(twin.engine),
          stores_{side.store, twin.store} {}

    void act(fuzz::Bytes& bytes) {
        const std::uint8_t what = bytes.u8();
        if (what == fuzz::kActReset) {
            engine_.reset();
            if (twin_ != nullptr) twin_->reset();
            last_ns_ = -1;  // anew: any time will do
        } else if (what == fuzz::kActStep) {
            const std::uint16_t units = bytes.u16();
            if (units >= 0x8000) {
                step_store(units & 0x7fffU);
            } else {
                step(units);
            }
        } else if (what == fuzz::kActMap) {
            load_own_map(bytes.u8() % 2 == 0 ? MapUse::kContinue : MapUse::kLocalise);
        } else if (what == fuzz::kActHarm) {
            const std::size_t which = bytes.u8(), place = bytes.u16();
            const auto value = static_cast<std::byte>(bytes.u8());
            for (fuzz::MemoryStore* const store : stores_) {
                if (which % 8 == 7) {
                    store->claim(std::to_integer<std::uint64_t>(value) << (place % 57U));
                } else {
                    store->harm(which, place, value);
                }
            }
        } else {
            show(what, bytes);
        }
        expect_same();
    }

    [[nodiscard]] std::uint32_t frames() const { return frames_; }

private:
    void expect_same() {
        if (twin_ == nullptr) return;
        fuzz::expect(engine_.state_hash() == twin_->state_hash(), "the same bits, whatever the memory held before");
    }
    void step(std::uint32_t units) {
        const Progress progress = engine_.step(units);
        fuzz::expect(twin_ == nullptr || twin_->step(units) == progress, "the same progress for the same units");
    }
    void step_store(std::uint32_t units) {
        const Progress progress = engine_.step_store(units);
        fuzz::expect(twin_ == nullptr || twin_->step_store(units) == progress, "the same progress for the same units");
    }
    void load_own_map(MapUse use) {
        const std::vector<std::byte> file = fuzz::map_of(engine_);
        if (file.empty()) return;
        MapFileProblem problem;
        fuzz::expect(engine_.load_map(file, use, problem) == Status::kOk, "a map that was written is taken");
        // A store that says that it holds later names makes frames count on behind them.
        if (!stores_[0]->claims()) fuzz::expect(fuzz::map_of(engine_) == file, "and written back to the same bytes");
        if (twin_ != nullptr) {
            fuzz::expect(fuzz::map_of(*twin_) == file, "the same map, whatever the memory held before");
            fuzz::expect(twin_->load_map(file, use, problem) == Status::kOk, "the same status for the same map");
        }
        last_ns_ = -1;
    }
    void show(std::uint8_t what, fuzz::Bytes& bytes) {
        Frame frame;
        frame.format = what % 3 == 0 ? PixelFormat::kRgb8 : what % 3 == 1 ? PixelFormat::kBgr8 : PixelFormat::kGrey8;
        const std::uint32_t channels = channels_of(frame.format);
        fuzz::Picture<std::uint8_t> colour;
        fuzz::Picture<std::uint16_t> depth;
        if (fuzz::is_drawn(what)) {
            colour = fuzz::empty_picture<std::uint8_t>(camera_.width, camera_.height, channels);
            depth = fuzz::empty_picture<std::uint16_t>(camera_.width, camera_.height, 1);
            scene_.move(bytes);
            scene_.has_body = fuzz::has_body(what);
            scene_.draw(colour, depth, channels);
        } else {
            colour = fuzz::picture_from<std::uint8_t>(bytes, camera_.width, camera_.height, channels);
            depth = fuzz::picture_from<std::uint16_t>(bytes, camera_.width, camera_.height, 1);
        }
        frame.colour = colour.view;
        frame.depth = depth.view;
        const std::int64_t step_ns = what < 200 ? 33'000'000 : std::int64_t{1} << (what % 60);
        frame.time_ns = last_ns_ > std::numeric_limits<std::int64_t>::max() - step_ns ? last_ns_ : last_ns_ + step_ns;
        frame.depth_time_ns = frame.time_ns;
        const bool is_late = frame.time_ns <= last_ns_ || frame.time_ns >= std::int64_t{1} << 62U;
        const Refusal wrong = fuzz::is_wrong(what) ? spoil(frame, last_ns_, bytes) : Refusal::kNever;
        submit(frame, is_late ? Refusal::kMust : wrong);
        if (is_stepping_) step(kStepUnits);
    }
    void submit(const Frame& frame, Refusal refusal) {
        ++frames_;
        const std::uint64_t hash = engine_.state_hash(), refused = engine_.statistics().frames_refused;
        const Status status = engine_.submit(frame);
        fuzz::expect(twin_ == nullptr || twin_->submit(frame) == status, "the same status for the same frame");
        if (status == Status::kOk) {
            fuzz::expect(refusal != Refusal::kMust, "a wrong frame is refused");
            fuzz::expect(engine_.pose().time_ns == frame.time_ns, "the pose is for this frame");
            last_ns_ = frame.time_ns;
        } else {
            fuzz::expect(status == Status::kInvalid && refusal != Refusal::kNever, "a right frame is accepted");
            fuzz::expect(engine_.state_hash() == hash, "a refused frame changes nothing");
            fuzz::expect(engine_.statistics().frames_refused == refused + 1, "refused frames are counted");
        }
        expect_pose(engine_.pose());
        expect_limits(engine_, camera_);
#ifdef STILLMESH_CANARY
        canary_.note(engine_.statistics());
#endif
    }

    CameraModel camera_;
    bool is_stepping_;
    Engine& engine_;
    Engine* twin_;
    fuzz::MemoryStore* stores_[2];
    fuzz::Scene scene_;
    std::int64_t last_ns_ = -1;
    std::uint32_t frames_ = 0;  // shown
#ifdef STILLMESH_CANARY
    fuzz::KeyframeList canary_;
#endif
};

// What is checked of this input beside one engine.
struct Share {
    bool has_twin = true;  // of one in eight, which may have more frames as well
    bool is_plain = true;  // and the twin has plain kernels: of one in 64; they are slow under a fuzzer's instruments
};
Share share_of(std::span<const std::uint8_t> input) {
#ifdef STILLMESH_LIBFUZZER
    const std::uint32_t checksum = crc32(std::as_bytes(input));
    return {checksum % 8 == 0, checksum % 64 == 0};
#else
    static_cast<void>(input);
    return {};
#endif
}

}  // namespace

#ifdef STILLMESH_LIBFUZZER
#include "fuzz/mutator.hpp"
STILLMESH_FUZZ_BY((stillmesh::fuzz::Grammar{stillmesh::fuzz::engine_piece_bytes, stillmesh::fuzz::engine_head,
                                            stillmesh::fuzz::engine_acts}))
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    static const std::vector<std::byte> vocabulary = test::vocabulary_bytes({6, 3, 20, 1});
    static const fuzz::Block block(bytes_needed(kSmallLimits)), twin_block(bytes_needed(kSmallLimits));
    static fuzz::MemoryStore store, twin_store;
    store.clear();
    twin_store.clear();

    fuzz::Bytes bytes({data, size_bytes});
    const Configuration configuration = fuzz::configuration_from(bytes);
    const std::uint8_t how = bytes.u8();
    const CameraModel camera = fuzz::camera_from(bytes, how);
    const auto make = [&](std::span<std::byte> memory, const Kernels& kernels, MapStore& its_store) {
        return Engine::create(memory, kSmallLimits, configuration, camera, kernels, nullptr,
                              fuzz::has_words(how) ? std::span(vocabulary) : std::span<const std::byte>(),
                              fuzz::has_store(how) ? &its_store : nullptr);
    };
    const auto made = make(block.filled(0), cpu_kernels(), store);
    Engine* twin = nullptr;
    const Share share = share_of({data, size_bytes});
    if (share.has_twin) {
        const auto twin_made =
            make(twin_block.filled(0xa5), share.is_plain ? plain_kernels() : cpu_kernels(), twin_store);
        fuzz::expect(made.status() == twin_made.status(), "the same status from the same arguments");
        if (twin_made.is_ok()) twin = twin_made.value();
    }
    if (validate(configuration, kSmallLimits).key != nullptr) {
        fuzz::expect(made.status() == Status::kInvalid, "a configuration that validate() refuses is kInvalid");
    } else if (!fuzz::is_camera_any(how)) {
        fuzz::expect(made.is_ok(), "what is right is accepted");
    }
    if (!made.is_ok()) {
        fuzz::expect(made.status() == Status::kInvalid, "create says kInvalid when the block is large enough");
        return 0;
    }
    Run run(camera, fuzz::is_stepping(how), {made.value(), &store}, {twin, &twin_store});
    const std::uint32_t frames_max = twin != nullptr ? kFramesMax : kFramesOfMost;
    for (std::uint32_t acts = 0; acts < kActsMax && run.frames() < frames_max && !bytes.is_empty(); ++acts) {
        run.act(bytes);
    }
    return 0;
}
