// Camera files of all kinds, in TOML, YAML, JSON and text: any bytes give either a sentence, or a calibration that
// makes sense and survives being written and read again.
#include <algorithm>
#include <string>
#include <string_view>

#include "fuzz/fuzz.hpp"
#include "hal/calibration/calibration.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    using namespace stillmesh;
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    for (const CalibrationFormat format : {CalibrationFormat::kToml, CalibrationFormat::kYaml}) {
        CameraInfo info;
        std::string message;
        const Status status = parse_calibration(text, format, "file", info, message);
        if (status != Status::kOk) {
            fuzz::expect(status == Status::kInvalid, "bad bytes are kInvalid");
            fuzz::expect(!message.empty(), "an error has a sentence");
            continue;
        }
        fuzz::expect(message.empty(), "success has no error sentence");
        if (info.model.width == 0) {  // not in the file: the first image says it
            info.model.width = info.model.height = 2047;
            const double rightmost = std::max(info.model.cx, info.model.cy);
            if (std::min(info.model.cx, info.model.cy) < 0 || rightmost > 2047) continue;
        }
        const std::string written = calibration_toml(info);
        CameraInfo again;
        fuzz::expect(parse_calibration(written, CalibrationFormat::kToml, "again", again, message) == Status::kOk,
                     "what was accepted can be written and read: " + message + "\n" + written);
        fuzz::expect(calibration_toml(again) == written, "writing and reading changes no bit");
    }
    return 0;
}
