// Engines whose maps go to bytes and back.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/engine_state.hpp"
#include "engine/record/map_file.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/support/map_hash.hpp"

namespace stillmesh::test {

using Bytes = std::vector<std::byte>;

inline Map& map_of(Engine& engine) {
    return static_cast<EngineState&>(engine).world.map;
}

inline std::uint64_t map_hash(Engine& engine) {
    return map_hash(map_of(engine), static_cast<EngineState&>(engine).world.camera);
}

// A workspace for copies; what lies behind it must stay as it is.
class CopySpace {
public:
    explicit CopySpace(const Limits& limits) : memory_(map_copy_bytes(limits)) {}
    [[nodiscard]] std::span<std::byte> span() { return memory_.span(); }
    // The file of the finished copy, fetched in pieces of this size.
    [[nodiscard]] Bytes file(std::size_t piece_bytes = 4096) {
        MapFileWriter writer(memory_.span());
        Bytes out;
        Bytes piece(piece_bytes);
        while (const std::size_t size = writer.next(piece)) {
            out.insert(out.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
        }
        return out;
    }

private:
    Memory memory_;
};

inline Bytes saved(Engine& engine, const Limits& limits) {
    CopySpace space(limits);
    if (engine.begin_map_copy(space.span()) != Status::kOk) return {};
    while (engine.step_map_copy(1000) == Progress::kWorking) {
    }
    return space.file();
}

inline MapFileInfo info_of(const Bytes& file) {
    MapFileInfo info;
    MapFileProblem problem;
    if (read_map_header(file, info, problem) != Status::kOk) return {};
    return info;
}

// Runs frames [first, last) of a sequence, with background work as the configuration grants it.
inline void run(Engine& engine, const Sequence& sequence, std::size_t first, std::size_t last,
                std::uint32_t units = 20000) {
    for (std::size_t i = first; i < last; ++i) {
        static_cast<void>(engine.submit(sequence.frames[i].frame()));
        static_cast<void>(engine.step(units));
    }
}

// The same pictures with 150 ms between two: depth images are of a second each.
inline Sequence slowed(Sequence sequence) {
    for (std::size_t i = 0; i < sequence.frames.size(); ++i)
        sequence.frames[i].time_ns = static_cast<std::int64_t>(i) * 150'000'000;
    return sequence;
}

inline std::uint64_t number_at(const Bytes& file, std::size_t at, std::size_t bytes) {
    std::uint64_t out = 0;
    for (std::size_t i = 0; i < bytes; ++i) out |= std::to_integer<std::uint64_t>(file[at + i]) << (8 * i);
    return out;
}
inline void put(Bytes& file, std::size_t at, std::uint64_t value, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) file[at + i] = static_cast<std::byte>(value >> (8 * i) & 0xffU);
}

// Gives header and sections the CRC that their bytes have, so that what lies behind it is reached.
inline void mend(Bytes& file) {
    if (file.size() < kMapHeaderBytes) return;
    put(file, kMapHeaderBytes - 4, crc32(std::span(file).first(kMapHeaderBytes - 4)), 4);
    std::size_t at = kMapHeaderBytes;
    while (file.size() - at >= 20) {
        const std::uint64_t size = number_at(file, at + 8, 8);
        if (size > file.size() - at - 20) return;
        const std::size_t end = at + 16 + static_cast<std::size_t>(size);
        put(file, end, crc32(std::span(file).subspan(at, end - at)), 4);
        at = end + 4;
    }
}

}  // namespace stillmesh::test
