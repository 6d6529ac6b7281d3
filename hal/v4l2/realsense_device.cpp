#include "hal/v4l2/realsense_device.hpp"

#include <cerrno>
#include <cstring>

namespace stillmesh::v4l2 {
namespace {

// uvcvideo asks a camera that stalls a request why, and has a number of errno for each answer (uvc_query_ctrl in
// drivers/media/usb/uvc/uvc_video.c); the text of EILSEQ would be about characters.
[[nodiscard]] const char* refusal_text(int error) noexcept {
    switch (error) {
        case EBUSY: return "not ready";
        case EILSEQ:
        case EACCES: return "wrong state";
        case EREMOTE: return "not enough power";
        case EBADRQC: return "unknown request";
        default: return std::strerror(error);
    }
}

}  // namespace

Status RealSenseDevice::ask_once(Command command, std::uint32_t parameter, Message& answer,
                                 std::span<const std::uint8_t>& body, std::string& message) {
    answer = command_message(command, parameter);
    int error = link_.extension(handle_, kRealSenseUnit, kCommandControl, V4l2Query::kSet, answer);
    answer = {};
    if (error == 0) error = link_.extension(handle_, kRealSenseUnit, kCommandControl, V4l2Query::kGet, answer);
    if (error == 0) return answer_body(command, answer, body, message);
    message = std::string("the camera refuses to be asked (") + refusal_text(error) + ")";
    return error == ENODEV ? Status::kUnavailable : Status::kCorrupt;
}

template <typename Take>
Status RealSenseDevice::ask(Command command, std::uint32_t parameter, std::string& message, Take&& take) {
    Status status = Status::kCorrupt;
    for (int tries = 0; tries < 2 && status == Status::kCorrupt; ++tries) {
        Message answer;
        std::span<const std::uint8_t> body;
        status = ask_once(command, parameter, answer, body, message);
        if (status == Status::kOk) status = take(body);
    }
    return status;
}

Status RealSenseDevice::read_details(DeviceDetails& details, std::string& message) {
    return ask(Command::kDetails, 0, message, [&](auto body) { return parse_details(body, details, message); });
}

Status RealSenseDevice::read_depth_units(double& depth_units_per_m, std::string& message) {
    return ask(Command::kAdvanced, kDepthUnits, message,
               [&](auto body) { return parse_depth_units(body, depth_units_per_m, message); });
}

Status RealSenseDevice::set_alternating(bool is_on, std::string& message) {
    return ask(Command::kAlternate, is_on ? 1 : 0, message, [](auto) { return Status::kOk; });
}

Status RealSenseDevice::read_depth(CameraModel& depth, std::string& message) {
    return ask(Command::kCalibration, kDepthTable, message,
               [&](auto body) { return parse_depth_table(body, depth, message); });
}

Status RealSenseDevice::read_colour(std::uint16_t product_id, RealSenseCalibration& calibration, std::string& message) {
    return ask(Command::kCalibration, kColourTable, message, [&](auto body) {
        return parse_colour_table(body, product_id, calibration.colour, calibration.colour_from_depth, message);
    });
}

}  // namespace stillmesh::v4l2
