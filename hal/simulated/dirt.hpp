// What real cameras, hands and rooms do to a picture and a clean simulation does not, each with a strength: 0 is off, 1
// an ordinary Kinect in an ordinary hand and office. One table; command line, tables and tests go through it.
#pragma once

#include <cstdint>
#include <string>

namespace stillmesh {

// Name, what it does at strength 1.
#define STILLMESH_DIRT(DIRT)                                                                 \
    DIRT(rolling, "rows are read one after the other: colour within 28 ms, depth within 17") \
    DIRT(shake, "the hand trembles at 8 to 12 Hz, by up to 1.8 mm and .5 degrees an axis")   \
    DIRT(aside, "every 5 s a look aside and back: 60 degrees, at 100 degrees/s")

struct Dirt {
    // Negative: what the scene has.
#define STILLMESH_DIRT_MEMBER(name, text) double name = -1;
    STILLMESH_DIRT(STILLMESH_DIRT_MEMBER)
#undef STILLMESH_DIRT_MEMBER
    friend bool operator==(const Dirt&, const Dirt&) = default;
};

inline constexpr double kDirtMax = 10;

#define STILLMESH_DIRT_COUNT(name, text) +1
inline constexpr std::uint32_t kDirtCount = 0 STILLMESH_DIRT(STILLMESH_DIRT_COUNT);
#undef STILLMESH_DIRT_COUNT

// visit(name, strength, text) for every effect, in the table's order; the strength may be written to.
template <typename AnyDirt, typename Visit>
constexpr void visit_dirt(AnyDirt& dirt, Visit&& visit) {
#define STILLMESH_DIRT_VISIT(name, text) visit(#name, dirt.name, text);
    STILLMESH_DIRT(STILLMESH_DIRT_VISIT)
#undef STILLMESH_DIRT_VISIT
}

// Every effect at this strength.
[[nodiscard]] constexpr Dirt all_dirt(double strength) noexcept {
    Dirt dirt;
    visit_dirt(dirt, [&](const char*, double& value, const char*) { value = strength; });
    return dirt;
}
// `over` where it says something, else `under`.
[[nodiscard]] Dirt laid_over(const Dirt& under, const Dirt& over) noexcept;
// Nothing is on.
[[nodiscard]] bool is_clean(const Dirt& dirt) noexcept;

// "shake=1,rolling=.5", "all=0,jpeg=1": from left to right, into `dirt`. False: `message` says what is wrong.
[[nodiscard]] bool parse_dirt(const std::string& text, Dirt& dirt, std::string& message);
// The other way; what the scene decides is left out.
[[nodiscard]] std::string dirt_text(const Dirt& dirt);

}  // namespace stillmesh
