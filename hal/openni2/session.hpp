// One opening of a device or a file: a thread that opens it, reads, pairs the images by time, puts the newest pair into
// one slot, records, and closes. The camera takes pairs out of the slot on its own thread.
#pragma once

#include <OpenNI.h>

#include <cstdint>
#include <memory>
#include <string>

#include "hal/live/live_session.hpp"
#include "hal/openni2/device_choice.hpp"
#include "hal/openni2/openni2_camera.hpp"
#include "hal/openni2/openni2_runtime.hpp"
#include "hal/openni2/stream_modes.hpp"

namespace stillmesh::openni2 {

struct Session : live::LiveSession<openni::VideoFrameRef> {
    // Of the thread that serves; the camera reads it once it is opened or closed.
    std::shared_ptr<Runtime> runtime;
    openni::Device device;
    Streams streams;
    openni::Recorder recorder;
    std::shared_ptr<DeviceWatch> watch = std::make_shared<DeviceWatch>();
    Status status = Status::kUnavailable;
    std::string message, description, record_file;
    bool is_file = false;
    DeviceIdentity identity;  // of the camera that was opened before; then of this one

    bool has_ended = false;  // the file; this and all below: under the mutex
    int colour_index = -1, depth_index = -1;
    std::int64_t last_colour_us = 0, last_depth_us = 0;

    // Opens, reads until it is told to close, closes: all on one thread, the only one that calls OpenNI2.
    void serve(const OpenNi2Options& options);

private:
    void open(const OpenNi2Options& options);
    void close();
    // One image of either stream; true: it made a pair, which is in the slot, or it is a file's first image again.
    bool take_in(openni::VideoStream& stream, std::int64_t arrival_ns);
    void read_live();
    void read_file();
    // One of both streams has an image within so long; null: none has.
    [[nodiscard]] openni::VideoStream* wait_for_image(int timeout_ms);
    // Of everything into a file; kInvalid: it cannot be written, `message` says why.
    [[nodiscard]] Status record(const std::string& file);
};

}  // namespace stillmesh::openni2
