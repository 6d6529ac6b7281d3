// A simulated scene by its name, as people write it: SCENE[:SEED[+DAY]].
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace stillmesh {

struct SceneName {
    std::string name;  // such as walking_xyz
    std::uint64_t seed = 1;
    std::uint64_t day = 0;  // not 0: the same room, another day
};

// Sets what the text says; a seed or a day that it does not name stays. False: a sentence in `message`, that begins
// with the text.
[[nodiscard]] bool parse_scene_name(std::string_view text, SceneName& out, std::string& message);

}  // namespace stillmesh
