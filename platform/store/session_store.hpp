// How a run's configuration becomes a store's options: the same for a run and for its repetition.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/configuration.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/limits.hpp"
#include "platform/store/store_service.hpp"

namespace stillmesh {

[[nodiscard]] inline RegionStoreOptions store_options(const std::string& folder, const Configuration& configuration,
                                                      const CameraModel& camera_model, std::uint8_t extractor,
                                                      std::uint32_t vocabulary_crc) {
    const CameraModel c = camera_model.with_plain_zeros();
    RegionStoreOptions out;
    out.folder = folder;
    out.regions_max = configuration.store.regions_max;
    out.twin_m = configuration.store.twin_m;
    out.origin.vocabulary_crc = vocabulary_crc;
    std::array<std::byte, 128> bytes{};
    ByteWriter camera(bytes);
    camera.u32(c.width);
    camera.u32(c.height);
    for (const double number : {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3}) camera.f64(number);
    if (!c.is_plain_brown()) {
        camera.u8(static_cast<std::uint8_t>(c.lens));
        for (const double number : {c.k4, c.k5, c.k6}) camera.f64(number);
    }
    out.origin.camera_crc = crc32(camera.written());
    ByteWriter features(bytes);
    features.u8(extractor);
    features.u32(configuration.features.levels);
    features.f64(configuration.features.scale_factor);
    out.origin.features_crc = crc32(features.written());
    return out;
}

// Room for any region of an engine with these limits (engine/paging/region.hpp counts them; this is never less).
[[nodiscard]] inline std::size_t store_body_bytes_max(const Limits& limits) {
    return std::size_t{512} + std::size_t{256} * limits.store_features_max;
}

}  // namespace stillmesh
