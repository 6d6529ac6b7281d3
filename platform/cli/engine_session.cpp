#include "platform/cli/engine_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/engine.hpp"
#include "hal/calibration/toml_document.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/configuration_file.hpp"
#include "platform/cli/place_probe.hpp"
#include "platform/evaluation/final_trajectory.hpp"
#include "platform/library/step_pacer.hpp"
#include "platform/library/transform.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "platform/record/map_saver.hpp"
#include "platform/record/recording_writer.hpp"
#include "platform/store/session_store.hpp"
#include "platform/view/view_snapshot.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#ifdef STILLMESH_HAS_OPENCV
#include "platform/opencv/orb_adapter.hpp"
#endif

namespace stillmesh {
namespace {

constexpr std::size_t kConfigurationBytesMax = 64 * 1024;
constexpr std::uint32_t kSideMax = 2047;  // px, of limits.image_width_max and _height_max

[[nodiscard]] Limits limits_of(const std::string& name) {
    return name == "pocket" ? Limits::pocket() : Limits::room();
}

[[nodiscard]] TrajectoryPose pose_of(const RigidTransform& transform, std::int64_t time_ns) {
    TrajectoryPose out;
    out.time_ns = time_ns;
    std::copy_n(transform.translation_m, 3, out.t.begin());
    std::copy_n(transform.rotation_xyzw, 4, out.q.begin());
    return out;
}

[[nodiscard]] std::uint16_t count16(std::uint32_t count) {
    return static_cast<std::uint16_t>(std::min<std::uint32_t>(count, 65535));
}

[[nodiscard]] GravityRecord gravity_record(const Gravity& gravity) {
    GravityRecord out;
    out.is_asked = true;
    out.is_known = gravity.is_known;
    out.up = gravity.up;
    out.doubt_degrees = gravity.doubt_rad * 57.295779513082323;
    out.seconds = gravity.seconds;
    out.why_not = gravity.why_not;
    return out;
}

class EngineSession final : public TrackingSession {
public:
    // kOk, kInvalid, kUnavailable: `message` says why.
    [[nodiscard]] Status create(const SessionOptions& options, const CameraInfo& camera, std::string& message) {
        Configuration& configuration = configuration_;
        STILLMESH_TRY(session_configuration(options, camera, limits_, configuration, message));
        note_ = message;
        camera_ = camera.model;
        extractor_number_ = options.features == "opencv" ? 1 : 0;
        map_every_ns_ = static_cast<std::int64_t>(options.map_every_s * 1e9);
        FeatureExtractor* extractor = nullptr;
        if (options.features == "opencv") {
#ifdef STILLMESH_HAS_OPENCV
            extractor_ = std::make_unique<CvOrbExtractor>(static_cast<int>(configuration.features.count),
                                                          configuration.features.scale_factor,
                                                          static_cast<int>(configuration.features.levels));
            extractor = extractor_.get();
#else
            message = "--features opencv is not in this build; configure it with -DSTILLMESH_WITH_OPENCV=ON.";
            return Status::kUnavailable;
#endif
        }
        if (!vocabulary_.open(options.vocabulary, limits_.vocabulary_words_max, message)) return Status::kInvalid;
        has_vocabulary_ = configuration.loop.is_enabled && !vocabulary_.bytes().empty();
        const std::size_t size_bytes = bytes_needed(limits_);
        if (!check_size(options, size_bytes, message)) return Status::kInvalid;
        if (!block_.allocate(size_bytes)) {
            message = fmt::format("the system has no {:.1f} MiB of memory left for the engine; try --limits pocket.",
                                  static_cast<double>(size_bytes) / (1024.0 * 1024.0));
            return Status::kUnavailable;
        }
        if (!options.map_store.empty() &&
            !open_store(options, configuration, camera.model, extractor_number_, message)) {
            return Status::kUnavailable;
        }
        const Result<Engine*> engine =
            Engine::create(block_.bytes(), limits_, configuration, camera.model, cpu_kernels(), extractor,
                           vocabulary_.bytes(), store_.is_open() ? &store_ : nullptr);
        if (!engine.is_ok()) {
            message = fmt::format(
                "the engine refuses this camera ({}x{} pixels, fx {}, fy {}, cx {}, cy {}): its size must be at least "
                "33x33 and at most {}x{}, and its distortion must not fold over inside the image; check the camera "
                "file.",
                camera.model.width, camera.model.height, camera.model.fx, camera.model.fy, camera.model.cx,
                camera.model.cy, limits_.image_width_max, limits_.image_height_max);
            return Status::kInvalid;
        }
        engine_ = engine.value();
        if (options.start && engine_->start_at(*options.start) != Status::kOk) {
            message = "--start-pose: is farther than a map reaches, 1000 m, or the map store holds places already.";
            return Status::kInvalid;
        }
        if (!options.map_in.empty()) {
            const MapUse use = options.is_localising ? MapUse::kLocalise : MapUse::kContinue;
            const std::int64_t begin_ns = monotonic_ns();
            const Status loaded =
                load_map_file(options.map_in, *engine_, use, extractor_number_, map_in_info_, message);
            if (loaded != Status::kOk) {
                // A disk that fails, or a right that is missing, says nothing about the map: it stays where it is.
                if (!options.is_map_own || loaded == Status::kUnavailable) return Status::kInvalid;
                not_gone_on_in_ = std::exchange(message, {});
                kept_aside_ = options.map_in;
            } else {
                map_in_ = options.map_in;
            }
            map_load_s_ = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
            is_localising_ = options.is_localising;
        }
        if (!options.map_out.empty() &&
            !map_saver_->open(options.map_out, limits_, extractor_number_, map_every_ns_, message)) {
            return Status::kUnavailable;
        }
        map_out_ = map_files_begin_ = options.map_out;
        if (!grid_.open(options.grid, limits_, map_every_ns_, message)) return Status::kInvalid;
        units_per_frame_ = configuration.schedule.units_per_frame;
        slice_units_ = configuration.schedule.slice_units;
        pacer_ = StepPacer(slice_units_);
        can_wait_ = options.can_wait;
        motion_ = options.motion;
        accelerations_ = options.accelerations;
        gravity_.begin(accelerations_);
        grid_.set_gravity(&gravity_);
        if (!options.record.empty()) {
            recording_ = options.record;
            writer_ = std::make_unique<RecordingWriter>();
            if (!writer_->open(recording_,
                               {limits_, configuration, camera.model, camera.depth_units_per_m, extractor_number_,
                                vocabulary_.crc(), store_.counts().regions, store_.sequence(), store_.checksum(),
                                options.motion != nullptr},
                               message)) {
                return Status::kUnavailable;
            }
        }
        engine_->set_stage_observer({on_stage, this});
        for (std::uint32_t i = 0; i < kStages; ++i) stages_[i].name = stage_name(static_cast<Stage>(i));
        return Status::kOk;
    }

