#include "platform/cli/rerun_command.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "engine/engine.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/prepared_camera.hpp"
#include "platform/cli/recording_source.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "platform/record/map_saver.hpp"
#include "platform/record/recording_reader.hpp"
#include "platform/store/session_store.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#ifdef STILLMESH_HAS_OPENCV
#include "platform/opencv/orb_adapter.hpp"
#endif

namespace stillmesh {
namespace {

struct Outcome {
    std::uint64_t frames = 0;                  // repeated bit for bit
    std::uint64_t skipped = 0;                 // frames of the folder that the recorded run was not given
    std::uint64_t frames_without_picture = 0;  // recorded, behind the end of the folder
    std::string difference;                    // of the frame behind them; empty: none
};

// The frame of this time, from where the camera is on. kNotFound: the folder has none; kEnd: nor any behind it.
[[nodiscard]] Status find_frame(DepthCamera& camera, std::int64_t time_ns, Frame& frame, std::uint64_t& skipped) {
    for (;;) {
        const Status status = camera.poll(frame);
        if (status == Status::kEnd) return Status::kEnd;
        if (status == Status::kTimedOut) continue;  // a bag without pairs for a while
        if (status == Status::kOk && frame.time_ns == time_ns) return Status::kOk;
        if (status == Status::kOk && frame.time_ns > time_ns) return Status::kNotFound;
        ++skipped;  // an image that cannot be used was skipped by the recorded run as well, or is missed here
    }
}

// What differs right after submit; empty: nothing.
[[nodiscard]] std::string difference(const RecordedFrame& then, const RecordedFrame& now) {
    if (now.digest != then.digest) {
        return fmt::format(
            "other input: its pixels, sizes or depth factor are not those of the recorded run (digest "
            "{:016x}, recorded {:016x}); is this the right folder?",
            now.digest, then.digest);
    }
    if (now.status != then.status) {
        return fmt::format("submit says '{}', recorded '{}'", status_name(now.status), status_name(then.status));
    }
    const auto state = [](std::uint8_t code) { return pose_state_name(static_cast<PoseState>(code)); };
    if (now.pose_state != then.pose_state) {
        return fmt::format("the pose is {}, recorded {}", state(now.pose_state), state(then.pose_state));
    }
    if (now.is_keyframe != then.is_keyframe) {
        return now.is_keyframe ? "it became a keyframe, recorded it did not" : "it became no keyframe, recorded it did";
    }
    const struct {
        const char* name;
        std::uint32_t now, then;
    } counts[] = {{"features", now.features, then.features},
                  {"matches", now.matches, then.matches},
                  {"static matches", now.static_matches, then.static_matches},
                  {"groups", now.groups, then.groups}};
    for (const auto& count : counts) {
        if (count.now != count.then) return fmt::format("{} {}, recorded {}", count.now, count.name, count.then);
    }
    if (now.hash_tracked != then.hash_tracked) {
        return fmt::format("other bits after tracking (state hash {:016x}, recorded {:016x})", now.hash_tracked,
                           then.hash_tracked);
    }
    return {};
}

// What is repeated from.
struct Frames {
    DepthCamera& camera;
    const std::string& message;  // why its last call failed
};

[[nodiscard]] Status repeat(Engine& engine, const Frames& frames, RecordingReader& reader, StoreService& store,
                            Outcome& outcome) {
    RecordedFrame then;
    for (;; ++outcome.frames) {
        const Status status = reader.next(then);
        if (status == Status::kEnd) return Status::kOk;
        if (status != Status::kOk) return status;
        if (stop_signal() != 0) return Status::kEnd;
        Frame frame;
        const Status found = find_frame(frames.camera, then.time_ns, frame, outcome.skipped);
        if (found == Status::kEnd) {
            ++outcome.frames_without_picture;
            while (reader.next(then) == Status::kOk) ++outcome.frames_without_picture;
            // A run that was killed may have lost its last pictures: they take longer to write than a record.
            if (reader.is_whole()) {
                outcome.difference = fmt::format("the folder ends before frame {} of the recording", outcome.frames);
            }
            return Status::kOk;
        }
        if (found != Status::kOk) {
            outcome.difference = "the folder has no usable frame of this time";
            if (!frames.message.empty()) outcome.difference += ": " + frames.message;
        } else {
            RecordedFrame now;
            now.digest = frame_digest(frame);
            now.status = engine.submit(frame, then.has_hint ? &then.hint : nullptr);
            const FrameStatistics& statistics = engine.frame_statistics();
            now.pose_state = static_cast<std::uint8_t>(engine.pose().state);
            now.is_keyframe = statistics.is_keyframe;
            now.features = statistics.features;
            now.matches = statistics.matches;
            now.static_matches = statistics.static_matches;
            now.groups = statistics.groups;
            now.hash_tracked = engine.state_hash();
            outcome.difference = difference(then, now);
        }
        if (outcome.difference.empty()) {
            if (then.has_store && then.status == Status::kOk) {
                const StoreEvents wanted{then.store_answered, then.is_store_accepting};
                if (store.begin_frame(wanted) != wanted) outcome.difference = "the map store gave no answer";
            }
            for (std::uint32_t i = 0; i < then.grant_runs; ++i) {
                for (std::uint32_t call = 0; call < then.grants[i].calls; ++call) {
                    static_cast<void>(engine.step(then.grants[i].units));
                }
            }
            if (outcome.difference.empty() && engine.state_hash() != then.hash) {
                outcome.difference =
                    fmt::format("other bits after its background work (state hash {:016x}, recorded {:016x})",
                                engine.state_hash(), then.hash);
            }
        }
        if (!outcome.difference.empty()) {
            outcome.difference = fmt::format("frame {} (time {}) differs: {}", outcome.frames, time_text(then.time_ns),
                                             outcome.difference);
            return Status::kOk;
        }
    }
}

}  // namespace

int rerun_command(const RerunOptions& options) {
    RecordingReader reader;
    if (reader.open(options.recording) != Status::kOk) return refuse(reader.message());
    const RecordingHeader& header = reader.header();
    ConfigurationProblem problem = validate(header.limits);
    if (problem.key == nullptr) problem = validate(header.configuration, header.limits);
    if (problem.key != nullptr) {
        return refuse(fmt::format("{}: key '{}' = {} {}; allowed: {} to {}.", options.recording, problem.key,
                                  problem.value, problem.sentence, problem.min, problem.max));
    }
    if (!reader.unknown_key().empty()) {
        complain(
            fmt::format("{}: names '{}'{}, which this program does not know; the run may come out otherwise.",
                        options.recording, reader.unknown_key(),
                        header.unknown_keys > 1 ? fmt::format(" and {} other keys", header.unknown_keys - 1) : ""));
    }
    std::string folder = options.folder;
    while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
    const std::uint32_t halves = options.is_half ? 2 : 1;
    CameraInfo of_images{header.camera, header.depth_units_per_m};
    if (options.is_half) of_images.model.width = of_images.model.height = 0;  // as they are
    RecordingSource source({.folder = folder,
                            .calibration = "",
                            .camera = of_images,
                            .width_max = halves * header.limits.image_width_max + halves - 1,
                            .height_max = halves * header.limits.image_height_max + halves - 1,
                            .masks = is_mask_of_frames(options.mask) ? options.mask : ""},
                           options.topics);
    if (!source.problem().empty()) return refuse(source.problem());
    DepthCamera& whole = source.camera();
    if (whole.open() != Status::kOk) return refuse(source.message());
    PreparedCamera prepared(whole);
    std::string note, message;
    if (prepared.prepare(options.mask, options.is_half, note, message) != Status::kOk) return refuse(message);
    DepthCamera& camera = prepared.camera();
    const CameraModel& size = camera.info().model;
    if (size.width != header.camera.width || size.height != header.camera.height) {
        return refuse(fmt::format("{}: the run had images of {}x{}, these are halved to {}x{}.", options.recording,
                                  header.camera.width, header.camera.height, size.width, size.height));
    }
    FeatureExtractor* extractor = nullptr;
#ifdef STILLMESH_HAS_OPENCV
    std::unique_ptr<CvOrbExtractor> orb;
    if (header.extractor == 1) {
        const FeatureParameters& features = header.configuration.features;
        orb = std::make_unique<CvOrbExtractor>(static_cast<int>(features.count), features.scale_factor,
                                               static_cast<int>(features.levels));
        extractor = orb.get();
    }
#endif
    if (header.extractor != 0 && extractor == nullptr) {
        return refuse(options.recording +
                      ": was made with another feature extractor (--features) than this build has.");
    }
    MemoryBlock block;
    if (!block.allocate(bytes_needed(header.limits))) {
        return refuse(fmt::format("the system has no {:.1f} MiB of memory left for the engine of this recording.",
                                  static_cast<double>(bytes_needed(header.limits)) / (1024.0 * 1024.0)));
    }
    VocabularyFile vocabulary;
    std::string sentence;
    if (header.vocabulary_crc != 0) {
        if (!vocabulary.open(options.vocabulary, header.limits.vocabulary_words_max, sentence)) return refuse(sentence);
        if (vocabulary.crc() != header.vocabulary_crc) {
            return refuse(fmt::format("{}: was made with another vocabulary than {}; name that one with --vocabulary.",
                                      options.recording, vocabulary.name()));
        }
    }
    std::error_code error;
    if (!options.map_store.empty() && !std::filesystem::is_directory(options.map_store, error)) {
        return refuse("--map-store " + options.map_store + ": is no folder.");
    }
    StoreService store;
    if (header.limits.store_features_max > 0) {
        if (header.store_regions > 0 && options.map_store.empty()) {
            return refuse(fmt::format("{}: was made with a map store that held {} regions; name it with --map-store.",
                                      options.recording, header.store_regions));
        }
        RegionStoreOptions where =
            store_options(header.store_regions > 0 ? options.map_store : std::string(), header.configuration,
                          header.camera, header.extractor, header.vocabulary_crc);
        where.is_scratch = true;
        where.sequence_max = header.store_sequence;
        if (!store.open(where, StoreService::Mode::kRepeated, store_body_bytes_max(header.limits), sentence)) {
            return refuse(sentence);
        }
        if (store.counts().regions != header.store_regions || store.checksum() != header.store_checksum) {
            return refuse(fmt::format(
                "{}: was made with another map store than {}, or what that held then has been replaced since "
                "({} regions, checksum {:016x}; recorded {}, {:016x}).",
                options.recording, options.map_store.empty() ? "an empty one" : options.map_store,
                store.counts().regions, store.checksum(), header.store_regions, header.store_checksum));
        }
    }
    const Result<Engine*> engine =
        Engine::create(block.bytes(), header.limits, header.configuration, header.camera, cpu_kernels(), extractor,
                       vocabulary.bytes(), store.is_open() ? &store : nullptr);
    if (!engine.is_ok()) {
        return refuse(fmt::format("{}: the engine refuses its camera ({}x{} pixels).", options.recording,
                                  header.camera.width, header.camera.height));
    }

    if (options.start && engine.value()->start_at(*options.start) != Status::kOk)
        return refuse("--start-pose: is farther than a map reaches, 1000 m.");
    if (!options.map_in.empty()) {
        const MapUse use = options.is_localising ? MapUse::kLocalise : MapUse::kContinue;
        MapFileInfo info;
        if (load_map_file(options.map_in, *engine.value(), use, header.extractor, info, message) != Status::kOk) {
            return refuse(message);
        }
    }
    catch_stop_signals();
    Outcome outcome;
    if (const Status status = repeat(*engine.value(), {camera, source.message()}, reader, store, outcome);
        status != Status::kOk) {
        if (status != Status::kEnd) return refuse(reader.message());
        complain(fmt::format("stopped; {} frames were repeated bit for bit until then.", outcome.frames));
        return 128 + stop_signal();
    }
    const bool is_same = outcome.difference.empty();
    if (is_same && outcome.frames == 0) {
        return refuse(fmt::format("{}: holds no whole frame; {}", options.recording,
                                  reader.ending().empty() ? "the run had none." : reader.ending()));
    }
    if (options.is_json) {
        const nlohmann::ordered_json json = {
            {"recording", options.recording},    {"frames_repeated", outcome.frames},
            {"frames_skipped", outcome.skipped}, {"is_identical", is_same},
            {"difference", outcome.difference},  {"is_whole", reader.is_whole()},
            {"ending", reader.ending()},         {"state_hash", fmt::format("{:016x}", engine.value()->state_hash())}};
        std::fputs((json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n").c_str(), stdout);
    } else {
        fmt::print("{} frames repeated bit for bit", outcome.frames);
        if (outcome.skipped > 0) fmt::print("; {} frames of the folder were not in the recording", outcome.skipped);
        fmt::print("\n");
    }
    static_cast<void>(std::fflush(stdout));
    if (!reader.ending().empty()) complain(options.recording + ": " + reader.ending());
    if (is_same && outcome.frames_without_picture > 0) {
        complain(fmt::format("{}: has no pictures for the last {} frames of the recording.", folder,
                             outcome.frames_without_picture));
    }
    if (is_same) return kExitDone;
    complain(outcome.difference + ".");
    return kExitFailed;
}

}  // namespace stillmesh
