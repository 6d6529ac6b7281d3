#include "hal/calibration/camera_pair.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace stillmesh {
namespace {

constexpr std::string_view kOwnTable = "depth.";
constexpr std::array<std::string_view, 7> kOwnPose = {"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
constexpr double kApartMax_m = 1;       // two lenses of one camera
constexpr double kRotationOff = 1e-3;   // of files with few decimals
constexpr std::size_t kCamerasMax = 8;  // of a chain

[[nodiscard]] bool holds(const std::string& text, std::string_view word) {
    return std::search(text.begin(), text.end(), word.begin(), word.end(),
                       [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a + 32 : a) == b; }) != text.end();
}

class PairReader {
public:
    PairReader(const std::vector<CameraEntry>& entries, const std::string& file, std::string& message)
        : entries_(entries), file_(file), message_(message) {}

    [[nodiscard]] Status read_own(CameraInfo& info);
    [[nodiscard]] Status read_of_others(CameraInfo& info);

private:
    Status fail(const CameraEntry& entry, const std::string& sentence) {
        message_ = camera_file_message(file_, entry.line, "key '" + entry.key + "' " + sentence);
        return Status::kInvalid;
    }
    [[nodiscard]] const CameraEntry* find(const std::string& key) const {
        const auto at = std::find_if(entries_.begin(), entries_.end(),
                                     [&](const CameraEntry& e) { return e.key == key || e.key == key + ".data"; });
        return at == entries_.end() ? nullptr : &*at;
    }
    [[nodiscard]] Status read_numbers(const CameraEntry& entry, std::span<double> numbers);
    [[nodiscard]] Status read_matrix(const CameraEntry& entry, RigidTransform& motion);
    [[nodiscard]] Status chain_of(const std::string& prefix, RigidTransform& camera_from_first, bool& is_found);
    [[nodiscard]] Status read_chain(const std::string& colour, const std::string& depth, RigidTransform& pose,
                                    bool& is_found);
    [[nodiscard]] Status read_realsense(RigidTransform& pose, bool& is_found);
    [[nodiscard]] std::string depth_prefix(const std::string& colour) const;

    const std::vector<CameraEntry>& entries_;
    const std::string& file_;
    std::string& message_;
};

Status PairReader::read_numbers(const CameraEntry& entry, std::span<double> numbers) {
    if (entry.words.size() != numbers.size()) {
        return fail(entry, "must have " + std::to_string(numbers.size()) + " numbers.");
    }
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        const std::string& word = entry.words[i];
        const char* const begin = word.data() + (word.starts_with('+') ? 1 : 0);
        const auto [end, error] = std::from_chars(begin, word.data() + word.size(), numbers[i]);
        if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(numbers[i])) {
            return fail(entry, "must be " + std::string(numbers.size() == 1 ? "a number." : "numbers."));
        }
    }
    return Status::kOk;
}

// 4 by 4, row by row.
Status PairReader::read_matrix(const CameraEntry& entry, RigidTransform& motion) {
    std::array<double, 16> m{};
    STILLMESH_TRY(read_numbers(entry, m));
    RotationMatrix rotation{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) rotation[3 * i + j] = m[4 * i + j];
        motion.translation_m[i] = m[4 * i + 3];
    }
    const bool is_affine = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
    if (!is_affine || !is_rotation(rotation, kRotationOff)) {
        return fail(entry,
                    "is no rigid motion: its rows must be those of a rotation with the translation (m) behind each.");
    }
    write_quaternion(rotation, motion.rotation_xyzw);
    return Status::kOk;
}

Status PairReader::read_own(CameraInfo& info) {
    std::vector<CameraEntry> colour, depth;
    std::array<const CameraEntry*, kOwnPose.size()> pose_entries{};
    for (const CameraEntry& entry : entries_) {
        if (!entry.key.starts_with(kOwnTable)) {
            colour.push_back(entry);
            continue;
        }
        const auto at = std::find(kOwnPose.begin(), kOwnPose.end(), entry.key.substr(kOwnTable.size()));
        if (at == kOwnPose.end())
            depth.push_back(entry);
        else
            pose_entries[static_cast<std::size_t>(at - kOwnPose.begin())] = &entry;
    }
    std::string prefix;
    STILLMESH_TRY(camera_of_entries({colour, true, file_}, prefix, info, message_));
    const bool has_pose = std::any_of(pose_entries.begin(), pose_entries.end(), [](const auto* e) { return e; });
    if (depth.empty() && !has_pose) return Status::kOk;
    std::array<double, kOwnPose.size()> pose{0, 0, 0, 0, 0, 0, 1};
    for (std::size_t i = 0; i < pose.size(); ++i) {
        if (pose_entries[i] != nullptr) {
            STILLMESH_TRY(read_numbers(*pose_entries[i], {&pose[i], 1}));
        } else if (i < 3) {
            message_ = camera_file_message(
                file_, 0,
                "key 'depth." + std::string(kOwnPose[i]) + "' is missing: where the depth camera stands (m); add it.");
            return Status::kInvalid;
        }
    }
    CameraInfo of_depth;
    prefix = kOwnTable;
    STILLMESH_TRY(camera_of_entries({depth, true, file_}, prefix, of_depth, message_));
    double norm = 0;
    for (std::size_t i = 3; i < pose.size(); ++i) norm += pose[i] * pose[i];
    if (!(std::abs(norm - 1) < kRotationOff)) {
        message_ = camera_file_message(file_, 0, "depth.qx, qy, qz and qw must be a quaternion of length 1.");
        return Status::kInvalid;
    }
    SeparateDepth separate{of_depth.model, {}};
    for (std::size_t i = 0; i < 3; ++i) {
        separate.colour_from_depth.translation_m[i] = pose[i];
        if (std::abs(pose[i]) <= kApartMax_m) continue;
        return fail(*pose_entries[i], "is more than a metre: is it in mm? Metres are meant.");
    }
    for (std::size_t i = 0; i < 4; ++i) separate.colour_from_depth.rotation_xyzw[i] = pose[3 + i];
    info.separate_depth = separate;
    return Status::kOk;
}

