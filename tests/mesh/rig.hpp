// A Delaunay in a block of its own, of exactly the planned size.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <span>

#include "engine/mesh/delaunay.hpp"

namespace stillmesh::testing {

class MeshRig {
public:
    explicit MeshRig(std::uint32_t points_max) : bytes_(planned_bytes(points_max)), arena_(allocate(bytes_)) {
        block_.reset(last_);
        delaunay.create(arena_, points_max);
        arena_.seal();
    }
    static std::size_t planned_bytes(std::uint32_t points_max) {
        ArenaPlan plan;
        Delaunay::plan(plan, points_max);
        return plan.used_bytes();
    }
    std::size_t used_bytes() const { return arena_.used_bytes(); }

    Delaunay delaunay;

private:
    struct Free {
        void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t(kArenaAlignment)); }
    };
    std::span<std::byte> allocate(std::size_t bytes) {
        last_ = static_cast<std::byte*>(::operator new[](bytes, std::align_val_t(kArenaAlignment)));
        return {last_, bytes};
    }

    std::byte* last_ = nullptr;
    std::size_t bytes_;
    Arena arena_;
    std::unique_ptr<std::byte[], Free> block_;
};

}  // namespace stillmesh::testing
