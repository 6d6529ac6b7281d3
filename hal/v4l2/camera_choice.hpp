// Which video nodes make a depth camera: the first USB device with a node for depth and one for colour, the one with a
// serial number, or two nodes by name; and, once one was opened, that one and no other, wherever it is plugged in
// again and whatever its nodes are called then. Nodes are opened to be asked what they offer, which disturbs nobody who
// streams from them. What cannot be had is refused with the reason and with what there is.
#pragma once

#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "hal/v4l2/stream_modes.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

// A node that was opened and asked.
struct AskedNode {
    V4l2Node node;
    int error = 0;            // why it could not be opened or asked
    bool is_capture = false;  // else it carries metadata, or is no camera
    std::vector<Mode> modes;
};
[[nodiscard]] AskedNode ask_node(V4l2Link& link, const V4l2Node& node);
[[nodiscard]] bool has_depth(const AskedNode& node) noexcept;
[[nodiscard]] bool has_colour(const AskedNode& node) noexcept;

// A camera that was opened before; empty: none was.
struct Identity {
    std::string serial, usb_port;  // of the USB device
    std::uint16_t vendor_id = 0, product_id = 0;
    std::string depth_path, colour_path;
    std::uint8_t depth_interface = 0, colour_interface = 0;

    bool is_infrared = false, is_alternating = false;

    [[nodiscard]] bool is_known() const noexcept { return !depth_path.empty(); }
};

struct CameraChoice {
    Status status = Status::kUnavailable;  // kOk: both nodes are there; kUnavailable: not now; kInvalid: never
    std::string message{};                 // why not
    AskedNode depth{}, colour{};
    std::string depth_metadata{}, colour_metadata{};  // the nodes behind them, of a RealSense; empty: none
    bool is_infrared = false;                         // a RealSense's left infrared camera stands for colour
    bool is_alternating = false;                      // and the projector is on for every other image
};
// `wanted`: empty, a serial number, or "DEPTH_NODE,COLOUR_NODE"; "ir" or "SERIAL,ir": of a RealSense the left infrared
// camera for colour; "alternate" or "SERIAL,alternate": likewise, with a projector that takes turns. `known`: then only
// that camera.
[[nodiscard]] CameraChoice choose_camera(V4l2Link& link, const std::string& wanted, const Identity& known);

// A sentence about a node that cannot be used, for the user.
[[nodiscard]] std::string why_not(const std::string& path, int error);
// "RealSense D435 (8086:0b07), serial 123"
[[nodiscard]] std::string camera_text(const V4l2Node& node);

}  // namespace stillmesh::v4l2
