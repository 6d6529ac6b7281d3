#include "hal/calibration/camera_keys.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "hal/calibration/calibration.hpp"
#include "hal/calibration/key_names.hpp"
#include "hal/calibration/lens_names.hpp"

namespace stillmesh {
namespace camera_keys {
namespace {

// Reads the entries of one camera.
class CameraReader {
public:
    CameraReader(const CameraFile& file, std::string& message)
        : entries_(file.entries), is_own_(file.is_own), file_(file.file), message_(message) {}

    [[nodiscard]] Status read(std::string& prefix, CameraInfo& info) {
        if (prefix != "*") {
            camera_ = prefix;
        } else if (!is_own_) {
            STILLMESH_TRY(choose_camera());
        }
        prefix = camera_;
        for (const CameraEntry& entry : entries_) STILLMESH_TRY(take(entry));
        STILLMESH_TRY(look_for_misspelt());
        STILLMESH_TRY(take_coefficients());
        STILLMESH_TRY(require());
        return finish(info);
    }

private:
    struct Seen {
        double value = 0;
        std::string_view key;  // empty: not seen
        std::size_t line = 0;
    };

    Status fail(std::size_t line, const std::string& sentence) {
        message_ = camera_file_message(file_, line, sentence);
        return Status::kInvalid;
    }
    Status fail(const CameraEntry& entry, const std::string& sentence) {
        return fail(entry.line, "key " + quoted(entry.key) + " " + sentence);
    }
    [[nodiscard]] Status choose_camera();
    [[nodiscard]] Status take(const CameraEntry& entry);
    [[nodiscard]] Status take_of_camera(const CameraEntry& entry, std::string_view key, bool is_shared);
    [[nodiscard]] Status take_beside(const CameraEntry& entry);
    [[nodiscard]] Status take_number(const CameraEntry& entry, Number number);
    [[nodiscard]] Status take_depth_scale(const CameraEntry& entry);
    [[nodiscard]] Status take_matrix(const CameraEntry& entry);
    [[nodiscard]] Status take_intrinsics(const CameraEntry& entry, bool is_of_openloris);
    [[nodiscard]] Status take_size(const CameraEntry& entry);
    [[nodiscard]] Status take_lens(const CameraEntry& entry);
    [[nodiscard]] Status take_coefficients();
    [[nodiscard]] Status check_lens_of_scalars();
    [[nodiscard]] Status check_unscaled(const CameraEntry& entry, std::string_view key);
    [[nodiscard]] Status check_whole(const CameraEntry& entry);
    [[nodiscard]] Status unknown(const CameraEntry& entry, std::string_view key);
    [[nodiscard]] Status look_for_misspelt();
    [[nodiscard]] Status require();
    [[nodiscard]] Status finish(CameraInfo& info);
    [[nodiscard]] Status read_value(const CameraEntry& entry, const std::string& word, double& value);
    [[nodiscard]] Status read_values(const CameraEntry& entry, std::vector<double>& values);
    [[nodiscard]] Status set(const CameraEntry& entry, Number number, double value);
    [[nodiscard]] bool has(Number number) const { return !seen_[number].key.empty(); }
    [[nodiscard]] double value_of(Number number) const { return seen_[number].value; }