    bool begin(std::string& message) override {
        return not_gone_on_in_.empty() || keep_aside(kept_aside_, not_gone_on_in_, message);
    }

    bool show_points(MapPoints* points, std::string& message) override {
        points_ = points;
        return points == nullptr || points->open(limits_, message);
    }

    void show_grid(GridShelf* shelf) override {
        grid_.show_on(shelf);
    }

    // Calls no heap unless the frame is refused.
    Status submit(const Frame& frame, SessionFrame& out, std::string& message) override {
        spent_ns_ = {};
        std::optional<MotionHint> hint;
        if (motion_ != nullptr && last_frame_ns_ >= 0 && frame.time_ns > last_frame_ns_)
            hint = motion_->between_times(last_frame_ns_, frame.time_ns);
        recorded_.has_hint = hint.has_value();
        if (hint) recorded_.hint = *hint;
        const Status status = engine_->submit(frame, hint ? &*hint : nullptr);
        if (status == Status::kOk) {
            last_frame_ns_ = frame.time_ns;
            hinted_frames_ += hint ? 1U : 0U;
        }
        if (writer_ != nullptr) note_decisions(frame, status);
        if (status != Status::kOk) {
            message =
                "its size, format or depth factor is not the camera's, or its time is not after the last frame's.";
            if (writer_ != nullptr) record_frame();
            return status;
        }
        for (std::size_t i = 0; i < kStages; ++i) {
            if (spent_ns_[i] > 0) stages_[i].ms.add(static_cast<double>(spent_ns_[i]) * 1e-6);
        }
        const PoseEstimate& pose = engine_->pose();
        const FrameStatistics& statistics = engine_->frame_statistics();
        out.state = pose.state;
        out.world_from_camera = pose_of(map_from_camera(pose), pose.time_ns);
        if (pose.state >= PoseState::kUnsure) {
            const double* const q = pose.map_from_odom.rotation_xyzw;
            gravity_.add(pose_of(pose.odom_from_camera, pose.time_ns), {q[0], q[1], q[2], q[3]});
        } else {
            gravity_.add_nothing();
        }
        if (keeps_final_ && pose.state != PoseState::kNone) {
            note_keyframes();
            final_.add(out.world_from_camera, engine_->reference_keyframe());
            if (statistics.strayed_since_ns != kNoTime) final_.straighten(statistics.strayed_since_ns);
        }
        out.features = count16(statistics.features);
        out.static_features = count16(statistics.static_matches);
        out.dynamic_features = count16(statistics.dynamic_matches);
        out.unsure = statistics.unsure;
        out.estimate = pose;
        out.statistics = statistics;
        out.keyframe = engine_->reference_keyframe();
        out.state_hash = engine_->state_hash();
        return Status::kOk;
    }

