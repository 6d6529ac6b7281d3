#include "tests/vm/d435_descriptors.hpp"

namespace vm {
namespace {

constexpr std::uint8_t kInterface = 4, kEndpoint = 5, kAssociation = 11, kClassInterface = 0x24, kCompanion = 0x30;
constexpr std::uint8_t kVideo = 14, kControl = 1, kStreaming = 2, kCollection = 3;

// GUIDs of formats begin with the four letters of a FOURCC, and end alike.
constexpr std::array<std::uint8_t, 16> format(char a, char b, char c, char d) {
    const auto byte = [](char letter) { return static_cast<std::uint8_t>(letter); };
    return {byte(a), byte(b), byte(c), byte(d), 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71};
}

// Infrared is Direct3D's L8, whose letters are the number 50.
constexpr std::array<VideoStream, 3> kStreams = {{
    {"depth", 1, 2, 4, format('Z', '1', '6', ' '), 16, {{{640, 480}, {848, 480}}}},
    {"infrared", 2, 3, 5, format('2', 0, 0, 0), 8, {{{640, 480}, {848, 480}}}},
    {"colour", 4, 4, 3, format('Y', 'U', 'Y', '2'), 16, {{{640, 480}, {1280, 720}}}},
}};

void append(Bytes& bytes, const Bytes& more) {
    bytes.insert(bytes.end(), more.begin(), more.end());
}

Bytes interface(std::uint8_t number, std::uint8_t endpoints, std::uint8_t subclass, std::uint8_t name) {
    return {9, kInterface, number, 0, endpoints, kVideo, subclass, 0, name};
}

// Which interfaces are one function.
Bytes association(std::uint8_t first, std::uint8_t count, std::uint8_t name) {
    return {8, kAssociation, first, count, kVideo, kCollection, 0, name};
}

Bytes camera_terminal() {
    return {18, kClassInterface, 2, 1, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0};
}
Bytes processing_unit() {
    return {13, kClassInterface, 5, 2, 1, 0, 0, 3, 0, 0, 0, 0, 0};
}
Bytes output_terminal(std::uint8_t id, std::uint8_t source) {
    return {9, kClassInterface, 3, id, 0x01, 0x01, 0, source, 0};
}

// {C9606CCB-594C-4D25-AF47-CCC496435995}, with its controls 1 to 4: monitor, emitter, exposure, laser power.
Bytes extension_unit() {
    return {26,   kClassInterface,
            6,    kMonitorUnit,
            0xcb, 0x6c,
            0x60, 0xc9,
            0x4c, 0x59,
            0x25, 0x4d,
            0xaf, 0x47,
            0xcc, 0xc4,
            0x96, 0x43,
            0x59, 0x95,
            4,    1,
            2,    1,
            0x0f, 0};
}

// A video control interface: its header, which names the streaming interfaces and how long all is, and `units`.
Bytes video_control(std::uint8_t number, const Bytes& units, const Bytes& streaming, std::uint8_t name) {
    Bytes head = {static_cast<std::uint8_t>(12 + streaming.size()), kClassInterface, 1};
    put16(head, 0x0150);
    put16(head, static_cast<std::uint32_t>(12 + streaming.size() + units.size()));
    put32(head, 1'000'000);  // clock of time stamps, Hz
    head.push_back(static_cast<std::uint8_t>(streaming.size()));
    append(head, streaming);
    Bytes bytes = interface(number, 0, kControl, name);
    append(bytes, head);
    append(bytes, units);
    return bytes;
}

Bytes frame(const VideoStream& stream, std::uint8_t index) {
    const FrameSize size = stream.sizes[index - 1U];
    const std::uint32_t frame_bytes = size.width * size.height * stream.bits_per_pixel / 8;
    Bytes bytes = {34, kClassInterface, 5, index, 0};
    put16(bytes, size.width);
    put16(bytes, size.height);
    put32(bytes, frame_bytes * 8 * 15);
    put32(bytes, frame_bytes * 8 * 30);
    put32(bytes, frame_bytes);
    put32(bytes, kFastest);
    bytes.push_back(2);  // two intervals
    put32(bytes, kFastest);
    put32(bytes, kSlowest);
    return bytes;
}

Bytes video_streaming(const VideoStream& stream, UsbSpeed speed) {
    Bytes formats = {27, kClassInterface, 4, 1, static_cast<std::uint8_t>(stream.sizes.size())};
    formats.insert(formats.end(), stream.format.begin(), stream.format.end());
    append(formats, {stream.bits_per_pixel, 1, 0, 0, 0, 0});
    for (std::uint8_t i = 1; i <= stream.sizes.size(); ++i) append(formats, frame(stream, i));
    append(formats, {6, kClassInterface, 13, 1, 1, 4});  // colours: sRGB, BT.709, SMPTE 170M
    const auto address = static_cast<std::uint8_t>(0x80U | stream.endpoint);
    Bytes head = {14, kClassInterface, 1, 1};
    put16(head, static_cast<std::uint32_t>(14 + formats.size()));
    append(head, {address, 0, stream.terminal, 0, 0, 0, 1, 0});
    Bytes bytes = interface(stream.interface, 1, kStreaming, 0);
    append(bytes, head);
    append(bytes, formats);
    append(bytes, {7, kEndpoint, address, 2});
    put16(bytes, speed == UsbSpeed::kSuper ? 1024 : 512);
    bytes.push_back(0);
    if (speed == UsbSpeed::kSuper) append(bytes, {6, kCompanion, 15, 0, 0, 0});
    return bytes;
}

Bytes configuration(UsbSpeed speed) {
    Bytes stereo = camera_terminal(), colour = camera_terminal();
    append(stereo, processing_unit());
    append(stereo, extension_unit());
    append(stereo, output_terminal(kStreams[0].terminal, kMonitorUnit));
    append(stereo, output_terminal(kStreams[1].terminal, kMonitorUnit));
    append(colour, processing_unit());
    append(colour, output_terminal(kStreams[2].terminal, 2));
    Bytes bytes = {
        9, 2, 0, 0, 5, 1, 0, 0x80, static_cast<std::uint8_t>(speed == UsbSpeed::kSuper ? 55 : 220)};  // 440 mA
    append(bytes, association(kStereoControl, 3, 4));
    append(bytes, video_control(kStereoControl, stereo, {kStreams[0].interface, kStreams[1].interface}, 4));
    append(bytes, video_streaming(kStreams[0], speed));
    append(bytes, video_streaming(kStreams[1], speed));
    append(bytes, association(kColourControl, 2, 5));
    append(bytes, video_control(kColourControl, colour, {kStreams[2].interface}, 5));
    append(bytes, video_streaming(kStreams[2], speed));
    bytes[2] = static_cast<std::uint8_t>(bytes.size());
    bytes[3] = static_cast<std::uint8_t>(bytes.size() >> 8U);
    return bytes;
}

}  // namespace

std::span<const VideoStream> video_streams() {
    return kStreams;
}

StandardAnswers d435_descriptors(UsbSpeed speed) {
    const bool is_super = speed == UsbSpeed::kSuper;
    StandardAnswers answers;
    answers.device = {18, 1};
    put16(answers.device, is_super ? 0x0320 : 0x0210);
    // Class 239, 2, 1: functions are marked by associations. Largest packet of endpoint 0: 2^9 or 64 bytes.
    for (const int byte : {239, 2, 1, is_super ? 9 : 64}) answers.device.push_back(static_cast<std::uint8_t>(byte));
    put16(answers.device, 0x8086);
    put16(answers.device, 0x0b07);
    put16(answers.device, 0x50c7);
    for (const int byte : {1, 2, 3, 1}) answers.device.push_back(static_cast<std::uint8_t>(byte));
    answers.configuration = configuration(speed);
    // Capabilities: USB 2 link power management, and the speeds (full, high and super).
    answers.capabilities = {5, 15, 22, 0, 2, 7, 16, 2, 2, 0, 0, 0, 10, 16, 3, 0, 0x0e, 0, 2, 10, 0, 0};
    const std::string name = "Intel(R) RealSense(TM) Depth Camera 435";
    answers.strings = {{4, 3, 0x09, 0x04},
                       usb_string("Intel(R) RealSense(TM) Depth Camera 435 "),
                       usb_string(name),
                       usb_string(kSerial),
                       usb_string(name + " Depth"),
                       usb_string(name + " RGB")};
    return answers;
}

}  // namespace vm