    std::span<const CameraEntry> entries_;
    bool is_own_;
    const std::string& file_;
    std::string& message_;
    std::string camera_;  // what the keys of the camera begin with
    std::array<Seen, kNumbersCount> seen_;
    std::vector<const CameraEntry*> passed_over_;
    LensName lens_ = LensName::kUnsaid;
    const CameraEntry* lens_entry_ = nullptr;
    std::string lens_name_;  // as it stands there; a key may have none
    const CameraEntry* coefficients_ = nullptr;
};

Status CameraReader::choose_camera() {
    struct Candidate {
        std::string prefix;
        bool is_colour;
    };
    std::vector<Candidate> found;
    for (const CameraEntry& entry : entries_) {
        const std::string_view plain = without_data(entry.key);
        const std::size_t point = plain.rfind('.');
        const std::string_view tail = point == std::string_view::npos ? plain : plain.substr(point + 1);
        if (!is_core(tail)) continue;
        const std::string prefix(plain.substr(0, plain.size() - tail.size()));
        const auto is_same = [&prefix](const Candidate& c) { return c.prefix == prefix; };
        if (std::none_of(found.begin(), found.end(), is_same)) found.push_back({prefix, names_colour(prefix)});
    }
    if (found.empty()) {
        return fail(0, "this is no camera file: neither fx, fy, cx, cy nor a camera_matrix or intrinsics are in it.");
    }
    for (const char* const usual : {"", "Camera.", "Camera1."}) {  // the others of these files are of stereo cameras
        for (const Candidate& candidate : found) {
            if (candidate.prefix != usual) continue;
            camera_ = usual;
            return Status::kOk;
        }
    }
    for (const CameraEntry& entry : entries_) {  // Kalibr's cameras have numbers, and the topics that they were seen on
        for (Candidate& candidate : found) {
            if (entry.key == candidate.prefix + "rostopic" && !entry.words.empty() && names_colour(entry.words[0]))
                candidate.is_colour = true;
        }
    }
    const auto colour = std::count_if(found.begin(), found.end(), [](const Candidate& c) { return c.is_colour; });
    if (found.size() == 1 || colour == 1) {
        const auto at = std::find_if(found.begin(), found.end(), [](const Candidate& c) { return c.is_colour; });
        camera_ = at == found.end() ? found[0].prefix : at->prefix;
        return Status::kOk;
    }
    std::string names;
    for (const Candidate& candidate : found) {
        names += (names.empty() ? "" : ", ") + candidate.prefix.substr(0, candidate.prefix.size() - 1);
    }
    return fail(0, "holds " + std::to_string(found.size()) + " cameras (" + names.substr(0, 200) +
                       "), and none of them alone is called a colour camera; keep only that one.");
}

Status CameraReader::take(const CameraEntry& entry) {
    const std::string_view key = entry.key;
    if (is_own_ || (!camera_.empty() && key.starts_with(camera_))) {
        return take_of_camera(entry, key.substr(camera_.size()), false);
    }
    if (camera_ == "Camera1." && key.starts_with("Camera.")) return take_of_camera(entry, key.substr(7), true);
    if (camera_.empty() && (number_named(key) || key.find('.') == std::string_view::npos || holds(kBinningKeys, key) ||
                            without_data(key) != key)) {
        return take_of_camera(entry, key, false);
    }
    return take_beside(entry);
}

Status CameraReader::take_of_camera(const CameraEntry& entry, std::string_view key, bool is_shared) {
    const std::string_view plain = without_data(key);
    if (holds(kDepthKeys, key)) return take_number(entry, kDepthUnits);
    if (holds(kDepthScaleKeys, key) || (key == "scale" && !camera_.empty())) return take_depth_scale(entry);
    if (holds(kLensKeys, key)) return take_lens(entry);
    if (const auto number = number_named(key)) return take_number(entry, *number);
    if (holds(kScaledInputKeys, key)) return check_unscaled(entry, key);
    if (!is_own_) {
        if (holds(kMatrixKeys, plain)) return take_matrix(entry);
        if (holds(kIntrinsicsKeys, plain)) return take_intrinsics(entry, plain != key);
        if (holds(kSizeKeys, plain)) return take_size(entry);
        if (holds(kBinningKeys, key)) return check_whole(entry);
        if (holds(kCoefficientKeys, plain)) {
            if (coefficients_ != nullptr && coefficients_->words != entry.words) {
                return fail(entry, "is given twice, with other numbers than in line " +
                                       std::to_string(coefficients_->line) + "; keep one of them.");
            }
            coefficients_ = &entry;
            return Status::kOk;
        }
    }
    const bool is_of_others = holds(kOtherCameraKeys, key) || is_shared;
    const bool is_strict = is_own_ || camera_ == "Camera.";
    if (is_strict && !is_of_others && key.find('.') == std::string_view::npos) return unknown(entry, key);
    passed_over_.push_back(&entry);
    return Status::kOk;
}

Status CameraReader::take_beside(const CameraEntry& entry) {
    const std::size_t point = entry.key.rfind('.');
    const std::string_view tail =
        point == std::string::npos ? std::string_view(entry.key) : std::string_view(entry.key).substr(point + 1);
    if (holds(kDepthKeys, entry.key) || (holds(kDepthKeys, tail) && !is_own_)) return take_number(entry, kDepthUnits);
    if (holds(kDepthScaleKeys, entry.key)) return take_depth_scale(entry);
    if (entry.key == "readout_s" || entry.key == "frames_per_s") return take_number(entry, *number_named(entry.key));
    passed_over_.push_back(&entry);
    return Status::kOk;
}

Status CameraReader::read_value(const CameraEntry& entry, const std::string& word, double& value) {
    std::string_view text = word;
    if (text.starts_with('+')) text.remove_prefix(1);
    if (text == ".nan" || text == ".NaN" || text == ".NAN" || text.ends_with(".inf")) text = "nan";
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size()) return Status::kOk;
    const std::size_t comma = word.find(',');
    const bool is_decimal = comma != std::string::npos && word.find_first_not_of("+-0123456789,") == std::string::npos;
    std::string pointed = word;
    if (is_decimal) pointed[comma] = '.';
    return fail(entry,
                "must be a number" + (is_decimal ? ": with a point, as in " + pointed.substr(0, 40) + "." : "."));
}

Status CameraReader::read_values(const CameraEntry& entry, std::vector<double>& values) {
    if (entry.words.size() > 16) return fail(entry, "must be a short list of numbers.");
    for (const std::string& word : entry.words) {
        double value = 0;
        STILLMESH_TRY(read_value(entry, word, value));
        values.push_back(value);
    }
    return Status::kOk;
}

Status CameraReader::set(const CameraEntry& entry, Number number, double value) {
    const NumberKind& kind = kNumbers[number];
    if (!std::isfinite(value)) return fail(entry, "is not a finite number; calibrate again.");
    Seen& seen = seen_[number];
    if (!seen.key.empty() && seen.value != value) {
        return fail(entry, "is given twice: " + number_text(seen.value) + " in line " + std::to_string(seen.line) +
                               " as " + quoted(seen.key) + ", then " + number_text(value) + "; keep one of them.");
    }
    if (value < kind.min || value > kind.max) {
        return fail(entry, "is " + number_text(value) + "; it must lie between " + number_text(kind.min) + " and " +
                               number_text(kind.max) + ".");
    }
    seen = {value + 0.0, entry.key, entry.line};  // a zero has no sign: "-0" would be another camera once written
    return Status::kOk;
}

Status CameraReader::take_number(const CameraEntry& entry, Number number) {
    double value = 0;
    if (entry.words.size() != 1) return fail(entry, "must be a number.");
    STILLMESH_TRY(read_value(entry, entry.words[0], value));
    return set(entry, number, value);
}

// Metres of a unit (RealSense), or units of a metre (Open3D): they lie five orders of magnitude apart.
Status CameraReader::take_depth_scale(const CameraEntry& entry) {
    double value = 0;
    if (entry.words.size() != 1) return fail(entry, "must be a number.");
    STILLMESH_TRY(read_value(entry, entry.words[0], value));
    if (value > 0 && value <= 0.01) {
        value = 1 / value;
        if (std::abs(value - std::round(value)) < 1e-6 * value) value = std::round(value);  // a float's .001
    }
    return set(entry, kDepthUnits, value);
}

Status CameraReader::take_matrix(const CameraEntry& entry) {
    std::vector<double> k;
    STILLMESH_TRY(read_values(entry, k));
    if (k.size() != 9) return fail(entry, "must have 9 numbers.");
    if (std::all_of(k.begin(), k.end(), [](double value) { return value == 0; })) {
        return fail(entry,
                    "is all zero: this camera was never calibrated; calibrate it (ROS camera_calibration, Kalibr), or "
                    "give its intrinsics.");
    }
    if (k[2] == 0 && k[5] == 0 && (k[6] != 0 || k[7] != 0)) {  // column by column, as Open3D writes it
        std::swap(k[2], k[6]);
        std::swap(k[5], k[7]);
        std::swap(k[1], k[3]);
    }
    if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
        return fail(entry, "must be [fx 0 cx; 0 fy cy; 0 0 1]; a skewed camera is unknown here.");
    }
    STILLMESH_TRY(set(entry, kFx, k[0]));
    STILLMESH_TRY(set(entry, kFy, k[4]));
    STILLMESH_TRY(set(entry, kCx, k[2]));
    return set(entry, kCy, k[5]);
}

Status CameraReader::take_intrinsics(const CameraEntry& entry, bool is_of_openloris) {
    std::vector<double> k;
    STILLMESH_TRY(read_values(entry, k));
    if (k.size() != 4) return fail(entry, "must have 4 numbers, of a pinhole camera.");
    // OpenLORIS has them as a matrix of OpenCV: fx cx fy cy; Kalibr, EuRoC and ETH3D as a list: fx fy cx cy.
    if (is_of_openloris) std::swap(k[1], k[2]);
    const double ratio = k[1] != 0 ? k[0] / k[1] : 0;
    if (!(ratio > 0.67 && ratio < 1.5)) {
        return fail(entry, std::string("has focal lengths of ") + number_text(k[0]) + " and " + number_text(k[1]) +
                               ", read as " + (is_of_openloris ? "fx cx fy cy" : "fx fy cx cy") +
                               "; is that their order? Else name them: fx, fy, cx and cy.");
    }
    constexpr Number kOrder[] = {kFx, kFy, kCx, kCy};
    for (std::size_t i = 0; i < 4; ++i) STILLMESH_TRY(set(entry, kOrder[i], k[i]));
    return Status::kOk;
}

Status CameraReader::take_size(const CameraEntry& entry) {
    std::vector<double> size;
    STILLMESH_TRY(read_values(entry, size));
    if (size.size() != 2) return fail(entry, "must be [width, height].");
    STILLMESH_TRY(set(entry, kWidth, size[0]));
    return set(entry, kHeight, size[1]);
}

// A file may say what the camera is (pinhole) and how its lens distorts (radtan): the second is the lens.
Status CameraReader::take_lens(const CameraEntry& entry) {
    if (entry.words.size() > 1) return fail(entry, "must be the name of a lens.");
    const std::string name = entry.words.empty() ? std::string() : entry.words[0];
    const LensName lens = lens_named(name);
    if (lens == LensName::kUnknown) {
        return fail(entry, "is " + quoted(name) + ", a lens that is unknown here (known: " + kKnownLenses +
                               "); undistort the images, and give the pinhole camera that they have then.");
    }
    const bool says_more = lens_ == LensName::kUnsaid || lens_ == LensName::kPinhole;
    if (!says_more && lens != LensName::kPinhole && lens != lens_) {
        return fail(entry, "is " + quoted(name) + ", but " + quoted(lens_entry_->key) + " is " + quoted(lens_name_) +
                               "; keep the one that is right.");
    }
    if (says_more) {
        lens_ = lens;
        lens_entry_ = &entry;
        lens_name_ = name;
    }
    return Status::kOk;
}

Status CameraReader::check_unscaled(const CameraEntry& entry, std::string_view key) {
    double value = 0;
    if (entry.words.size() != 1) return fail(entry, "must be a number.");
    STILLMESH_TRY(read_value(entry, entry.words[0], value));
    if (key == "imageScale" && value == 1) return Status::kOk;
    for (const CameraEntry& other : entries_) {  // the size that they have already
        const bool is_its_own = !camera_.empty() && other.words == entry.words &&
                                number_named(std::string_view(other.key).substr(other.key.rfind('.') + 1)) ==
                                    (lower(key).ends_with("width") ? kWidth : kHeight);
        if (is_its_own && key != "imageScale") return Status::kOk;
    }
    return fail(entry,
                "scales images, and they are not scaled here: remove it, and they are tracked as they are (--half: at "
                "half their size, lens and all).");
}

// ROS: K is of the sensor's whole picture, whatever the driver binned or cut out of it.
Status CameraReader::check_whole(const CameraEntry& entry) {
    double value = 0;
    if (entry.words.size() != 1) return fail(entry, "must be a number.");
    STILLMESH_TRY(read_value(entry, entry.words[0], value));
    const bool is_binning = entry.key.find("binning") != std::string::npos;
    if (value == 0 || (is_binning && value == 1)) return Status::kOk;
    return fail(entry, "is " + number_text(value) +
                           ": K is of the whole picture, not of these images; give the camera of the images as they "
                           "are, and remove this key.");
}

Status CameraReader::unknown(const CameraEntry& entry, std::string_view key) {
    std::vector<std::string_view> known;
    for (const NumberKind& kind : kNumbers) known.push_back(kind.name);
    known.push_back("lens");
    if (!is_own_) known.insert(known.end(), {"fps", "type", "cols", "rows"});
    const std::string_view nearest = nearest_name(key, known);
    if (!nearest.empty())
        return fail(entry, "is unknown; did you mean " + quoted(camera_ + std::string(nearest)) + "?");
    std::string sentence = "is unknown; remove it (known:";
    for (const std::string_view name : known) sentence += " " + camera_ + std::string(name);
    return fail(entry, sentence + ").");
}

// What was passed over and is spelled nearly as something that is missing is no key about other things.
Status CameraReader::look_for_misspelt() {
    std::vector<std::string> missing;
    for (const Number number : {kWidth, kHeight, kFx, kFy, kCx, kCy}) {
        if (has(number)) continue;
        missing.push_back(camera_ + std::string(kNumbers[number].name));
        if (number <= kHeight && camera_.empty()) missing.push_back("image_" + std::string(kNumbers[number].name));
    }
    if (coefficients_ == nullptr && !has(kK1) && camera_ != "Camera.") {
        for (const char* const key : {"distortion_coefficients", "distortion_coeffs"}) missing.push_back(camera_ + key);
    }
    if (lens_entry_ == nullptr) missing.push_back(camera_ + "distortion_model");
    if (!has(kDepthUnits)) missing.insert(missing.end(), std::begin(kDepthKeys), std::end(kDepthKeys));
    const std::vector<std::string_view> names(missing.begin(), missing.end());
    constexpr std::size_t kShort = 5;  // shorter names are all alike
    for (const CameraEntry* const entry : passed_over_) {
        const std::string_view key = without_data(entry->key);
        const std::string_view tail = key.substr(key.starts_with(camera_) ? camera_.size() : 0);
        const std::string_view nearest = nearest_name(key, names);
        // Of a long name with the camera's before it a third may differ: what differs must be little of the rest, too.
        const bool is_of_camera = tail.size() < key.size();
        if (nearest.empty() || tail.size() < kShort) continue;
        if (is_of_camera) {
            const std::string_view rest = nearest.substr(std::min(camera_.size(), nearest.size()));
            if (nearest_name(tail, {&rest, 1}).empty()) continue;
        }
        return fail(*entry, "is unknown; did you mean " + quoted(nearest) + "?");
    }
    return Status::kOk;
}

// Coefficients in a list, in the order of OpenCV, which all of these files keep.
Status CameraReader::take_coefficients() {
    constexpr Number kBrownOrder[] = {kK1, kK2, kP1, kP2, kK3, kK4, kK5, kK6};
    constexpr Number kFisheyeOrder[] = {kK1, kK2, kK3, kK4};
    if (coefficients_ == nullptr) return check_lens_of_scalars();
    const CameraEntry& entry = *coefficients_;
    std::vector<double> d;
    STILLMESH_TRY(read_values(entry, d));
    const std::span<const Number> order =
        lens_ == LensName::kFisheye ? std::span<const Number>(kFisheyeOrder) : std::span<const Number>(kBrownOrder);
    const std::size_t of_lens = lens_ == LensName::kBrown ? 5 : order.size();
    const std::string model = lens_name_.empty() ? "" : " (" + lens_name_ + ")";
    if (!d.empty() && d.size() < 4) {
        return fail(entry, "has " + std::to_string(d.size()) + " numbers; this lens" + model + " has " +
                               (lens_ == LensName::kFisheye ? "4 (k1 k2 k3 k4)." : "4 or 5 (k1 k2 p1 p2 k3), or 8."));
    }
    for (std::size_t i = 0; i < d.size(); ++i) {
        if (i < of_lens) {
            STILLMESH_TRY(set(entry, order[i], d[i]));
        } else if (d[i] != 0) {
            return fail(entry,
                        "has " + std::to_string(d.size()) + " numbers, of which number " + std::to_string(i + 1) +
                            " is " + number_text(d[i]) + ", but this lens" + model + " has " + std::to_string(of_lens) +
                            (lens_ == LensName::kBrown ? "; is it rational_polynomial?"
                                                       : "; calibrate with these alone, or undistort the images."));
        }
    }
    if (lens_ == LensName::kUnsaid || lens_ == LensName::kPinhole) lens_ = LensName::kRational;
    return check_lens_of_scalars();
}

Status CameraReader::check_lens_of_scalars() {
    const auto refuse = [this](Number number, const std::string& sentence) {
        const Seen& seen = seen_[number];
        return fail(seen.line, "key " + quoted(seen.key) + " is " + number_text(seen.value) + ": " + sentence);
    };
    const bool is_any = value_of(kK4) != 0 || value_of(kK5) != 0 || value_of(kK6) != 0;
    if (lens_ == LensName::kFisheye) {
        for (const Number number : {kP1, kP2, kK5, kK6}) {
            if (value_of(number) != 0)
                return refuse(number, "a fisheye has k1, k2, k3 and k4 alone; which lens is it?");
        }
    } else if (is_any && lens_ != LensName::kRational) {
        // All three are OpenCV's of a rational lens; one alone may be a fisheye's that lost its name.
        const bool is_whole = lens_ != LensName::kBrown && has(kK4) && has(kK5) && has(kK6);
        const Number first = value_of(kK4) != 0 ? kK4 : value_of(kK5) != 0 ? kK5 : kK6;
        if (!is_whole) {
            return refuse(
                first,
                "a coefficient that this lens (k1 k2 p1 p2 k3) does not have; of a rational lens it comes with "
                "k4, k5 and k6, of a fisheye with its name (KannalaBrandt8, equidistant).");
        }
    }
    for (const Number number : {kK1, kK2, kP1, kP2, kK3}) {
        if (lens_ == LensName::kOtherBrown && value_of(number) != 0) {
            return refuse(number,
                          "of " + quoted(lens_name_) +
                              ", which distorts otherwise than plumb_bob; calibrate it (ROS camera_calibration, "
                              "Kalibr), or undistort the images.");
        }
    }
    return Status::kOk;
}

Status CameraReader::require() {
    for (const Number number : {kWidth, kHeight, kFx, kFy, kCx, kCy}) {
        if (has(number) || (number <= kHeight && !is_own_)) continue;
        return fail(0, "key " + quoted(camera_ + std::string(kNumbers[number].name)) + " is missing; add it.");
    }
    return Status::kOk;
}

Status CameraReader::finish(CameraInfo& info) {
    const double width = value_of(kWidth), height = value_of(kHeight), cx = value_of(kCx), cy = value_of(kCy);
    if (width != std::floor(width) || height != std::floor(height)) {
        return fail(0, "width and height must be whole numbers of pixels.");
    }
    if ((width == 0) != (height == 0)) return fail(0, "width and height must be given together.");
    if (width > 0 && (cx < -0.5 || cx > width || cy < -0.5 || cy > height)) {
        return fail(0, "the principal point (" + number_text(cx) + ", " + number_text(cy) +
                           ") lies outside the image; is this the file of another camera or image size?");
    }
    CameraModel& m = info.model;
    m.width = static_cast<std::uint32_t>(width);
    m.height = static_cast<std::uint32_t>(height);
    constexpr double CameraModel::*kMembers[] = {
        &CameraModel::fx, &CameraModel::fy, &CameraModel::cx, &CameraModel::cy, &CameraModel::k1, &CameraModel::k2,
        &CameraModel::p1, &CameraModel::p2, &CameraModel::k3, &CameraModel::k4, &CameraModel::k5, &CameraModel::k6};
    for (std::size_t i = 0; i < std::size(kMembers); ++i) m.*kMembers[i] = seen_[kFx + i].value;
    m.lens = lens_ == LensName::kFisheye ? Lens::kFisheye : Lens::kBrown;
    info.depth_units_per_m = value_of(kDepthUnits);
    if (has(kFps)) info.frames_per_s = value_of(kFps);
    if (has(kReadout)) info.readout_s = value_of(kReadout);
    return Status::kOk;
}

}  // namespace
}  // namespace camera_keys

Status camera_of_entries(const CameraFile& file, std::string& prefix, CameraInfo& info, std::string& message) {
    return camera_keys::CameraReader(file, message).read(prefix, info);
}

}  // namespace stillmesh