    // In slices, each timed, whoever says how many there are: the configuration, or the time until the next frame.
    void work(std::optional<std::int64_t> until_ns, SessionFrame& out) override {
        const std::int64_t begin_ns = monotonic_ns();
        std::int64_t now_ns = begin_ns;
        std::uint64_t spent = engine_->statistics().schedule.units_spent;
        if (store_.is_open()) {
            const StoreEvents events = store_.begin_frame();
            recorded_.has_store = true;
            recorded_.store_answered = events.answered;
            recorded_.is_store_accepting = events.is_accepting;
        }
        std::uint32_t left = units_per_frame_;
        for (std::uint32_t calls = 0;; ++calls) {
            const std::uint32_t units =
                until_ns ? pacer_.next_grant(now_ns, *until_ns, calls) : std::min(left, slice_units_);
            if (units == 0 || !recorded_.add_grant(units)) break;
            const Progress progress = engine_->step(units);
            left -= std::min(left, units);
            const std::int64_t end_ns = monotonic_ns();
            const std::uint64_t spent_now = engine_->statistics().schedule.units_spent;
            if (spent_now > spent) {
                slice_ms_.add(static_cast<double>(end_ns - now_ns) * 1e-6);
                pacer_.measured(spent_now - spent, end_ns - now_ns);
            }
            spent = spent_now;
            now_ns = end_ns;
            if (progress == Progress::kIdle) break;
        }
        out.background_ns = now_ns - begin_ns;
        background_ms_.add(static_cast<double>(out.background_ns) * 1e-6);
        const bool is_shown = points_ != nullptr && points_->is_copying();
        if (map_saver_->is_open() && !is_shown) map_saver_->work(*engine_, now_ns, slice_units_);
        grid_.work(*engine_, now_ns, until_ns);
        if (points_ != nullptr) points_->work(*engine_, !map_saver_->is_copying(), slice_units_);
        out.state_hash = recorded_.hash = engine_->state_hash();
        if (writer_ != nullptr) {
            record_frame();
            record_ms_.add(static_cast<double>(monotonic_ns() - now_ns) * 1e-6);
            if (can_wait_) writer_->wait_for_room(std::chrono::seconds(10));
        }
        recorded_.grant_runs = 0;
    }

