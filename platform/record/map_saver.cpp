#include "platform/record/map_saver.hpp"

#include <fmt/format.h>

#include <exception>
#include <new>
#include <system_error>
#include "platform/linux/process.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kPieceBytes = 64 * 1024;
constexpr std::int64_t kSaidAgain_ns = 60'000'000'000;
// A copy at the end of a run need not be cut.
constexpr std::uint32_t kAllUnits = 0xffffffffU;

[[nodiscard]] const char* extractor_name(double code) {
    return code == 0 ? "native" : code == 1 ? "opencv" : "another program's";
}

}  // namespace

MapSaver::~MapSaver() {
    join();
}

void MapSaver::join() {
    if (thread_.joinable()) thread_.join();
}

bool MapSaver::open(const std::string& file, const Limits& limits, std::uint8_t extractor, std::int64_t every_ns,
                    std::string& message) {
    if (!target_.open(file, message)) return false;
    target_.discard();
    piece_.resize(kPieceBytes);
    if (!workspace_.allocate(map_copy_bytes(limits))) {
        message = fmt::format("the system has no {:.1f} MiB of memory left for saving the map; leave out --map-out.",
                              static_cast<double>(map_copy_bytes(limits)) / (1024.0 * 1024.0));
        return false;
    }
    file_ = file;
    extractor_ = extractor;
    every_ns_ = every_ns;
    return true;
}

void MapSaver::work(Engine& engine, std::int64_t now_ns, std::uint32_t units) {
    if (is_writing_) return;
    if (next_ns_ == 0) next_ns_ = now_ns + every_ns_;
    if (!is_copying_) {
        if (!is_asked_ && (every_ns_ <= 0 || now_ns < next_ns_)) return;
        is_asked_ = false;
        next_ns_ = now_ns + every_ns_;
        if (engine.begin_map_copy(workspace_.bytes(), extractor_) != Status::kOk) return;  // no map yet
        is_copying_ = true;
    }
    if (engine.step_map_copy(units) != Progress::kDone) return;
    is_copying_ = false;
    join();
    is_writing_ = true;
    try {
        thread_ = std::jthread([this] {
            write();
            is_writing_ = false;
        });
    } catch (const std::system_error& error) {
        fail(file_ + ": could not be saved, for want of a thread: " + error.what() + ".");
        is_writing_ = false;
    }
}

void MapSaver::fail(const std::string& problem) {
    has_news_ = true;
    problem_ = problem;
    if (failures_++ == 0) first_problem_ = problem;
}

std::string MapSaver::take_news(std::int64_t now_ns) {
    if (file_.empty() || is_writing_ || !has_news_) return {};
    if (said_ns_ != 0 && now_ns - said_ns_ < kSaidAgain_ns) return {};
    has_news_ = false;
    said_ns_ = now_ns;
    if (every_ns_ <= 0) return problem_;
    return problem_ + fmt::format(" It is tried again every {:g} s.", static_cast<double>(every_ns_) * 1e-9);
}

void MapSaver::write() {
    try {
        write_file();
    } catch (const std::bad_alloc&) {
        fail(file_ + ": could not be saved, for want of memory.");
    }
}

void MapSaver::write_file() {
    MapFileWriter writer(workspace_.bytes());
    std::string message;
    bool is_written = target_.open(file_, message);
    while (is_written) {
        const std::size_t size = writer.next(piece_);
        if (size == 0) break;
        is_written = target_.write(std::span(piece_).first(size), message);
    }
    if (is_written && target_.commit(message)) {
        ++saves_;
        info_ = writer.info();
        problem_.clear();
    } else {
        fail(message);
    }
}

bool MapSaver::copy(Engine& engine) {
    join();
    is_copying_ = false;
    if (engine.begin_map_copy(workspace_.bytes(), extractor_) != Status::kOk) return false;
    while (engine.step_map_copy(kAllUnits) == Progress::kWorking) {
    }
    return true;
}

void MapSaver::rescue(Engine& engine) noexcept {
    try {
        if (copy(engine)) write_file();
    } catch (const std::exception&) {  // the file before is whole
    }
}

std::string MapSaver::finish(Engine& engine) {
    const std::int64_t begin_ns = monotonic_ns();
    if (!copy(engine)) {
        problem_ = file_ + ": was not written: there is no map, since no frame had enough depth to begin one.";
        return problem_;
    }
    write();
    last_save_s_ = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
    if (!problem_.empty() || failures_ == 0) return problem_;
    return fmt::format("{} ({} of {} saves failed while it ran; at the end the map was written.)", first_problem_,
                       failures_, failures_ + saves_);
}

std::string map_sentence(const std::string& file, const MapFileProblem& p) {
    switch (p.fault) {
        case MapFault::kNone: return {};
        case MapFault::kNoMap: return file + ": is no map of Stillmesh.";
        case MapFault::kOtherVersion:
            return fmt::format("{}: is a map of version {:.0f}; this program reads versions {} to {:.0f}.", file,
                               p.value, kMapVersion, p.limit);
        case MapFault::kCutOff:
            return fmt::format("{}: is cut off: {:.0f} bytes of {:.0f} are there.", file, p.value, p.limit);
        case MapFault::kTooLong:
            return fmt::format("{}: is damaged: {:.0f} bytes instead of {:.0f}.", file, p.value, p.limit);
        case MapFault::kDamaged: return fmt::format("{}: is damaged: the checksum of its {} is wrong.", file, p.part);
        case MapFault::kImpossible: return fmt::format("{}: is damaged: {} in it cannot be.", file, p.part);
        case MapFault::kTooManyFor:
            return fmt::format(
                "{}: is larger than the limits: it needs {} = {:.0f}, this run has {:.0f} (--limits, --set).", file,
                p.part, p.value, p.limit);
        case MapFault::kOtherFeatures:
            return fmt::format("{}: was made with {} = {:g}, this run has {:g}; give it the same (--set).", file,
                               p.part, p.value, p.limit);
        case MapFault::kOtherExtractor:
            return fmt::format("{}: was made with --features {}, this run has {}.", file, extractor_name(p.value),
                               extractor_name(p.limit));
        case MapFault::kOtherCamera:
            return fmt::format("{}: was made with another camera: its {} is {:g}, this camera's is {:g}.", file, p.part,
                               p.value, p.limit);
    }
    return {};
}

std::string merge_sentence(const std::string& second, const std::string& first, const MapMerge& merge) {
    const std::string begin = second + ": cannot be joined to " + first + ": ";
    if (merge.found == 0) {
        return begin + fmt::format("none of its {} keyframes shows a place of that map; map some way that both have.",
                                   merge.keyframes);
    }
    if (merge.is_alike) {
        return begin + fmt::format(
                           "{} of its {} keyframes look like one place of that map, but there are others that look "
                           "alike, so that it might be any of them.",
                           merge.agreeing, merge.keyframes);
    }
    return begin + fmt::format(
                       "of its {} keyframes {} look like a place of that map, and only {} agree on where both "
                       "would lie; map more of a way that both have.",
                       merge.keyframes, merge.found, merge.agreeing);
}

Status load_map_file(const std::string& file, Engine& engine, MapUse use, std::uint8_t extractor, MapFileInfo& info,
                     std::string& message) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kMapFileBytesMax, block, bytes, message)) return Status::kUnavailable;
    MapFileProblem problem;
    if (engine.load_map(bytes, use, problem, extractor) != Status::kOk) {
        message = map_sentence(file, problem);
        return Status::kInvalid;
    }
    static_cast<void>(read_map_header(bytes, info, problem));
    return Status::kOk;
}

}  // namespace stillmesh
