// Which device is meant: a file, the first that can be opened, or the one with a URI or a serial number. Only the one
// meant is opened where its URI says which it is. What cannot be had is refused with the reason and with what there is.
#pragma once

#include <OpenNI.h>

#include <string>

#include "engine/base/status.hpp"
#include "hal/openni2/openni2_runtime.hpp"

namespace stillmesh::openni2 {

// A recording, by its name or because there is such a file.
[[nodiscard]] bool names_file(const std::string& device);
// OpenNI2's last word, on one line.
[[nodiscard]] std::string extended_error();

struct DeviceChoice {
    Status status = Status::kUnavailable;  // kOk: `device` is open; kUnavailable: not now; kInvalid: never
    std::string message;                   // why not
    std::string description;               // maker, name, URI, serial number; of a file its name
    std::string uri;                       // empty: a file
};
// Opens `device`. `wanted`: "auto" or empty, a URI, a serial number; a file's name if `is_file`.
[[nodiscard]] DeviceChoice open_device(Runtime& runtime, const std::string& wanted, bool is_file,
                                       openni::Device& device);

}  // namespace stillmesh::openni2
