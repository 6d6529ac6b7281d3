// How the bytes of an input of fuzz_engine are meant: a head (configuration and camera), then acts. Every byte string
// is an input. For the mutator: where its parts begin, and how new ones are made.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "engine/base/random.hpp"
#include "fuzz/fuzz.hpp"
#include "fuzz/small_engine.hpp"

namespace stillmesh::fuzz {

// The first byte of an act that is no frame.
inline constexpr std::uint8_t kActReset = 255;
inline constexpr std::uint8_t kActStep = 254;  // then units, 16 bits; the highest says: of the store
inline constexpr std::uint8_t kActMap = 253;   // the map is written and loaded again; then how it is used
// One byte of a region in the store: which, place (16 bits), value; or, of which % 8 == 7, what the store says it
// holds.
inline constexpr std::uint8_t kActHarm = 252;

// Of any other first byte: a frame.
constexpr bool is_drawn(std::uint8_t what) {
    return what % 16 < 12;
}  // else from textures
constexpr bool has_body(std::uint8_t what) {
    return what / 3 % 2 == 1;
}
constexpr bool is_wrong(std::uint8_t what) {
    return what / 16 % 4 == 3;
}
inline constexpr std::uint8_t kWrongs = 12;  // ways to be wrong; the last has a time of 8 bytes

// --- The head. First byte: how many parameters are changed, and, in the next bit, whether times are short.
constexpr bool has_short_times(std::uint8_t first) {
    return first / 8 % 2 == 1;
}
// The byte of the camera.
constexpr bool is_camera_any(std::uint8_t how) {
    return how % 4 == 3;
}
constexpr bool is_stepping(std::uint8_t how) {
    return how / 4 % 2 == 1;
}  // after every frame
constexpr bool has_words(std::uint8_t how) {
    return how / 8 % 2 == 1;
}  // a vocabulary
constexpr bool has_store(std::uint8_t how) {
    return how / 16 % 2 == 1;
}

// Up to 7 parameters anywhere in their ranges; what else would take hundreds of frames is made to happen within some.
inline Configuration configuration_from(Bytes& bytes) {
    Configuration configuration = small_configuration();
    const std::uint8_t first = bytes.u8();
    if (has_short_times(first)) {
        configuration.keyframes.gap_min = 1;
        configuration.keyframes.new_points_min = 4;
        configuration.keyframes.tracked_share_max = 1;
        configuration.loop.gap_frames = 4;
        configuration.loop.consistency = 0;
        configuration.loop.inliers_min = 8;
        configuration.store.gap_frames = 3;
        configuration.recovery.probation_frames = 1;
        configuration.pose.lost_frames_max = 2;
    }
    for (int changes = first % 8; changes > 0; --changes) {
        const std::uint32_t which = bytes.u8();
        const double part = bytes.u16() / 65535.0;
        std::uint32_t index = 0;
        visit_parameters(configuration,
                         [&](const char*, auto& value, double min, double max, const char*, const char*) {
                             using Value = std::remove_reference_t<decltype(value)>;
                             if (index++ != which) return;
                             if constexpr (std::is_same_v<Value, bool>) {
                                 value = part < 0.5;
                             } else {
                                 value = static_cast<Value>(min + part * (max - min));
                             }
                         });
    }
    return configuration;
}

// `how`: its byte, from the input.
inline CameraModel camera_from(Bytes& bytes, std::uint8_t how) {
    CameraModel camera = small_camera();
    if (how % 4 == 1) {
        camera.k1 = 0.2624;
        camera.k2 = -0.9531;
        camera.p1 = -0.0054;
        camera.p2 = 0.0026;
        camera.k3 = 1.1633;
    } else if (how % 4 == 2) {
        camera.width = 65;
        camera.height = 50;
        camera.cx = 33;
        camera.cy = 25;
    } else if (is_camera_any(how)) {
        camera.width = bytes.u8();
        camera.height = bytes.u8();
        for (double* const number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.k1, &camera.p1}) {
            const std::uint8_t kind = bytes.u8();
            if (kind == 0) *number = std::numeric_limits<double>::quiet_NaN();
            if (kind == 1) *number = std::numeric_limits<double>::infinity();
            if (kind == 2) *number = 0;
            if (kind > 200) *number = kind - 228;
        }
    }
    return camera;
}

