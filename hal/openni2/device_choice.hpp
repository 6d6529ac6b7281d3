// Which device is meant: a file, the first that can be opened, the one with a URI or a serial number; and, once one was
// opened, that one and no other, wherever it is plugged in again. Only the one meant is opened where its URI says which
// it is. What cannot be had is refused with the reason and with what there is.
#pragma once

#include <OpenNI.h>

#include <string>

#include "engine/base/status.hpp"
#include "hal/openni2/openni2_runtime.hpp"

namespace stillmesh::openni2 {

// A recording, by its name or because there is such a file.
[[nodiscard]] bool names_file(const std::string& device);

// A camera that was opened before; empty: none was.
struct DeviceIdentity {
    std::string uri;     // changes when it is plugged in again: bus and address are part of it
    std::string serial;  // empty: it does not say
};

struct DeviceChoice {
    Status status = Status::kUnavailable;  // kOk: `device` is open; kUnavailable: not now; kInvalid: never
    std::string message{};                 // why not
    std::string description{};             // maker, name, URI, serial number; of a file its name
    DeviceIdentity identity{};             // of a camera
};
// Opens `device`. `wanted`: "auto" or empty, a URI, a serial number. `known`: then only that camera is opened: by its
// serial number, else by its URI, else as the only one of its kind.
[[nodiscard]] DeviceChoice open_camera(Runtime& runtime, const std::string& wanted, const DeviceIdentity& known,
                                       openni::Device& device);
[[nodiscard]] DeviceChoice open_recording(const std::string& file, openni::Device& device);

}  // namespace stillmesh::openni2
