// Where depth images come from: an engine that runs, or a map that was read from a file. Borrowed; two pointers.
#pragma once

#include <concepts>
#include <cstdint>

#include "engine/outputs.hpp"

namespace stillmesh {

template <typename T>
concept HasDepthImages = requires(const T& from, std::uint32_t index) {
    { from.depth_image(index) } -> std::same_as<DepthImage>;
};

class DepthSource {
public:
    // Not explicit: whoever has depth images is one.
    template <HasDepthImages T>
    DepthSource(const T& from) noexcept  // NOLINT(google-explicit-constructor)
        : from_(&from), at_([](const void* source, std::uint32_t index) {
              return static_cast<const T*>(source)->depth_image(index);
          }) {}
    // Without cells: there is none of this index.
    [[nodiscard]] DepthImage depth_image(std::uint32_t index) const { return at_(from_, index); }

private:
    const void* from_;
    DepthImage (*at_)(const void*, std::uint32_t);
};

}  // namespace stillmesh
