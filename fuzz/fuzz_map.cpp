// A map file, any bytes: refused with a reason and the engine as it was, or taken whole: then all that a map keeps
// incrementally is right, it is written back to the same bytes, and tracking goes on in it, whatever is in it.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "engine/base/check.hpp"
#include "engine/base/crc.hpp"
#include "engine/engine_state.hpp"
#include "engine/record/map_file.hpp"
#include "engine/record/map_records.hpp"
#include "fuzz/engine_scene.hpp"
#include "fuzz/fuzz.hpp"
#include "fuzz/pictures.hpp"
#include "fuzz/small_engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/map_fault.hpp"
#ifdef STILLMESH_CANARY
#include "fuzz/canary.hpp"
#endif

// A failed check says which before it stops.
void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "check failed: %s (%s:%d)\n", expression, file, line);
}

namespace {

using namespace stillmesh;

constexpr std::size_t kParentPoseAt = 96, kPoseBytes = 96;  // docs/SPEC-map.md
constexpr std::size_t kCoefficientsAt = 8, kCoefficientsBytes = 72;
constexpr std::uint32_t kFramesBefore = 14, kFramesAfter = 2;
constexpr std::uint32_t kStepUnits = 20000;

Engine& engine() {
    static const fuzz::Block block(bytes_needed(fuzz::kSmallLimits));
    static Engine* const made = [] {
        Configuration configuration = fuzz::small_configuration();
        configuration.keyframes.gap_min = 2;
        configuration.keyframes.new_points_min = 4;
        configuration.keyframes.tracked_share_max = 1;
        const Result<Engine*> created =
            Engine::create(block.span(), fuzz::kSmallLimits, configuration, fuzz::small_camera(), cpu_kernels());
        fuzz::expect(created.is_ok(), "an engine");
        return created.value();
    }();
    return *made;
}

// What the camera sees as it moves along, a pixel a frame.
struct Kept {
    fuzz::Picture<std::uint8_t> colour;
    fuzz::Picture<std::uint16_t> depth;
    std::int64_t time_ns = 0;
};
const std::vector<Kept>& frames() {
    static const std::vector<Kept> drawn = [] {
        const CameraModel camera = fuzz::small_camera();
        std::vector<Kept> out;
        fuzz::Scene scene;
        for (std::uint32_t i = 0; i < kFramesBefore; ++i, ++scene.x) {
            out.push_back({fuzz::empty_picture<std::uint8_t>(camera.width, camera.height, 1),
                           fuzz::empty_picture<std::uint16_t>(camera.width, camera.height, 1),
                           std::int64_t{i} * 110'000'000});  // depth images begin after a second
            scene.draw(out.back().colour, out.back().depth, 1);
        }
        return out;
    }();
    return drawn;
}

void show(std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = first; i < first + count; ++i) {
        Frame frame;
        frame.colour = frames()[i].colour.view;
        frame.depth = frames()[i].depth.view;
        frame.time_ns = frame.depth_time_ns = frames()[i].time_ns;
        fuzz::expect(engine().submit(frame) == Status::kOk, "frames are taken");
        static_cast<void>(engine().step(kStepUnits));
    }
}

// A good file of a few keyframes.
const std::vector<std::byte>& good() {
    static const std::vector<std::byte> file = [] {
        engine().reset();
        show(0, kFramesBefore);
        std::vector<std::byte> out = fuzz::map_of(engine());
        MapFileInfo info;
        MapFileProblem problem;
        fuzz::expect(read_map_header(out, info, problem) == Status::kOk && info.keyframes >= 3 && info.points >= 20 &&
                         info.depth_images >= 2,
                     "a good file has something to break");
        return out;
    }();
    return file;
}

// Of an engine that was reset.
std::uint64_t fresh_hash() {
    static const std::uint64_t hash = [] {
        engine().reset();
        return engine().state_hash();
    }();
    return hash;
}

// Gives header and sections the checksums of their bytes, so that what lies behind is reached.
void mend(std::vector<std::byte>& file) {
    const auto seal = [&](std::size_t begin, std::size_t end) {
        const std::uint32_t crc = crc32(std::span(file).subspan(begin, end - begin));
        for (std::size_t i = 0; i < 4; ++i) file[end + i] = static_cast<std::byte>(crc >> (8 * i));
    };
    if (file.size() < kMapHeaderBytes) return;
    seal(0, kMapHeaderBytes - 4);
    std::size_t at = kMapHeaderBytes;
    while (file.size() - at >= 20) {
        std::uint64_t size = 0;
        for (std::size_t i = 0; i < 8; ++i) size |= std::to_integer<std::uint64_t>(file[at + 8 + i]) << (8 * i);
        if (size > file.size() - at - 20) return;
        const std::size_t end = at + 16 + static_cast<std::size_t>(size);
        seal(at, end);
        at = end + 4;
    }
}