    void keep_final_trajectory() override {
        keeps_final_ = true;
        keyframes_.resize(limits_.keyframes_max);
        keyframes_now_.reserve(limits_.keyframes_max);
    }
    std::optional<Trajectory> final_trajectory() override {
        note_keyframes();
        Trajectory all = final_of_maps_before_;
        const Trajectory last = final_.finish();
        all.insert(all.end(), last.begin(), last.end());
        return all;
    }

    std::optional<bool> could_begin_here(const Frame& frame) override {
        return probe_.frame(camera_, configuration_, frame);
    }
    void is_found_again() override {
        probe_.forget();
    }
    std::string begin_new_map() override {
        if (engine_->statistics().keyframes.size == 0) return {};
        const EngineStatistics statistics = engine_->statistics();
        of_maps_before_.keyframes_made += statistics.keyframes_made;
        of_maps_before_.keyframes_forgotten += statistics.keyframes_forgotten;
        of_maps_before_.points_forgotten += statistics.points_forgotten;
        of_maps_before_.recoveries += statistics.recoveries;
        of_maps_before_.keyframes_refused += statistics.keyframes_refused;
        if (keeps_final_) {
            final_of_maps_before_ = *final_trajectory();
            final_ = FinalTrajectory();
        }
        std::string sentence = "a new map begins here";
        if (map_saver_->is_open()) {
            finish_map();
            const std::string before = map_out_;
            map_out_ = free_name(map_files_begin_);
            std::string message;
            map_saver_ = std::make_unique<MapSaver>();
            if (map_saver_->open(map_out_, limits_, extractor_number_, map_every_ns_, message)) {
                sentence += ", to be written to " + map_out_ + "; the one before is " + before;
            } else {
                map_problems_.push_back(message);
            }
        }
        grid_.begin_new_map(*engine_);
        gravity_.begin(accelerations_);
        engine_->reset();
        return sentence;
    }

    std::string save_map() override {
        const std::string grid = grid_.save_soon();
        if (!map_saver_->is_open() && !grid.empty()) return grid;
        if (!map_saver_->is_open()) return "the map is not saved, since there is no --map-out to write it to";
        if (engine_->statistics().keyframes.size == 0) return "the map is not saved, since there is none yet";
        map_saver_->save_soon();
        return "the map is saved to " + map_out_ + (grid.empty() ? "" : ", " + grid);
    }
    [[nodiscard]] ViewDownloads::Files files() const override {
        const std::string& grid = grid_.grid_name();
        return {map_saver_->is_open() ? map_out_ : "", grid.empty() ? "" : grid + ".yaml",
                grid.empty() ? "" : grid + ".pgm", grid_.cloud_file()};
    }
    std::string localise_only(bool is_wanted) override {
        if (writer_ != nullptr || store_.is_open()) {
            return std::string("the map is used as before, for the sake of ") +
                   (writer_ != nullptr ? "--record" : "--map-store");
        }
        engine_->set_map_use(is_wanted ? MapUse::kLocalise : MapUse::kContinue);
        return is_wanted ? "from here on the map stays as it is" : "from here on the map is added to";
    }

    std::string news() override {
        if (std::string sentence = map_saver_->take_news(monotonic_ns()); !sentence.empty()) return sentence;
        if (std::string sentence = grid_.take_news(); !sentence.empty()) return sentence;
        // These two have ended with their first failure, and are said once.
        if (writer_ != nullptr && !is_recording_lost_ && writer_->has_failed()) {
            is_recording_lost_ = true;
            return recording_ + ": cannot be written; the run goes on without this recording.";
        }
        if (store_.is_open() && !is_store_lost_ && store_.has_failed()) {
            is_store_lost_ = true;
            return map_store_ + ": the map store failed; places that memory has no room for are forgotten from now on.";
        }
        return {};
    }

