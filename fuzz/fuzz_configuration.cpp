// Configuration files: any bytes give a sentence and change nothing, or leave every parameter inside its range, in a
// state that survives being written and read again.
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <variant>

#include "fuzz/fuzz.hpp"
#include "platform/cli/configuration_file.hpp"

namespace {

using namespace stillmesh;

// One of every type, with names as the engine's.
struct Values {
    bool flag = true;
    std::int32_t whole = -3;
    std::uint32_t count = 1000;
    std::int64_t time_ns = 20'000'000;
    float ratio = 0.25F;
    double distance_m = 0.1;
    friend bool operator==(const Values&, const Values&) = default;
};

std::array<ParameterView, 6> parameters_of(Values& values) {
    return {{{"tracking.flag", &values.flag, 0, 1, "", "a switch"},
             {"tracking.whole", &values.whole, -10, 10, "", "a whole number"},
             {"features.count", &values.count, 10, 4000000000.0, "", "a count"},
             {"time_ns", &values.time_ns, 0, 9e15, "ns", "a time"},
             {"mesh.ratio", &values.ratio, 0, 1, "", "a share"},
             {"mesh.distance_m", &values.distance_m, 1e-6, 1e6, "m", "a distance"}}};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    Values values;
    const auto parameters = parameters_of(values);
    std::string message;
    const Status status = apply_configuration(text, "file", parameters, message);
    if (status != Status::kOk) {
        fuzz::expect(status == Status::kInvalid && message.find("file") != std::string::npos,
                     "a bad file is kInvalid, with a sentence that names it");
        fuzz::expect(values == Values{}, "a refused file changes nothing");
        return 0;
    }
    for (const ParameterView& parameter : parameters) {
        std::visit(
            [&parameter](const auto* target) {
                const auto number = static_cast<double>(*target);
                fuzz::expect(number >= parameter.min && number <= parameter.max, parameter.name + " is in its range");
            },
            parameter.target);
    }
    const Values before = values;
    const std::string written = configuration_toml(parameters);
    fuzz::expect(apply_configuration(written, "again", parameters, message) == Status::kOk,
                 "what was accepted can be written and read: " + message + "\n" + written);
    fuzz::expect(values == before, "writing and reading changes no bit");
    return 0;
}