// Its content is written back: the hash in the header is information, not checked, and a file that lies about it is
// corrected. So are the pose of a keyframe in its parent and the rays of depth images, which readers pass over, and the
// sign of a zero of the camera, whose numbers are compared.
void expect_written_back(const std::vector<std::byte>& file) {
    const std::vector<std::byte> again = fuzz::map_of(engine());
    MapFileInfo info, said;
    MapFileProblem problem;
    fuzz::expect(read_map_header(again, info, problem) == Status::kOk, "what was written is a map");
    fuzz::expect(read_map_header(file, said, problem) == Status::kOk, "what was taken is one");
    fuzz::expect(info.depth_images == std::min(said.depth_images, fuzz::kSmallLimits.depth_images_max),
                 "as many depth images as there is room for");
    if (info.depth_images < said.depth_images) return;
    fuzz::expect(again.size() == file.size(), "a map is written back to as many bytes");
    std::vector<std::byte> wanted = file;
    std::memcpy(wanted.data() + 72, again.data() + 72, 8);
    const auto camera = static_cast<std::size_t>(
        map_records::records_at(info, static_cast<std::uint32_t>(map_records::Section::kCamera)));
    std::memcpy(wanted.data() + camera + kCoefficientsAt, again.data() + camera + kCoefficientsAt, kCoefficientsBytes);
    if (info.depth_images > 0) {
        const auto rays = static_cast<std::uint32_t>(map_records::Section::kRays);
        const auto at = static_cast<std::size_t>(map_records::records_at(info, rays));
        std::memcpy(wanted.data() + at, again.data() + at, map_records::section_bytes(info, rays));
    }
    const auto keyframes = static_cast<std::uint32_t>(map_records::Section::kKeyframes);
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        const auto at = static_cast<std::size_t>(map_records::records_at(info, keyframes)) +
                        k * map_records::kKeyframeBytes + kParentPoseAt;
        std::memcpy(wanted.data() + at, again.data() + at, kPoseBytes);
    }
    mend(wanted);
    fuzz::expect(again == wanted, "a map is written back to the same bytes");
#ifdef STILLMESH_CANARY
    fuzz::count_weights(again, info);
#endif
}

void try_file(const std::vector<std::byte>& file, MapUse use) {
    Engine& e = engine();
    const std::uint64_t before = fresh_hash();
    e.reset();
    fuzz::expect(e.state_hash() == before, "an engine that was reset is as new, whatever map was in it");
    MapFileProblem problem;
    const Status status = e.load_map(file, use, problem);
    if (status != Status::kOk) {
        fuzz::expect(problem.fault != MapFault::kNone && problem.part != nullptr, "a refusal has a reason");
        fuzz::expect(status == Status::kNotFound || status == Status::kEnd || status == Status::kInvalid ||
                         status == Status::kCorrupt || status == Status::kFull,
                     "a closed list of answers");
        fuzz::expect(e.state_hash() == before && e.statistics().keyframes.size == 0, "a refused file touches nothing");
        return;
    }
    const Map& map = static_cast<EngineState&>(e).world.map;
    fuzz::expect(test::find_fault(map) == nullptr, "a map that was taken is whole");
    expect_written_back(file);
    show(4, kFramesAfter);
    fuzz::expect(test::find_fault(map) == nullptr, "and the map stays whole");
}

// Of an input of edits: whether it is tried as it is, too, with checksums that seldom fit. One in eight, and every one
// in Fuzz.map.
bool is_tried_unmended(std::span<const std::uint8_t> input) {
#ifdef STILLMESH_LIBFUZZER
    return crc32(std::as_bytes(input)) % 8 == 0;
#else
    static_cast<void>(input);
    return true;
#endif
}

}  // namespace

#ifdef STILLMESH_LIBFUZZER
#include "fuzz/mutator.hpp"

namespace {

std::size_t piece_bytes(std::span<const std::uint8_t> rest, bool is_head) {
    const bool is_edits = rest[0] == '+';
    return is_head ? (is_edits ? 2U : rest.size()) : 4U;  // a file of its own is one piece
}

fuzz::Piece make_head(Random& random) {
    return {'+', static_cast<std::uint8_t>(random.below(2))};
}

// Of one byte of one record (or head) of one section, or of the header; likely to be the last byte of a number, and to
// become one that matters.
fuzz::Piece make_edit(Random& random) {
    MapFileInfo info;
    MapFileProblem problem;
    fuzz::expect(read_map_header(good(), info, problem) == Status::kOk, "a good file");
    std::uint64_t at = random.below(kMapHeaderBytes);
    const std::uint32_t sections = map_records::sections_of(info);
    const std::uint32_t section = random.below(sections + 1);
    if (section < sections) {
        const auto records = map_records::records_of(info, section);
        const auto size = static_cast<std::uint32_t>(map_records::record_bytes(info, section));
        at = map_records::records_at(info, section);
        at = random.below(16) == 0 ? at - 1 - random.below(map_records::kSectionHeadBytes)
                                   : at + std::uint64_t{random.below(records)} * size + random.below(size);
    }
    constexpr std::uint8_t kValues[] = {0, 1, 2, 3, 4, 0x3f, 0x40, 0x7f, 0x80, 0xbf, 0xc0, 0xf0, 0xff};
    const std::uint32_t any = random.below(256);
    const auto value = any < 128 ? kValues[any % std::size(kValues)] : static_cast<std::uint8_t>(random.below(256));
    return {static_cast<std::uint8_t>(at), static_cast<std::uint8_t>(at >> 8), static_cast<std::uint8_t>(at >> 16),
            value};
}

}  // namespace

STILLMESH_FUZZ_BY((stillmesh::fuzz::Grammar{piece_bytes, make_head, make_edit}))
#endif

// "+", how to use it, then edits of a good file (place in three bytes, value in one); or the file itself.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> file(first, first + size_bytes);
    MapUse use = MapUse::kContinue;
    const bool is_edits = size_bytes >= 2 && data[0] == '+';
    if (is_edits) {
        use = data[1] % 2 == 0 ? MapUse::kContinue : MapUse::kLocalise;
        file = good();
        for (std::size_t i = 2; i + 4 <= size_bytes; i += 4) {
            const std::size_t at = data[i] | std::size_t{data[i + 1]} << 8 | std::size_t{data[i + 2]} << 16;
            file[at % file.size()] = static_cast<std::byte>(data[i + 3]);
        }
    }
    if (!is_edits || is_tried_unmended({data, size_bytes})) try_file(file, use);
    mend(file);
    try_file(file, use);
    return 0;
}