    void rescue() override {
        if (map_saver_->is_open()) map_saver_->rescue(*engine_);
    }

    [[nodiscard]] const FeatureSet* features() const override {
        return &engine_->features();
    }

    bool look(SessionLook& look, std::span<KeyframePose> keyframes, std::span<KeyframeLink> links) override {
        look.tracking = engine_->tracking_view();
        for (std::size_t i = 0; i < kStages; ++i) look.stage_ms[i] = static_cast<float>(spent_ns_[i]) * 1e-6F;
        const EngineStatistics statistics = engine_->statistics();
        look.keyframes = statistics.keyframes;
        look.map_points = statistics.map_points;
        look.keyframe_queue = statistics.keyframe_queue;
        look.keyframes_written = keyframes.empty() ? 0 : engine_->keyframes(keyframes);
        look.links_written = links.empty() ? 0 : engine_->keyframe_links(links, kViewLinksOfEach);
        return true;
    }

    void account(RunRecord& record) override {
        const EngineStatistics statistics = engine_->statistics();
        if (motion_ != nullptr) {
            record.notes.push_back(fmt::format(
                "{}: a motion for {} of {} frames{}.", motion_->sources(), hinted_frames_, record.frames_total,
                hinted_frames_ == 0 ? "; are its times those of the frames' clock, in seconds?" : ""));
        }
        record.stages.assign(stages_.begin(), stages_.end());
        record.pools = {{"keyframes", statistics.keyframes.high_water, statistics.keyframes.capacity},
                        {"map points", statistics.map_points.high_water, statistics.map_points.capacity}};
        record.block_bytes = block_.bytes().size();
        record.arena_used_bytes = statistics.arena_used_bytes;
        record.keyframes_made = of_maps_before_.keyframes_made + statistics.keyframes_made;
        record.keyframes_forgotten = of_maps_before_.keyframes_forgotten + statistics.keyframes_forgotten;
        record.points_forgotten = of_maps_before_.points_forgotten + statistics.points_forgotten;
        record.recoveries = of_maps_before_.recoveries + statistics.recoveries;
        record.has_vocabulary = has_vocabulary_;
        record.loops = statistics.loop;
        close_store(record);
        record.keyframes_refused = of_maps_before_.keyframes_refused + statistics.keyframes_refused;
        record.keyframe_queue = statistics.keyframe_queue;
        record.schedule = statistics.schedule;
        record.background_ms = background_ms_;
        record.slice_ms = slice_ms_;
        if (!note_.empty()) record.notes.push_back(note_);
        if (!map_in_.empty()) {
            record.maps.push_back(
                map_record(map_in_, map_in_info_, map_load_s_, is_localising_ ? "localised in" : "read"));
        }
        grid_.finish(*engine_, record);
        if (accelerations_ != nullptr) record.gravity = gravity_record(gravity_.gravity());
        finish_map();
        record.maps.insert(record.maps.end(), maps_written_.begin(), maps_written_.end());
        record.problems.insert(record.problems.end(), map_problems_.begin(), map_problems_.end());
        if (writer_ != nullptr) {
            if (const std::string problem = writer_->close(); !problem.empty()) record.problems.push_back(problem);
            record.recording = recording_;
            record.record_ms = record_ms_;
            record.frames_recorded = writer_->frames();
        }
    }

private:
    // Images that the limits do not hold are refused with what helps; images for which they grew are said, with the
    // block that they take, before it is taken.
    [[nodiscard]] bool check_size(const SessionOptions& options, std::size_t block_bytes, std::string& message) const {
        const std::uint32_t width = camera_.width, height = camera_.height;
        if (width > kSideMax || height > kSideMax) {
            message = fmt::format("the images are {}x{} pixels, at most {}x{} are tracked; halve them with --half.",
                                  width, height, kSideMax, kSideMax);
            return false;
        }
        if (width > limits_.image_width_max || height > limits_.image_height_max) {
            message = fmt::format(
                "the images are {}x{} pixels, and limits.image_width_max = {} and limits.image_height_max = {} were "
                "given; "
                "leave these out, or give --set limits.image_width_max={} --set limits.image_height_max={}, or --half.",
                width, height, limits_.image_width_max, limits_.image_height_max, width, height);
            return false;
        }
        const Limits usual = limits_of(options.limits);
        if (width > usual.image_width_max || height > usual.image_height_max) {
            complain(
                fmt::format("images of {}x{} are larger than the limits '{}' have them: the limits follow, and the "
                            "engine's block is {:.1f} MiB instead of {:.1f} (--half: tracked at half their size).",
                            width, height, options.limits, static_cast<double>(block_bytes) / (1024.0 * 1024.0),
                            static_cast<double>(bytes_needed(usual)) / (1024.0 * 1024.0)),
                LogLevel::kNotice);
        }
        return true;
    }

