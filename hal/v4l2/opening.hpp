// Everything between a name and two running streams: nodes chosen, modes tried from the best on, the camera's own
// calibration read, exposure set. What was found is told, not assumed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/v4l2/camera_choice.hpp"
#include "hal/v4l2/frame_conversion.hpp"
#include "hal/v4l2/image_stream.hpp"
#include "hal/v4l2/metadata_stream.hpp"

namespace stillmesh::v4l2 {

struct OpeningWishes {
    std::string device;       // as of choose_camera
    std::string calibration;  // what `given` was read from; empty: the camera's own is wanted
    CameraInfo given;         // of the colour camera, perhaps of depth's too
    ModeWishes modes;
    Identity known;  // of the camera that was opened before
    bool is_exposure_fixed = false;
    bool is_registered = false;
};

struct Opened {
    Identity identity;
    CameraPair cameras;
    double frames_per_s = 30;
    double readout_s = -1;
    bool is_infrared = false;         // the left infrared camera stands for colour
    bool is_alternating = false;      // pictures without the projector go with depth from the images before, with it
    std::int64_t period_us = 33'333;  // of pairs
    std::int64_t apart_us = 16'667;   // the two images of a pair at most
    std::string description, calibration_source;
    std::vector<std::string> notes;
};

// The streams and the handles they run on, closed when it goes out of use.
class Opening {
public:
    explicit Opening(V4l2Link& link) noexcept
        : depth(link), colour(link), depth_metadata(link), colour_metadata(link), link_(link) {}
    ~Opening() { close(); }
    Opening(const Opening&) = delete;
    Opening& operator=(const Opening&) = delete;

    // kOk: both run. kUnavailable: not now; kInvalid: never as it is. `message` says why.
    [[nodiscard]] Status open(const OpeningWishes& wishes, Opened& opened, std::string& message);
    // No image is held by then.
    void close() noexcept;

    ImageStream depth, colour;
    MetadataStream depth_metadata, colour_metadata;  // of a RealSense; off where there is none

private:
    [[nodiscard]] Status start_streams(const CameraChoice& choice, const OpeningWishes& wishes, std::string& message);
    [[nodiscard]] Status calibrate_realsense(const V4l2Node& node, const OpeningWishes& wishes, Opened& opened,
                                             std::string& message);
    [[nodiscard]] Status calibrate_other(const OpeningWishes& wishes, Opened& opened, std::string& message);
    [[nodiscard]] Status adopt_given(const OpeningWishes& wishes, Opened& opened, std::string& message);
    void set_exposure(const OpeningWishes& wishes, Opened& opened);
    [[nodiscard]] Status set_turns(const CameraChoice& choice, std::string& message);
    void set_emitter(Opened& opened);
    void open_metadata(const CameraChoice& choice);
    void start_metadata(const CameraChoice& choice, Opened& opened);
    void note_metadata(const std::string& path, int error);

    V4l2Link& link_;
    int depth_handle_ = -1, colour_handle_ = -1;
    std::string metadata_problem_;  // why images have no times of the camera's; empty: they have
};

}  // namespace stillmesh::v4l2
