// A block for whatever plans its memory: of exactly the planned size, so that one byte too many is seen.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <span>

#include "engine/base/arena.hpp"

namespace stillmesh::test {

class Memory {
public:
    explicit Memory(std::size_t size_bytes)
        : size_bytes_(size_bytes), block_(new (std::align_val_t(kArenaAlignment)) std::byte[size_bytes]) {}
    [[nodiscard]] std::span<std::byte> span() const { return {block_.get(), size_bytes_}; }

private:
    struct Free {
        void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t(kArenaAlignment)); }
    };
    std::size_t size_bytes_;
    std::unique_ptr<std::byte[], Free> block_;
};

// A room of the engine in memory of its own: Room::plan(plan, arguments...) and room.create(arena, arguments...).
template <typename Room>
class InMemory {
public:
    template <typename... Arguments>
    explicit InMemory(const Arguments&... arguments) : memory_(planned_bytes(arguments...)) {
        Arena arena(memory_.span());
        room_.create(arena, arguments...);
        used_bytes_ = arena.used_bytes();
    }
    [[nodiscard]] Room* operator->() { return &room_; }
    [[nodiscard]] Room& operator*() { return room_; }
    [[nodiscard]] std::size_t used_bytes() const { return used_bytes_; }
    [[nodiscard]] std::size_t planned_bytes() const { return memory_.span().size(); }

private:
    template <typename... Arguments>
    static std::size_t planned_bytes(const Arguments&... arguments) {
        ArenaPlan plan;
        Room::plan(plan, arguments...);
        return plan.used_bytes();
    }
    Memory memory_;
    Room room_;
    std::size_t used_bytes_ = 0;
};

}  // namespace stillmesh::test