    // The first of FILE.1, FILE.2, ... that is not there: none that was kept before is lost.
    [[nodiscard]] static std::string free_name(const std::string& file) {
        std::error_code error;
        std::string name;
        for (int i = 1; name.empty() || std::filesystem::exists(name, error); ++i) name = fmt::format("{}.{}", file, i);
        return name;
    }
    void finish_map() {
        if (!map_saver_->is_open()) return;
        if (std::string problem = map_saver_->finish(*engine_); !problem.empty()) {
            map_problems_.push_back(std::move(problem));
        }
        if (map_saver_->is_saved()) {
            maps_written_.push_back(map_record(map_out_, map_saver_->info(), map_saver_->last_save_s(), "written"));
            maps_written_.back().times = map_saver_->saves();
        }
    }
    // Renames a map that cannot be gone on in to the first free FILE.1, FILE.2, ...: none of those kept before is lost.
    [[nodiscard]] bool keep_aside(const std::string& map, const std::string& why, std::string& message) {
        std::error_code error;
        const std::string aside = free_name(map);
        std::filesystem::rename(map, aside, error);
        if (error) {
            message = why + " It cannot be kept as " + aside + " either: " + error.message() + ".";
            return false;
        }
        note_ += (note_.empty() ? "" : " ") + why + " A new map begins; that one is kept as " + aside + ".";
        return true;
    }
    [[nodiscard]] bool open_store(const SessionOptions& options, const Configuration& configuration,
                                  const CameraModel& camera, std::uint8_t extractor, std::string& message) {
        if (!has_vocabulary_) {
            message = "--map-store: places come back by their words: it needs a vocabulary and loop.is_enabled.";
            return false;
        }
        const auto mode = options.can_wait ? StoreService::Mode::kAtOnce : StoreService::Mode::kThread;
        const RegionStoreOptions where =
            store_options(options.map_store, configuration, camera, extractor, vocabulary_.crc());
        if (!store_.open(where, mode, store_body_bytes_max(limits_), message)) return false;
        if (!message.empty()) store_note_ = message;
        message.clear();
        map_store_ = options.map_store;
        return true;
    }
    // What is in memory goes to the store too, so that the next run finds it there.
    void close_store(RunRecord& record) {
        if (!store_.is_open()) return;
        static_cast<void>(store_.begin_frame());
        while (engine_->step_store(slice_units_) == Progress::kWorking) {
            static_cast<void>(store_.wait_for_room());
            if (store_.has_failed()) break;
        }
        record.store.engine = engine_->statistics().store;
        const std::string problem = store_.close();
        record.store.folder = map_store_;
        record.store.regions = store_.counts().regions;
        record.store.bytes = store_.counts().bytes;
        record.store.written = store_.counts().written;
        record.store.forgotten = store_.counts().forgotten;
        record.store.damaged = store_.counts().damaged;
        if (!store_note_.empty()) record.notes.push_back(store_note_);
        if (!problem.empty()) record.problems.push_back(problem);
    }
    [[nodiscard]] static MapRecord map_record(const std::string& file, const MapFileInfo& info, double seconds,
                                              const char* what) {
        return {what, file, info.size_bytes, info.keyframes, info.points, info.hash, seconds, 1};
    }
    // Behind submit, while the pose is not out yet: the least that is needed.
    void note_decisions(const Frame& frame, Status status) {
        const FrameStatistics& statistics = engine_->frame_statistics();
        frame_ = frame;
        recorded_.time_ns = frame.time_ns;
        recorded_.status = status;
        recorded_.pose_state = static_cast<std::uint8_t>(engine_->pose().state);
        recorded_.is_keyframe = statistics.is_keyframe;
        recorded_.features = statistics.features;
        recorded_.matches = statistics.matches;
        recorded_.static_matches = statistics.static_matches;
        recorded_.groups = statistics.groups;
        recorded_.hash_tracked = recorded_.hash = engine_->state_hash();
        recorded_.grant_runs = 0;
    }
    void note_keyframes() {
        keyframes_now_.clear();
        const std::uint32_t count = engine_->keyframes(keyframes_);
        for (std::uint32_t i = 0; i < count; ++i) {
            keyframes_now_.push_back(
                {keyframes_[i].id, keyframes_[i].parent_id, pose_of(keyframes_[i].map_from_camera, 0)});
        }
        final_.update(keyframes_now_);
    }
    void record_frame() {
        recorded_.digest = frame_digest(frame_);
        writer_->add(recorded_);
    }
    static void on_stage(void* user, Stage stage, bool is_begin) noexcept {
        auto& session = *static_cast<EngineSession*>(user);
        const auto i = static_cast<std::size_t>(stage);
        const std::int64_t now_ns = monotonic_ns();
        if (is_begin) {
            session.begin_ns_[i] = now_ns;
        } else {
            session.spent_ns_[i] += now_ns - session.begin_ns_[i];
        }
    }

