// The points of the engine's map that stand still, for whoever shows them: copied by the engine's thread between
// frames, in slices (engine/record/map_file.hpp), when somebody asked for them, and read from the copy by the thread
// that asked. Poses, decisions and the state hash do not change by it. Memory: map_copy_bytes(limits), of which a map
// touches what it fills. Cost: that of a map that is saved, for the engine's thread; reading takes one pass over the
// copy for its hash and stops behind the points.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {

struct ShownPoint {
    double in_map_m[3] = {};  // the engine's map
};

class MapPoints {
public:
    // False: no memory; `message` says so.
    [[nodiscard]] bool open(const Limits& limits, std::string& message);

    // --- the engine's thread ---
    // Between frames: begins a copy that was asked for, and goes on with it for so many units. `is_free`: no other copy
    // is being made (the engine has one at a time).
    void work(Engine& engine, bool is_free, std::uint32_t units) noexcept;
    [[nodiscard]] bool is_copying() const noexcept { return state_.load() == State::kCopying; }

    // --- the thread that asks ---
    void ask() noexcept;
    // True: a copy that was asked for was done, and `points` is replaced by its points.
    [[nodiscard]] bool take(std::vector<ShownPoint>& points);

private:
    enum class State : std::uint8_t { kIdle, kAsked, kCopying, kCopied };

    std::atomic<State> state_ = State::kIdle;
    MemoryBlock workspace_;
    std::vector<std::byte> piece_;
};

// From the bytes of a map file, as they come, the points that stand still (weight of half and more); no other byte is
// looked at.
class MapPointReader {
public:
    explicit MapPointReader(const MapFileInfo& info);
    // False: they have all been read.
    bool read(std::span<const std::byte> bytes, std::vector<ShownPoint>& points);

private:
    std::uint64_t at_ = 0, first_ = 0, end_ = 0;  // bytes of the file
    std::vector<std::byte> record_;               // one that came in part
};

}  // namespace stillmesh
