#include "engine/engine.hpp"

#include "engine/base/arena.hpp"
#include "engine/engine_state.hpp"
#include "engine/frame/pyramid.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/map/map_readout.hpp"
#include "engine/record/map_load.hpp"
#include "engine/static_bytes_needed.hpp"
#include "engine/tuned_engine.hpp"

namespace stillmesh {
namespace {

// The promises of the presets.
static_assert(static_bytes_needed(Limits::room()) <= std::size_t{48} << 20U);
static_assert(static_bytes_needed(Limits::pocket()) <= std::size_t{8} << 20U);
static_assert(static_bytes_needed(Limits::tiny()) <= std::size_t{512} << 10U);

// So that no difference of times overflows.
constexpr std::int64_t kTimeMax_ns = (std::int64_t{1} << 62U) - 1;

EngineState& state_of(Engine* engine) noexcept {
    return *static_cast<EngineState*>(engine);
}
const EngineState& state_of(const Engine* engine) noexcept {
    return *static_cast<const EngineState*>(engine);
}

// None, or one of colour's size.
bool is_mask_valid(const Frame& frame) noexcept {
    const ImageView<std::uint8_t>& mask = frame.mask;
    return mask.data == nullptr ||
           (mask.width == frame.colour.width && mask.height == frame.colour.height && mask.stride >= mask.width);
}

bool has_store(const EngineState& state) noexcept {
    return !state.pager.empty() && state.pager[0].is_on();
}

// Regions that are there already: the camera has to be found among them first.
void begin_in_store(EngineState& state) noexcept {
    if (!has_store(state)) return;
    const StoreContent content = state.pager[0].content();
    if (content.regions > 0) state.tracking.begin_in_map(content.ids_end, content.time_ns, false);
}

// The first parameter out of its range. `visit` is visit_parameters or visit_limits, bound to its object.
template <typename Visit>
ConfigurationProblem out_of_range(Visit&& visit) noexcept {
    ConfigurationProblem problem;
    visit([&](const char* name, const auto& value, double min, double max, const char*, const char*) {
        const auto number = static_cast<double>(value);
        if (problem.key == nullptr && !(number >= min && number <= max)) {
            problem = {name, "is out of its range", number, min, max};
        }
    });
    return problem;
}

}  // namespace

std::size_t bytes_needed(const Limits& limits) noexcept {
    return static_bytes_needed(limits);
}

ConfigurationProblem validate(const Limits& limits) noexcept {
    Limits copy = limits;
    ConfigurationProblem problem = out_of_range([&copy](auto&& visitor) { visit_limits(copy, visitor); });
    if (problem.key == nullptr && limits.map_points_max < limits.features_max) {
        problem = {"limits.map_points_max", "is below limits.features_max", static_cast<double>(limits.map_points_max),
                   static_cast<double>(limits.features_max), 16777215.0};
    }
    return problem;
}

ConfigurationProblem validate(const CameraModel& camera, const Limits& limits) noexcept {
    constexpr const char* kSize = "is no size of an image that corners fit into and that the limits hold";
    const double width = camera.width, height = camera.height, min = kLevelSideMin;
    const double width_max = limits.image_width_max, height_max = limits.image_height_max;
    if (width < min || width > width_max) return {"camera.width", kSize, width, min, width_max};
    if (height < min || height > height_max) return {"camera.height", kSize, height, min, height_max};
    if (!(camera.fx > 0)) return {"camera.fx", "is no focal length in pixels", camera.fx, 1, 1e6};
    if (!(camera.fy > 0)) return {"camera.fy", "is no focal length in pixels", camera.fy, 1, 1e6};
    if (validate(camera) == Status::kOk) return {};
    return {"camera.lens", "has numbers that are none or not of its kind, or folds the image over",
            static_cast<double>(camera.lens), 0, 1};
}

ConfigurationProblem validate(std::span<const std::byte> block, const Limits& limits) noexcept {
    const auto past = reinterpret_cast<std::uintptr_t>(block.data()) % kArenaAlignment;
    if (past != 0) return {"block.address", "is not aligned: so many bytes past 64", static_cast<double>(past), 0, 0};
    const auto size = static_cast<double>(block.size()), needed = static_cast<double>(static_bytes_needed(limits));
    if (size < needed) return {"block.bytes", "is less than bytes_needed(limits)", size, needed, needed};
    return {};
}

ConfigurationProblem validate(const Configuration& configuration, const Limits& limits) noexcept {
    return validate(Parameters(configuration), limits);
}

ConfigurationProblem validate(const Parameters& parameters, const Limits& limits) noexcept {
    Parameters p = parameters;
    const ConfigurationProblem problem = out_of_range([&p](auto&& visitor) { visit_all_parameters(p, visitor); });
    if (problem.key != nullptr) return problem;
    // What the keys ask of each other: the range is what is left of the key's own.
    struct Rule {
        const char* key;
        const char* sentence;
        double value, min, max;
    };
    const Rule rules[] = {
        {"features.count", "is more than limits.features_max", static_cast<double>(p.features.count), 50.0,
         static_cast<double>(limits.features_max)},
        {"features.levels", "is more than limits.pyramid_levels_max", static_cast<double>(p.features.levels), 1.0,
         static_cast<double>(limits.pyramid_levels_max)},
        {"features.fast_threshold_low", "is above features.fast_threshold",
         static_cast<double>(p.features.fast_threshold_low), 1.0, static_cast<double>(p.features.fast_threshold)},
        {"matching.radius_wide_px", "is below matching.radius_px", p.matching.radius_wide_px, p.matching.radius_px,
         400.0},
        {"pose.inlier_ratio_min", "is above pose.inlier_ratio_start", p.pose.inlier_ratio_min, 0.05,
         p.pose.inlier_ratio_start},
        {"mapping.window_keyframes", "is more than limits.keyframes_max",
         static_cast<double>(p.mapping.window_keyframes), 2.0, static_cast<double>(limits.keyframes_max)},
        {"weights.max", "is below weights.suspicious", static_cast<double>(p.weights.max),
         static_cast<double>(p.weights.suspicious), 255.0},
        {"weights.eligible", "is above weights.max", static_cast<double>(p.weights.eligible), 0.0,
         static_cast<double>(p.weights.max)},
        {"noise.max", "is below noise.pixel_start or noise.depth_start", p.noise.max,
         std::max(p.noise.pixel_start, p.noise.depth_start), 1000.0},
        {"weights.drift_m", "is above weights.drift_max_m", p.weights.drift_m, 0.0, p.weights.drift_max_m},
    };
    for (const auto& [key, sentence, value, min, max] : rules) {
        if (value < min || value > max) return {key, sentence, value, min, max};
    }
    if (p.depth.z_min_m >= p.depth.z_max_m) {
        return {"depth.z_min_m", "is not below depth.z_max_m", p.depth.z_min_m, 0.05, p.depth.z_max_m};
    }
    return {};
}

Result<Engine*> Engine::create(std::span<std::byte> block, const Limits& limits, const Configuration& configuration,
                               const CameraModel& camera, const Kernels& kernels, FeatureExtractor* extractor,
                               std::span<const std::byte> vocabulary, MapStore* store) noexcept {
    return create_engine(block, limits, Parameters(configuration), camera, {kernels, extractor, vocabulary, store});
}

Result<Engine*> create_engine(std::span<std::byte> block, const Limits& limits, const Parameters& parameters,
                              const CameraModel& given, const EngineParts& parts) noexcept {
    const CameraModel camera = given.with_plain_zeros();
    if (validate(limits).key != nullptr || validate(parameters, limits).key != nullptr) return Status::kInvalid;
    if (validate(camera, limits).key != nullptr) return Status::kInvalid;
    if (parts.store != nullptr && limits.store_features_max == 0) return Status::kInvalid;
    if (reinterpret_cast<std::uintptr_t>(block.data()) % kArenaAlignment != 0) return Status::kInvalid;
    if (block.size() < static_bytes_needed(limits)) return Status::kFull;
    Vocabulary opened;
    const char* sentence = nullptr;
    if (!parts.vocabulary.empty() &&
        opened.open(parts.vocabulary, limits.vocabulary_words_max, sentence) != Status::kOk) {
        return Status::kCorrupt;
    }
    Arena arena(block);
    EngineState& state = arena.array<EngineState>(1)[0];
    state.vocabulary = opened;
    state.map_origin = {camera, parameters.features.levels, parameters.features.scale_factor};
    World& world = state.world;
    world.create(arena, limits, parameters, camera);
    state.places.create(arena, limits, world.parameters, camera, state.vocabulary);
    state.relocalisation.create(arena, limits, world.parameters, state.places);
    state.tracking.create(arena, world, parts.kernels, parts.extractor,
                          state.relocalisation.is_on() ? &state.relocalisation : nullptr);
    state.mapping.create(arena, world);
    state.loop_closing.create(arena, world, state.places, state.mapping.fusion());
    state.refinement.create(arena, world);
    if (limits.store_features_max > 0) {
        state.pager = arena.array<MapPager>(1);
        state.pager[0].create(arena, world, state.places, parts.store);
    }
    state.scheduler.create(parameters.schedule.slice_units);
    // First: what it does in a while is bounded by its parameters.
    if (has_store(state)) state.scheduler.add(state.pager[0]);
    if (parameters.mapping.is_enabled) state.scheduler.add(state.mapping);
    if (state.places.is_on()) {
        state.scheduler.add(state.loop_closing);
        state.scheduler.add_behind(state.refinement);
    }
    arena.seal();
    state.arena_used_bytes = arena.used_bytes();
    STILLMESH_CHECK(state.arena_used_bytes == static_bytes_needed(limits));
    begin_in_store(state);
    return static_cast<Engine*>(&state);
}

Status Engine::start_at(const RigidTransform& map_from_camera) noexcept {
    EngineState& state = state_of(this);
    if (state.has_time || !is_pose(map_from_camera)) return Status::kInvalid;
    return state.tracking.start_at(pose_of(map_from_camera)) ? Status::kOk : Status::kInvalid;
}

Status Engine::submit(const Frame& frame, const MotionHint* hint) noexcept {
    EngineState& state = state_of(this);
    const std::uint32_t channels = channels_of(frame.format);
    const bool is_known =
        frame.format == PixelFormat::kGrey8 || frame.format == PixelFormat::kRgb8 || frame.format == PixelFormat::kBgr8;
    const bool is_valid =
        is_known && frame.colour.data != nullptr && frame.depth.data != nullptr &&
        frame.colour.width == state.world.camera.width && frame.colour.height == state.world.camera.height &&
        frame.depth.width == state.world.camera.width && frame.depth.height == state.world.camera.height &&
        frame.colour.stride >= static_cast<std::size_t>(frame.colour.width) * channels &&
        frame.depth.stride >= frame.depth.width && frame.depth_units_per_m > 0.0 && frame.depth_units_per_m < 1e9 &&
        frame.time_ns >= 0 && frame.time_ns <= kTimeMax_ns && (!state.has_time || frame.time_ns > state.last_time_ns) &&
        is_mask_valid(frame) && (hint == nullptr || stillmesh::is_valid(*hint));
    if (!is_valid) {
        ++state.world.statistics.frames_refused;
        return Status::kInvalid;
    }
    state.has_time = true;
    state.last_time_ns = frame.time_ns;
    state.tracking.track(frame, hint);
    return Status::kOk;
}

Progress Engine::step(std::uint32_t units) noexcept {
    return state_of(this).scheduler.step(units);
}

const PoseEstimate& Engine::pose() const noexcept {
    return state_of(this).world.pose;
}
const FrameStatistics& Engine::frame_statistics() const noexcept {
    return state_of(this).tracking.frame_statistics();
}
EngineStatistics Engine::statistics() const noexcept {
    const EngineState& state = state_of(this);
    EngineStatistics out = state.world.all_statistics();
    state.relocalisation.fill(out.loop);
    out.schedule = state.scheduler.statistics();
    out.arena_used_bytes = state.arena_used_bytes;
    return out;
}
TrackingView Engine::tracking_view() noexcept {
    return state_of(this).tracking.view();
}
const FeatureSet& Engine::features() const noexcept {
    return state_of(this).tracking.features();
}
std::uint32_t Engine::keyframes(std::span<KeyframePose> out) const noexcept {
    return list_keyframes(state_of(this).world.map, out);
}
std::uint32_t Engine::keyframe_links(std::span<KeyframeLink> out, std::uint32_t of_each) const noexcept {
    const EngineState& state = state_of(this);
    const std::uint32_t loops = state.loop_closing.list_loops(out);
    return loops + list_covisible(state.world.map, of_each, out.subspan(loops));
}
DepthImage Engine::depth_image(std::uint32_t index) const noexcept {
    const World& world = state_of(this).world;
    return world.depth_images.at(index, world.map.keyframes());
}
std::uint64_t Engine::reference_keyframe() const noexcept {
    return state_of(this).tracking.reference_keyframe();
}
std::uint64_t Engine::state_hash() const noexcept {
    const EngineState& state = state_of(this);
    StateHash hash;
    hash.add(state.tracking.state_hash());
    state.scheduler.add_to(hash);
    hash.add(state.world.map.changes_hash());
    if (has_store(state)) hash.add(state.pager[0].state_hash());
    return hash.value();
}
Status Engine::begin_map_copy(std::span<std::byte> workspace, std::uint8_t extractor) noexcept {
    EngineState& state = state_of(this);
    state.map_copy.cancel();
    if (state.world.map.keyframes().size() == 0) return Status::kNotFound;
    MapOrigin origin = state.map_origin;
    origin.extractor = extractor;
    return state.map_copy.begin(workspace, state.world.limits, origin);
}
Progress Engine::step_map_copy(std::uint32_t units) noexcept {
    EngineState& state = state_of(this);
    WorkBudget budget(units);
    return state.map_copy.step(state.world.map, state.world.depth_images,
                               {state.world.clock.frame, state.world.clock.time_ns}, budget);
}
Status Engine::load_map(std::span<const std::byte> file, MapUse use, MapFileProblem& problem,
                        std::uint8_t extractor) noexcept {
    EngineState& state = state_of(this);
    MapOrigin origin = state.map_origin;
    origin.extractor = extractor;
    MapFileInfo info;
    STILLMESH_TRY(check_map_file(file, state.world.limits, origin, state.world.map, info, problem));
    reset();
    restore_map(file, info, state.world.map);
    restore_depth_images(file, info, state.world.map, state.world.depth_images);
    // Regions kept after the map was saved have later names.
    const StoreContent content = has_store(state) ? state.pager[0].content() : StoreContent{};
    state.tracking.begin_in_map(std::max(info.frames, content.ids_end), std::max(info.time_ns, content.time_ns),
                                use == MapUse::kLocalise);
    return Status::kOk;
}
void Engine::set_map_use(MapUse use) noexcept {
    state_of(this).world.is_frozen = use == MapUse::kLocalise;
}
Progress Engine::step_store(std::uint32_t units) noexcept {
    EngineState& state = state_of(this);
    if (!has_store(state)) return Progress::kIdle;
    WorkBudget budget(units);
    return state.pager[0].keep_all(budget);
}
void Engine::set_stage_observer(StageObserver observer) noexcept {
    state_of(this).tracking.set_observer(observer);
}
void Engine::reset() noexcept {
    EngineState& state = state_of(this);
    state.has_time = false;
    state.world.reset();
    state.tracking.reset();
    state.mapping.reset();
    state.places.reset();
    state.loop_closing.reset();
    state.refinement.reset();
    state.relocalisation.reset();
    state.scheduler.reset();
    state.map_copy.cancel();
    if (!state.pager.empty()) state.pager[0].reset();
    begin_in_store(state);
}

}  // namespace stillmesh
