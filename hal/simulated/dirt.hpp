// What real cameras, hands and rooms do to a picture and a clean simulation does not, each with a strength: 0 is off, 1
// an ordinary Kinect in an ordinary hand and office. One table; command line, tables and tests go through it.
#pragma once

#include <cstdint>
#include <string>

namespace stillmesh {

// Name, what it does at strength 1.
#define STILLMESH_DIRT(DIRT)                                                                                       \
    DIRT(rolling, "rows are read one after the other: colour within 28 ms, depth within 17")                       \
    DIRT(shake, "the hand trembles at 8 to 12 Hz, by up to 1.8 mm and .5 degrees an axis")                         \
    DIRT(aside, "every 5 s a look aside and back: 60 degrees, at 100 degrees/s")                                   \
    DIRT(borders,                                                                                                  \
         "the depth camera is tilted by .2 degrees, 2 mm aside, its focal length .5 % off: borders lie 1 to 3 px " \
         "apart")                                                                                                  \
    DIRT(calibration, "the engine is told a focal length .3 % and a centre 1.5 px off")                            \
    DIRT(late, "depth is 0 to 25 ms late, in a slow wave; its stamps say half of it")                              \
    DIRT(scale, "depth is up to 1.5 % off in a smooth fixed pattern, and drifts by .4 %")                          \
    DIRT(noise, "depth noise is 1.5 times as large; half of it stays for half a second, over 6 px")                \
    DIRT(ragged, "borders in depth are ragged, with pixels between the two depths")                                \
    DIRT(dark, "dark surfaces measure .9 % too far")                                                               \
    DIRT(shadows, "people cast shadows on floor and walls")                                                        \
    DIRT(folds, "clothes fold by 6 to 11 mm, and the folds wander")                                                \
    DIRT(hunting, "the automatic exposure hunts by a third")                                                       \
    DIRT(flicker, "lamps flicker at 100 Hz: bands of 9 % over the rows")                                           \
    DIRT(jpeg, "colour went through JPEG of quality 70; at 2 of 40")                                               \
    DIRT(gaps, "2 to 6 frames are missing every 4 s")                                                              \
    DIRT(stamps, "time stamps are up to 2 ms off")                                                                 \
    DIRT(manners, "people sit still for 5 s and rise, stand still, or stand 65 cm before the camera for 2 s")      \
    DIRT(things, "a chair is pushed aside, a door opens or a mirror hangs there, screens play")

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