// --- For the mutator.
inline std::size_t engine_piece_bytes(std::span<const std::uint8_t> rest, bool is_head) {
    const auto at = [&](std::size_t i) { return i < rest.size() ? rest[i] : std::uint8_t{0}; };
    if (is_head) {
        const std::size_t camera = 1 + std::size_t{3} * (at(0) % 8);
        return camera + 1 + (is_camera_any(at(camera)) ? 8U : 0U);
    }
    const std::uint8_t what = at(0);
    if (what == kActReset) return 1;
    if (what == kActStep) return 3;
    if (what == kActMap) return 2;
    if (what == kActHarm) return 5;
    std::size_t size = 1;
    if (is_drawn(what)) {
        size += 2;
    } else {
        size += 5 + (1U + at(size + 4) % 64);      // colour
        size += 5 + 2 * (1U + at(size + 4) % 64);  // depth
    }
    if (is_wrong(what)) size += at(size) % kWrongs == kWrongs - 1 ? 9U : 1U;
    return size;
}

inline std::uint8_t any_byte(Random& random) {
    return static_cast<std::uint8_t>(random.below(256));
}

inline std::vector<std::uint8_t> engine_head(Random& random) {
    const std::uint32_t changes = random.below(2) == 0 ? 0 : random.below(4);
    std::vector<std::uint8_t> head = {static_cast<std::uint8_t>(changes + 8 * random.below(2))};
    for (std::uint32_t i = 0; i < changes; ++i) {
        head.push_back(static_cast<std::uint8_t>(random.below(64)));
        head.push_back(any_byte(random));
        head.push_back(any_byte(random));
    }
    const auto camera = static_cast<std::uint8_t>(random.below(16) == 0 ? 3 : random.below(3));
    head.push_back(static_cast<std::uint8_t>(camera + 4 * random.below(8)));
    for (std::uint32_t i = 0; camera == 3 && i < 8; ++i) head.push_back(any_byte(random));
    return head;
}

// A few drawn frames of one motion, or one act of another kind.
inline std::vector<std::uint8_t> engine_acts(Random& random) {
    const auto move = [&] {  // seldom more than two pixels; the body seldom stands
        return static_cast<std::uint8_t>(2 + random.below(4) + 8 * random.below(3) + 32 * random.below(8));
    };
    std::vector<std::uint8_t> out;
    switch (random.below(13)) {
        case 0: return {kActReset};
        case 1:
        case 2:
            return {kActStep, any_byte(random), static_cast<std::uint8_t>(random.below(16) + 128 * random.below(2))};
        case 3: return {kActMap, any_byte(random)};
        case 4:  // wrong in one way
            out = {static_cast<std::uint8_t>(48 + random.below(12)), move(), 0,
                   static_cast<std::uint8_t>(random.below(kWrongs))};
            if (out.back() == kWrongs - 1) {
                for (int i = 0; i < 8; ++i) out.push_back(any_byte(random));
            }
            return out;
        case 5: {  // from textures
            out = {static_cast<std::uint8_t>(12 + random.below(4))};
            for (std::uint32_t bytes_per_value = 1; bytes_per_value <= 2; ++bytes_per_value) {
                const std::uint32_t values = random.below(12);
                for (int i = 0; i < 4; ++i) out.push_back(any_byte(random));
                out.push_back(static_cast<std::uint8_t>(values));
                for (std::uint32_t i = 0; i < (values + 1) * bytes_per_value; ++i) out.push_back(any_byte(random));
            }
            return out;
        }
        case 12:
            return {kActHarm, any_byte(random), any_byte(random), static_cast<std::uint8_t>(random.below(32)),
                    any_byte(random)};
        case 6: return {static_cast<std::uint8_t>(200 + random.below(8)), move(), 0};  // a leap in time
        default: break;
    }
    const std::uint8_t what = static_cast<std::uint8_t>(random.below(12)), how = move();
    for (std::uint32_t frames = 1 + random.below(8); frames > 0; --frames) {
        out.insert(out.end(), {what, how, static_cast<std::uint8_t>(random.below(4))});
    }
    return out;
}

}  // namespace stillmesh::fuzz
