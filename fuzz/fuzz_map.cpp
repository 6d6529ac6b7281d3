// A map file, any bytes: refused with a reason and the engine as it was, or taken whole: then all that a map keeps
// incrementally is right, it is written back to the same bytes, and tracking goes on in it, whatever is in it.
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/engine_state.hpp"
#include "engine/record/map_file.hpp"
#include "engine/record/map_records.hpp"
#include "fuzz/fuzz.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/map_fault.hpp"

namespace {

using namespace stillmesh;

constexpr Limits kLimits = Limits::tiny();
constexpr std::size_t kParentPoseAt = 96, kPoseBytes = 96;  // docs/SPEC-map.md

struct Block {
    explicit Block(std::size_t size) : bytes(size + kArenaAlignment) {}
    [[nodiscard]] std::span<std::byte> span() {
        const auto at = reinterpret_cast<std::uintptr_t>(bytes.data());
        const std::size_t skip = (kArenaAlignment - at % kArenaAlignment) % kArenaAlignment;
        return std::span(bytes).subspan(skip, bytes.size() - kArenaAlignment);
    }
    std::vector<std::byte> bytes;
};

test::DrawnScene scene() {
    test::DrawnScene out;
    out.width = 160;
    out.height = 120;
    out.focal_px = 125;
    return out;
}

Engine& engine() {
    static Block block(bytes_needed(kLimits));
    static Engine* const made = [] {
        Configuration configuration;
        configuration.features.count = kLimits.features_max;
        configuration.features.levels = kLimits.pyramid_levels_max;
        configuration.mapping.window_keyframes = kLimits.keyframes_max;
        const Result<Engine*> created =
            Engine::create(block.span(), kLimits, configuration, scene().camera(), cpu_kernels());
        fuzz::expect(created.is_ok(), "an engine");
        return created.value();
    }();
    return *made;
}

const std::vector<test::KeptFrame>& frames() {
    static const std::vector<test::KeptFrame> drawn = [] {
        std::vector<test::KeptFrame> out;
        for (std::uint32_t i = 0; i < 14; ++i) out.push_back(scene().draw(i));
        return out;
    }();
    return drawn;
}

std::vector<std::byte> saved() {
    static Block block(map_copy_bytes(kLimits));
    fuzz::expect(engine().begin_map_copy(block.span()) == Status::kOk, "a map to copy");
    while (engine().step_map_copy(100) == Progress::kWorking) {
    }
    MapFileWriter writer(block.span());
    std::vector<std::byte> out;
    std::vector<std::byte> piece(4096);
    while (const std::size_t size = writer.next(piece)) {
        out.insert(out.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
    }
    return out;
}

// A good file of a few keyframes.
const std::vector<std::byte>& good() {
    static const std::vector<std::byte> file = [] {
        engine().reset();
        for (const test::KeptFrame& frame : frames()) {
            static_cast<void>(engine().submit(frame.frame()));
            static_cast<void>(engine().step(20000));
        }
        return saved();
    }();
    return file;
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

void try_file(const std::vector<std::byte>& file, MapUse use) {
    Engine& e = engine();
    e.reset();
    const std::uint64_t before = e.state_hash();
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
    const char* const fault = test::find_fault(static_cast<EngineState&>(e).world.map);
    fuzz::expect(fault == nullptr, "a map that was taken is whole");
    // The hash in the header is information, not checked: a file that lies about it is corrected when written. So is
    // the pose of a keyframe in its parent, which readers pass over.
    std::vector<std::byte> again = saved();
    std::vector<std::byte> wanted = file;
    fuzz::expect(again.size() == wanted.size(), "a map is written back to as many bytes");
    std::memcpy(wanted.data() + 72, again.data() + 72, 8);
    MapFileInfo info;
    fuzz::expect(read_map_header(again, info, problem) == Status::kOk, "what was written is a map");
    const auto keyframes = static_cast<std::uint32_t>(map_records::Section::kKeyframes);
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        const auto at = static_cast<std::size_t>(map_records::records_at(info, keyframes)) +
                        k * map_records::kKeyframeBytes + kParentPoseAt;
        std::memcpy(wanted.data() + at, again.data() + at, kPoseBytes);
    }
    mend(wanted);
    fuzz::expect(again == wanted, "a map is written back to the same bytes");
    for (std::size_t i = 4; i < 8; ++i) {
        fuzz::expect(e.submit(frames()[i].frame()) == Status::kOk, "frames are taken");
        static_cast<void>(e.step(20000));
    }
    fuzz::expect(test::find_fault(static_cast<EngineState&>(e).world.map) == nullptr, "and the map stays whole");
}

}  // namespace

// "+", how to use it, then edits of a good file (place in three bytes, value in one); or the file itself.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> file(first, first + size_bytes);
    MapUse use = MapUse::kContinue;
    if (size_bytes >= 2 && data[0] == '+') {
        use = data[1] % 2 == 0 ? MapUse::kContinue : MapUse::kLocalise;
        file = good();
        for (std::size_t i = 2; i + 4 <= size_bytes; i += 4) {
            const std::size_t at = data[i] | std::size_t{data[i + 1]} << 8 | std::size_t{data[i + 2]} << 16;
            file[at % file.size()] = static_cast<std::byte>(data[i + 3]);
        }
    }
    try_file(file, use);
    mend(file);
    try_file(file, use);
    return 0;
}