    Limits limits_;
    MemoryBlock block_;
    Engine* engine_ = nullptr;
    std::uint32_t units_per_frame_ = 0;
    std::uint32_t slice_units_ = 1;
    StepPacer pacer_{1};
    std::string map_in_, map_out_;
    std::string map_files_begin_;  // map_out_ of the first map
    MapFileInfo map_in_info_;
    double map_load_s_ = 0;
    bool is_localising_ = false;
    std::string not_gone_on_in_, kept_aside_;  // why not in the map that is there; that map
    std::unique_ptr<MapSaver> map_saver_ = std::make_unique<MapSaver>();
    GridOutputs grid_;
    MapPoints* points_ = nullptr;
    std::vector<MapRecord> maps_written_;
    std::vector<std::string> map_problems_;
    Configuration configuration_;
    CameraModel camera_;
    std::uint8_t extractor_number_ = 0;
    std::int64_t map_every_ns_ = 0;
    PlaceProbe probe_;
    EngineStatistics of_maps_before_;
    Trajectory final_of_maps_before_;
    StoreService store_;
    std::string map_store_, store_note_;
    bool can_wait_ = true;
    const MotionSource* motion_ = nullptr;
    const AccelerationSource* accelerations_ = nullptr;
    GravityFinder gravity_;
    std::int64_t last_frame_ns_ = -1;
    std::uint64_t hinted_frames_ = 0;
    bool is_recording_lost_ = false, is_store_lost_ = false;  // said
    std::string recording_;
    std::unique_ptr<RecordingWriter> writer_;
    RecordedFrame recorded_;
    Frame frame_;  // the last submitted; its pixels are there until work() returns
    Percentiles background_ms_, slice_ms_, record_ms_;
    std::array<StageRecord, kStages> stages_;
    std::array<std::int64_t, kStages> begin_ns_{};
    std::array<std::int64_t, kStages> spent_ns_{};
    std::string note_;
    VocabularyFile vocabulary_;
    bool has_vocabulary_ = false;
    bool keeps_final_ = false;
    FinalTrajectory final_;
    std::vector<KeyframePose> keyframes_;
    std::vector<KeyframeNow> keyframes_now_;
#ifdef STILLMESH_HAS_OPENCV
    std::unique_ptr<CvOrbExtractor> extractor_;
#endif
};

}  // namespace

// What the options give: the preset's limits, the scene's and the method's defaults, fitted into them, and what the
// camera knows of itself, then the file, then single assignments.
Status session_configuration(const SessionOptions& options, const CameraInfo& camera, Limits& limits,
                             Configuration& configuration, std::string& message) {
    message.clear();
    limits = limits_of(options.limits);
    // Images larger than a preset has them: the limits follow, unless the file or an assignment says otherwise.
    limits.image_width_max = std::max(limits.image_width_max, std::min(camera.model.width, kSideMax));
    limits.image_height_max = std::max(limits.image_height_max, std::min(camera.model.height, kSideMax));
    configuration = options.scene == "outdoor" ? Configuration::outdoor() : Configuration::indoor();
    if (options.method == "paper") configuration.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    configuration.camera.readout_s = camera.readout_s;
    std::string note;
    if (configuration.features.count > limits.features_max) {
        note = fmt::format("features.count is {} instead of {}: the limits '{}' have no room for more.",
                           limits.features_max, configuration.features.count, options.limits);
    }
    configuration = configuration.fitted_to(limits);
    const std::vector<ParameterView> parameters = parameters_of(limits, configuration);
    std::string source = "the defaults";
    if (!options.configuration.empty()) {
        source = options.configuration;
        std::string text;
        if (const Status status = read_small_file(source, kConfigurationBytesMax, text, message);
            status != Status::kOk) {
            message += " 'stillmesh run --print-config' writes one to start from.";
            return status;
        }
        STILLMESH_TRY(apply_configuration(text, source, parameters, message));
    }
    for (const std::string& assignment : options.assignments) {
        source = "--set";
        STILLMESH_TRY(apply_assignment(assignment, source, parameters, message));
    }
    if (!options.map_store.empty() && limits.store_features_max == 0) limits.store_features_max = limits.features_max;
    // Each value is within its range by now; this is about how they go together.
    ConfigurationProblem problem = validate(limits);
    if (problem.key == nullptr) problem = validate(configuration, limits);
    if (problem.key != nullptr) {
        message = fmt::format("{}: key '{}' = {} {}; allowed beside the others: {} to {} (limits '{}').", source,
                              problem.key, problem.value, problem.sentence, problem.min, problem.max, options.limits);
        return Status::kInvalid;
    }
    if (configuration.features.count == limits.features_max) message = note;
    return Status::kOk;
}

Status session_sizes(const SessionOptions& options, SessionSizes& sizes, std::string& message) {
    Limits limits;
    Configuration configuration;
    STILLMESH_TRY(session_configuration(options, CameraInfo{}, limits, configuration, message));
    sizes = {
        limits.image_width_max, limits.image_height_max, {configuration.depth.z_min_m, configuration.depth.z_max_m}};
    return Status::kOk;
}

Status create_engine_session(const SessionOptions& options, const CameraInfo& camera,
                             std::unique_ptr<TrackingSession>& session, std::string& message) {
    auto made = std::make_unique<EngineSession>();
    STILLMESH_TRY(made->create(options, camera, message));
    session = std::move(made);
    return Status::kOk;
}

Status print_configuration(const SessionOptions& options, std::string& toml, std::string& message) {
    Limits limits;
    Configuration configuration;
    STILLMESH_TRY(session_configuration(options, CameraInfo{}, limits, configuration, message));
    toml = configuration_toml(parameters_of(limits, configuration));
    if (!message.empty()) toml = "# " + message + "\n" + toml;
    return Status::kOk;
}

}  // namespace stillmesh
