#include "tests/vm/d435_monitor.hpp"

#include <zlib.h>

#include <cstring>

#include "tests/vm/d435_descriptors.hpp"

namespace vm {
namespace {

constexpr std::uint32_t kGvd = 0x10, kGetTable = 0x15, kGetAdvanced = 0x2c, kTakeTurns = 0x77;
constexpr std::uint32_t kDepthTable = 25, kColourTable = 32, kDepthControl = 9;
constexpr std::int32_t kWrongCommand = -1, kWrongParameter = -6;

std::uint32_t word(const Bytes& bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(bytes[at + i]) << 8U * i;
    return value;
}

void put_float(Bytes& bytes, double value) {
    const auto single = static_cast<float>(value);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &single, sizeof(bits));
    put32(bytes, bits);
}

void put_floats(Bytes& bytes, const std::vector<double>& values) {
    for (const double value : values) put_float(bytes, value);
}

constexpr double middle(double size) {
    return (size - 1) / 2;
}

// Row by row, in halves of the image, from its middle.
std::vector<double> normalised_lens(double width, double height) {
    const double focal = kFocalOf640_px * width / 640;
    return {2 * focal / width,
            0,
            2 * middle(width) / width - 1,
            0,
            2 * focal / height,
            2 * middle(height) / height - 1,
            0,
            0,
            1};
}

const std::vector<double> kNoTurn = {1, 0, 0, 0, 1, 0, 0, 0, 1};

// The header: version (big-endian), type, bytes of what follows, a parameter, its CRC-32.
Bytes with_header(std::uint32_t type, const Bytes& body, bool is_corrupt) {
    Bytes table = {0x04, 0x00};
    put16(table, type);
    put32(table, static_cast<std::uint32_t>(body.size()));
    put32(table, 0);
    const auto sum = static_cast<std::uint32_t>(::crc32(0, body.data(), static_cast<uInt>(body.size())));
    put32(table, is_corrupt ? sum ^ 1U : sum);
    table.insert(table.end(), body.begin(), body.end());
    return table;
}

// 512 bytes: both imagers, how they are turned, their baseline, then the lens of every rectified size.
Bytes depth_table(bool is_corrupt) {
    Bytes body;
    for (int i = 0; i < 2; ++i) put_floats(body, normalised_lens(848, 480));
    for (int i = 0; i < 2; ++i) put_floats(body, kNoTurn);
    put_float(body, 50);  // mm
    put32(body, 0);
    body.resize(240);
    constexpr FrameSize kSizes[] = {{1920, 1080}, {1280, 720}, {640, 480}, {848, 480},  {640, 360},
                                    {424, 240},   {320, 240},  {480, 270}, {1280, 800}, {960, 540}};
    for (const FrameSize& size : kSizes) {
        const double focal = kFocalOf640_px * size.width / 640;
        put_floats(body, {focal, focal, middle(size.width), middle(size.height)});
    }
    body.resize(496);
    return with_header(kDepthTable, body, is_corrupt);
}

// 256 bytes: lens, distortion, place; then the rectified lens and place, which are those of the pictures.
Bytes colour_table(const MonitorSettings& settings) {
    const double aside_mm = settings.is_together ? 0 : kColourAside_mm;
    Bytes body;
    put_floats(body, normalised_lens(640, 480));
    put_floats(body, {0, 0, 0, 0, 0});
    put_floats(body, {0, 0, 0});
    put_floats(body, {aside_mm, 0, 0});
    body.resize(body.size() + 48);  // the projection
    put16(body, 640);
    put16(body, 480);
    put_floats(body, normalised_lens(640, 480));
    put_floats(body, kNoTurn);
    put_floats(body, {aside_mm, 0, 0});
    body.resize(240);
    return with_header(kColourTable, body, settings.is_corrupt);
}

Bytes version_data() {
    Bytes data(276);
    const std::uint8_t firmware[] = {0, 15, 12, 5};  // 5.12.15.0, from the end
    std::memcpy(data.data() + 12, firmware, sizeof(firmware));
    const auto put_digits = [&data](const char* digits, std::size_t at) {  // two in a byte
        for (std::size_t i = 0; i < 6; ++i) {
            data[at + i] = static_cast<std::uint8_t>((digits[2 * i] - '0') << 4 | (digits[2 * i + 1] - '0'));
        }
    };
    put_digits(kLabel, 48);
    put_digits(kSerial, 64);
    return data;
}

Bytes depth_control() {
    Bytes data;
    put32(data, kDepthUnit_um);
    for (const std::uint32_t value : {0U, 65535U, 32U, 0U}) put32(data, value);
    return data;
}

// True: known and done, and `data` is what it asks for.
bool run_command(std::uint32_t operation, std::uint32_t parameter, MonitorSettings& settings, Bytes& data,
                 std::int32_t& error) {
    switch (operation) {
        case kGvd: data = version_data(); return true;
        case kGetTable:
            error = kWrongParameter;
            if (parameter == kDepthTable) data = depth_table(settings.is_corrupt);
            if (parameter == kColourTable) data = colour_table(settings);
            return !data.empty();
        case kGetAdvanced:
            error = kWrongParameter;
            if (parameter == kDepthControl) data = depth_control();
            return !data.empty();
        case kTakeTurns:
            error = kWrongParameter;
            if (parameter <= 1) settings.has_turns = parameter == 1;
            return parameter <= 1;
        default: error = kWrongCommand; return false;
    }
}

}  // namespace

Bytes answer_message(const Bytes& message, MonitorSettings& settings) {
    Bytes data, answer;
    std::int32_t error = kWrongCommand;
    const bool is_message = message.size() == kMessageBytes && message[0] == 20 && message[1] == 0 &&
                            message[2] == 0xab && message[3] == 0xcd;
    const bool is_known = is_message && run_command(word(message, 4), word(message, 8), settings, data, error);
    put32(answer, is_known ? word(message, 4) : static_cast<std::uint32_t>(error));
    answer.insert(answer.end(), data.begin(), data.end());
    answer.resize(kMessageBytes - 4);
    put32(answer, static_cast<std::uint32_t>(data.size()));
    return answer;
}

}  // namespace vm
