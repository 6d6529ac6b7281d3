// Where a run writes to, checked before anything is begun: a start that is refused has changed nothing.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stillmesh {

enum class DestinationKind : std::uint8_t {
    kLines,      // written line by line: a file, or a pipe or device
    kWhole,      // replaced as a whole when it is complete: a file; a pipe or device is written to
    kFile,       // a regular file or none yet: it is written over
    kFolder,     // made if it is not there
    kNewFolder,  // the same, and empty if it is there
};

struct Destination {
    const char* option;  // as it is typed
    std::string path;
    DestinationKind kind;
    bool may_be_standard_output = false;  // "-"
};

// What a run reads, and must not write over: option and path, and the option that may write over it all the same.
struct Origin {
    const char* option;
    std::string path;
    const char* writer = "";
};

// Empty: each can be written, no two are one, and none is an origin. Else a sentence that names option and path. Writes
// nothing.
[[nodiscard]] std::string check_destinations(std::span<const Destination> destinations,
                                             std::span<const Origin> origins);

}  // namespace stillmesh
