#include "platform/motion/accelerometer_file.hpp"

#include "platform/motion/triple_lines.hpp"

namespace stillmesh {
namespace {

constexpr TripleKind kAccelerometer = {"'timestamp ax ay az' in s and m/s^2", 1000,
                                       "m/s^2 is no acceleration of a camera"};

[[nodiscard]] auto into(std::vector<Acceleration>& readings) {
    readings.clear();
    return [&readings](std::int64_t time_ns, const Triple& m_s2) { readings.push_back({time_ns, m_s2}); };
}

}  // namespace

Status read_accelerometer(const std::string& file, std::vector<Acceleration>& readings, std::string& message) {
    return read_triples(file, kAccelerometer, into(readings), message);
}

Status parse_accelerometer(std::string_view text, const std::string& file, std::vector<Acceleration>& readings,
                           std::string& message) {
    return parse_triples(text, file, kAccelerometer, into(readings), message);
}

}  // namespace stillmesh