// Kalibr: each camera's place by the one before it, or by the IMU.
Status PairReader::chain_of(const std::string& prefix, RigidTransform& camera_from_first, bool& is_found) {
    is_found = false;
    camera_from_first = {};
    if (const CameraEntry* const entry = find(prefix + "T_cam_imu")) {
        is_found = true;
        return read_matrix(*entry, camera_from_first);
    }
    if (!prefix.starts_with("cam") || prefix.size() != 5) return Status::kOk;
    const auto number = static_cast<std::size_t>(prefix[3] - '0');
    for (std::size_t i = 1; i <= number && i < kCamerasMax; ++i) {
        const CameraEntry* const entry = find("cam" + std::to_string(i) + ".T_cn_cnm1");
        if (entry == nullptr) return Status::kOk;
        RigidTransform step;
        STILLMESH_TRY(read_matrix(*entry, step));
        camera_from_first = compose(step, camera_from_first);
    }
    is_found = number < kCamerasMax;
    return Status::kOk;
}

Status PairReader::read_chain(const std::string& colour, const std::string& depth, RigidTransform& pose,
                              bool& is_found) {
    RigidTransform colour_from_first, depth_from_first;
    STILLMESH_TRY(chain_of(colour, colour_from_first, is_found));
    if (!is_found) return Status::kOk;
    STILLMESH_TRY(chain_of(depth, depth_from_first, is_found));
    pose = compose(colour_from_first, inverse_of(depth_from_first));
    return Status::kOk;
}

// librealsense keeps rotations column by column (rs2_extrinsics).
Status PairReader::read_realsense(RigidTransform& pose, bool& is_found) {
    const CameraEntry* const rotation = find("depth_to_color.rotation");
    const CameraEntry* const translation = find("depth_to_color.translation");
    is_found = rotation != nullptr && translation != nullptr;
    if (!is_found) return Status::kOk;
    std::array<double, 9> columns{};
    STILLMESH_TRY(read_numbers(*rotation, columns));
    STILLMESH_TRY(read_numbers(*translation, pose.translation_m));
    RotationMatrix matrix{};
    for (std::size_t i = 0; i < 9; ++i) matrix[i] = columns[i % 3 * 3 + i / 3];
    if (!is_rotation(matrix, kRotationOff)) return fail(*rotation, "is no rotation.");
    write_quaternion(matrix, pose.rotation_xyzw);
    return Status::kOk;
}

// Of all cameras but colour's, the one of depth, or the first of infrared, whose view depth is.
std::string PairReader::depth_prefix(const std::string& colour) const {
    std::string infrared;
    for (const CameraEntry& entry : entries_) {
        const std::size_t point = entry.key.find('.');
        if (point == std::string::npos) continue;
        const std::string prefix = entry.key.substr(0, point + 1);
        if (prefix == colour) continue;
        const bool is_topic = entry.key == prefix + "rostopic" && !entry.words.empty();
        const std::string& name = is_topic ? entry.words[0] : prefix;
        if (holds(name, "depth") && !holds(name, "_to_")) return prefix;
        const bool is_infrared = holds(name, "infra1") || holds(name, "/ir/");
        if (is_infrared && infrared.empty()) infrared = prefix;
    }
    return infrared;
}

Status PairReader::read_of_others(CameraInfo& info) {
    std::string colour = "*";
    STILLMESH_TRY(camera_of_entries({entries_, false, file_}, colour, info, message_));
    if (colour.empty()) return Status::kOk;
    const std::string depth = depth_prefix(colour);
    if (depth.empty()) return Status::kOk;
    RigidTransform pose;
    bool is_found = false;
    STILLMESH_TRY(read_realsense(pose, is_found));
    if (!is_found) STILLMESH_TRY(read_chain(colour, depth, pose, is_found));
    // Without a size nobody could tell whether depth images are this camera's.
    const bool has_size = find(depth + "resolution") != nullptr || find(depth + "width") != nullptr;
    if (!is_found || !has_size) return Status::kOk;
    CameraInfo of_depth;
    std::string prefix = depth;
    STILLMESH_TRY(camera_of_entries({entries_, false, file_}, prefix, of_depth, message_));
    // Of one size: recordings that people have are of aligned depth then, and nothing in the file would tell.
    const bool is_of_one_size = of_depth.model.width == info.model.width && of_depth.model.height == info.model.height;
    if (!is_of_one_size) info.separate_depth = SeparateDepth{of_depth.model, pose};
    return Status::kOk;
}

}  // namespace

Status cameras_of_entries(const std::vector<CameraEntry>& entries, bool is_own, const std::string& file,
                          CameraInfo& info, std::string& message) {
    PairReader reader(entries, file, message);
    return is_own ? reader.read_own(info) : reader.read_of_others(info);
}

}  // namespace stillmesh
