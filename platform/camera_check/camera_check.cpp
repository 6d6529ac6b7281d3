#include "platform/camera_check/camera_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace stillmesh {
namespace {

// Faster, blur and the lag of depth behind colour decide what is seen: 12 px a frame are 40 degrees/s.
constexpr double kSlow_px = 12;
constexpr std::size_t kEveryForSpeed = 2, kMatchesForSpeed = 15, kMatchesForMotion = 40;
// Less motion than this any depth explains.
constexpr double kMotion_px = 8;
// A pair of views is for the calibration from here on; or from less, when the view before is nearly out of sight.
constexpr double kPair_px = 35, kLastPair_px = 20;
constexpr std::size_t kLastMatches = 100;
constexpr double kSpeedReach_px = 24, kReach_px = 60;
// Where people are about, some of them pass for the room: the calibration waits until they are gone.
constexpr double kRigidForFit = 0.7;
// Share that one motion explains with depth, of what it explains in the pictures. Right: .35 (a violent turn) to 1, .9
// in the mean; depth of another room: .2 to .8, mostly below .5.
constexpr double kRatioStranger = 0.6, kRatioKnown = 0.75;
constexpr std::uint64_t kRatioAge = 15;  // frames
// Contrast at the borders of depth over that beside, of five frames. Right: 1.5 to 4 when slow; depth of another room
// .6 to 1.3.
constexpr double kEdgesStranger = 1.25, kEdgesKnown = 1.5;
constexpr double kBordersMin = 200;
constexpr int kAtBorder_px = 3, kBeside_px = 12;
constexpr double kShiftBorders = 8000;
// Until the lens is known every frame is looked at whole, and after ten seconds two of six; of the others those whose
// borders look strange. The reference is then so many frames old at most: 3.3 ms a frame in the mean became .8.
constexpr std::uint64_t kFramesAtFirst = 300, kFramesInTurn = 6, kFramesOfTurn = 2, kReferenceAge = 5;
// What a wrong factor or a lens of another camera makes: more than lenses differ by from one to the next.
constexpr double kFactorOff = 0.18;  // ln 1.2
constexpr double kCentreOff = 0.1;   // focal lengths
constexpr double kSigmasOff = 6;
constexpr std::uint32_t kPairsFirst = 4, kPairsSure = 8;
// What is left of the cost with a corrected calibration. Right: .7 (four pairs, people) to 1; wrong: .05 to .6.
constexpr double kCostSure = 0.5, kCostLikely = 0.65;
// Of all depth cameras: nearly square pixels, and a centre in the middle of the picture.
constexpr double kAspectMax = 1.33, kCentreFromMiddle = 0.2;
constexpr double kUnitOff = 1.4;
// What drivers and recordings use; what the steps say is within 2 % of it.
constexpr double kUsualUnits[] = {1000, 5000, 10000};
constexpr double kUsualWithin = 0.03;

// The picture's contrast at the borders of depth, and that beside.
struct EdgeContrast {
    explicit EdgeContrast(const EdgeCurve& curve) : borders(curve.borders) {
        for (int shift = -kEdgeShiftMax_px; shift <= kEdgeShiftMax_px; ++shift) {
            const double contrast = curve.contrast[static_cast<std::size_t>(shift + kEdgeShiftMax_px)];
            if (std::abs(shift) <= kAtBorder_px) at += contrast / (2 * kAtBorder_px + 1);
            if (std::abs(shift) >= kBeside_px) beside += contrast / (2 * (kEdgeShiftMax_px - kBeside_px + 1));
        }
    }
    [[nodiscard]] bool is_known(double borders_min) const { return borders >= borders_min && beside > 0; }
    [[nodiscard]] bool is_strange() const { return at < kEdgesStranger * beside; }
    [[nodiscard]] bool is_right() const { return at > kEdgesKnown * beside; }

    double borders, at = 0, beside = 0;
};

void add_to(EdgeCurve& sum, const EdgeCurve& curve) {
    for (std::size_t i = 0; i < sum.contrast.size(); ++i) sum.contrast[i] += curve.contrast[i];
    sum.borders += curve.borders;
}

}  // namespace

CameraCheck::CameraCheck(const CameraInfo& camera, std::uint32_t features_max)
    : camera_(camera),
      px_(camera.model.width / 640.0),
      current_(features_max),
      before_(features_max),
      reference_(features_max),
      matcher_(features_max),
      calibration_(camera.model) {
    rigidity_.is_inlier.reserve(features_max);
}

void CameraCheck::frame(const Frame& frame, const FeatureSet& features) {
    if (first_ns_ < 0) first_ns_ = frame.time_ns;
    now_ns_ = frame.time_ns;
    look_at_unit(frame);
    EdgeCurve curve;
    add_depth_edges(frame, curve);
    const EdgeContrast edges(curve);
    const bool is_known = edges.is_known(kBordersMin / kEdgeFrames);
    ++frames_;
    current_.take(frame, features, camera_.model);
    if (!looks_closely() && (!is_known || edges.is_right())) {
        if (is_known) take_edges(curve);
        if (frames_ % kReferenceAge == 0) {  // what comes is compared with what was right
            reference_ = current_;
            reference_flow_ = {};
        }
        std::swap(before_, current_);
        return;
    }
    const std::size_t matches =
        matcher_.match(before_, current_, static_cast<float>(kSpeedReach_px * px_), 0, 0, kEveryForSpeed).size();
    if (matches >= kMatchesForSpeed && static_cast<double>(matcher_.flow().length) < kSlow_px * px_) {
        take_edges(curve);
        look_at_motion();
        decide_belonging();
    }
    if (is_on_[static_cast<std::size_t>(CameraFault::kStranger)]) ++stranger_frames_;
    std::swap(before_, current_);
}

bool CameraCheck::looks_closely() const {
    if (is_on_[static_cast<std::size_t>(CameraFault::kStranger)]) return true;
    return !is_lens_known_ && (frames_ <= kFramesAtFirst || frames_ % kFramesInTurn < kFramesOfTurn);
}

// Three times a second; until it is known, and then no more.
void CameraCheck::look_at_unit(const Frame& frame) {
    if (factor_ > 0 || frames_ % 10 != 0) return;
    steps_.add(frame);
    factor_ = steps_.factor();
    is_on_[static_cast<std::size_t>(CameraFault::kDepthUnit)] =
        factor_ > kUnitOff || (factor_ > 0 && factor_ < 1 / kUnitOff);
}

void CameraCheck::take_edges(const EdgeCurve& curve) {
    edges_[static_cast<std::size_t>(edge_frames_++ % kEdgeFrames)] = curve;
    add_to(all_edges_, curve);
    if (edge_frames_ % 10 == 0) look_for_shift();
}

void CameraCheck::look_at_motion() {
    const std::vector<ViewMatch>& matches =
        matcher_.match(reference_, current_, static_cast<float>(kReach_px * px_), reference_flow_.u, reference_flow_.v);
    reference_flow_ = matcher_.flow();
    const double flow_px = static_cast<double>(reference_flow_.length) / px_;
    if (matches.size() < kMatchesForMotion) {
        reference_ = current_;
        reference_flow_ = {};
        return;
    }
    if (flow_px < kMotion_px) return;
    measure_rigidity(matches, camera_.model.fx, rigidity_);
    const double ratio = rigidity_.with_depth / std::max(rigidity_.by_picture, 0.1);
    // Of people all around neither says anything.
    if (rigidity_.by_picture > 0.5) ratios_[static_cast<std::size_t>(ratio_count_++ % kRatios)] = {ratio, frames_};
    if (flow_px < kPair_px && (flow_px < kLastPair_px || matches.size() > kLastMatches)) return;
    if (!is_lens_known_ && rigidity_.with_depth > kRigidForFit) {
        calibration_.add(matches, rigidity_.is_inlier);
        if (calibration_.pairs_added() >= fitted_pairs_ + kPairsFirst) fit();
    }
    reference_ = current_;
    reference_flow_ = {};
}

bool CameraCheck::is_off(std::size_t number) const {
    const double least = number < 2 ? kFactorOff : kCentreOff * (number == 2 ? camera_.model.fx : camera_.model.fy);
    const double value = std::abs(correction_.value[number]);
    return value > least && value > kSigmasOff * correction_.sigma[number];
}

// What would fit is a camera that there may be; else something else moved.
bool CameraCheck::is_likely_camera() const {
    const CameraModel& m = camera_.model;
    const auto& v = correction_.value;
    const double aspect = std::abs(std::log(m.fx / m.fy) + v[0] - v[1]);
    return aspect < std::log(kAspectMax) && std::abs((m.cx + v[2]) / m.width - 0.5) < kCentreFromMiddle &&
           std::abs((m.cy + v[3]) / m.height - 0.5) < kCentreFromMiddle;
}

void CameraCheck::fit() {
    fitted_pairs_ = calibration_.pairs_added();
    correction_ = calibration_.estimate();
    bool is_any_off = false;
    for (std::size_t i = 0; i < 4; ++i) is_any_off = is_any_off || is_off(i);
    const double left = correction_.cost / std::max(correction_.cost_before, 1e-9);
    const bool is_wrong = correction_.is_known && is_any_off && left < kCostLikely && is_likely_camera();
    wrong_fits_ = is_wrong ? wrong_fits_ + 1 : 0;
    const auto lens = static_cast<std::size_t>(CameraFault::kLens);
    is_on_[lens] = is_wrong && (left < kCostSure || is_on_[lens] || wrong_fits_ >= 2);
    const auto& sigma = correction_.sigma;
    is_lens_known_ = correction_.is_known && !is_any_off && correction_.pairs >= kPairsSure &&
                     std::max(sigma[0], sigma[1]) < kFactorOff / kSigmasOff &&
                     std::max(sigma[2], sigma[3]) < kCentreOff / kSigmasOff * camera_.model.fx;
}

void CameraCheck::decide_belonging() {
    EdgeCurve sum;
    for (const EdgeCurve& curve : edges_) add_to(sum, curve);
    const EdgeContrast edges(sum);
    const bool has_edges = edges.is_known(kBordersMin) && edge_frames_ >= kEdgeFrames;
    double least = 1, most = 0;
    std::uint64_t oldest = frames_;
    for (const Ratio& ratio : ratios_) {
        least = std::min(least, ratio.value);
        most = std::max(most, ratio.value);
        oldest = std::min(oldest, ratio.frame);
    }
    const bool has_ratios = ratio_count_ >= kRatios && frames_ - oldest < kRatioAge;
    const auto stranger = static_cast<std::size_t>(CameraFault::kStranger);
    if (!is_on_[stranger]) {
        is_on_[stranger] = has_edges && edges.is_strange() && has_ratios && most < kRatioStranger;
        if (is_on_[stranger]) {
            if (!is_ever_[stranger]) stranger_since_ns_ = now_ns_;
            is_ever_[stranger] = true;
        }
    } else if ((has_edges && edges.is_right()) || (has_ratios && least > kRatioKnown)) {
        is_on_[stranger] = false;
    }
}

// Told and no fault: where few borders stand in view, a right recording had its peak 7 px beside.
void CameraCheck::look_for_shift() {
    if (all_edges_.borders < kShiftBorders) return;
    constexpr int kSmooth = 2;
    int peak_at = 0;
    double peak = 0;
    for (int shift = -kEdgeShiftMax_px + kSmooth; shift <= kEdgeShiftMax_px - kSmooth; ++shift) {
        double contrast = 0;
        for (int i = -kSmooth; i <= kSmooth; ++i) {
            contrast += all_edges_.contrast[static_cast<std::size_t>(shift + i + kEdgeShiftMax_px)];
        }
        if (contrast > peak) {
            peak = contrast;
            peak_at = shift;
        }
    }
    shift_px_ = peak_at;
}

double CameraCheck::right_unit() const {
    const double found = camera_.depth_units_per_m * factor_;
    for (const double usual : kUsualUnits) {
        if (std::abs(found / usual - 1) < kUsualWithin) return usual;
    }
    return found;
}

std::optional<CameraInfo> CameraCheck::corrected() const {
    CameraInfo right = camera_;
    const bool is_unit_off = is_on_[static_cast<std::size_t>(CameraFault::kDepthUnit)];
    const bool is_lens_off = is_on_[static_cast<std::size_t>(CameraFault::kLens)];
    if (!is_unit_off && !is_lens_off) return std::nullopt;
    if (is_unit_off) right.depth_units_per_m = right_unit();
    if (is_lens_off) {
        right.model.fx *= std::exp(correction_.value[0]);
        right.model.fy *= std::exp(correction_.value[1]);
        right.model.cx += correction_.value[2];
        right.model.cy += correction_.value[3];
    }
    return right;
}

bool CameraCheck::holds() const {
    return std::any_of(is_on_.begin(), is_on_.end(), [](bool is_on) { return is_on; });
}

std::string CameraCheck::lens_sentence() const {
    const CameraModel& m = camera_.model;
    const std::array<double, 4> given = {m.fx, m.fy, m.cx, m.cy};
    constexpr const char* kNames[] = {"fx", "fy", "cx", "cy"};
    std::string text;
    for (std::size_t i = 0; i < 4; ++i) {
        if (!is_off(i)) continue;
        const double fits = i < 2 ? given[i] * std::exp(correction_.value[i]) : given[i] + correction_.value[i];
        const double sigma = i < 2 ? fits * correction_.sigma[i] : correction_.sigma[i];
        text += fmt::format("{}{} is {:.0f} px, what stands still says {:.0f} +- {:.0f}", text.empty() ? "" : "; ",
                            kNames[i], given[i], fits, std::max(sigma, 1.0));
        if (i < 2) text += fmt::format(" ({:.2f} times)", fits / given[i]);
    }
    return "the calibration does not fit the picture: " + text +
           ". Give the one of this camera at this size (--calibration FILE).";
}

std::string CameraCheck::sentence(CameraFault fault) const {
    switch (fault) {
        case CameraFault::kDepthUnit:
            return fmt::format(
                "depth is {:.2g} times too {}: its steps are those of a Kinect or Xtion at about {:.0f} units per "
                "metre, and "
                "{:.0f} are given. Correct depth_units_per_m (DepthMapFactor).",
                factor_ > 1 ? factor_ : 1 / factor_, factor_ > 1 ? "large" : "small", right_unit(),
                camera_.depth_units_per_m);
        case CameraFault::kLens: return lens_sentence();
        case CameraFault::kStranger: break;
    }
    return fmt::format(
        "depth does not belong to colour from second {:.1f} on ({} frames so far): the pictures move as one room does, "
        "with "
        "this depth they do not. Another camera's, or another moment's?",
        static_cast<double>(stranger_since_ns_ - first_ns_) * 1e-9, stranger_frames_);
}

std::string CameraCheck::news() {
    for (std::size_t i = 0; i < kCameraFaults; ++i) {
        if (!is_on_[i] || is_told_[i]) continue;
        is_told_[i] = true;
        return sentence(static_cast<CameraFault>(i));
    }
    return {};
}

std::vector<std::string> CameraCheck::faults() const {
    std::vector<std::string> all;
    for (std::size_t i = 0; i < kCameraFaults; ++i) {
        if (is_on_[i] || is_ever_[i]) all.push_back(sentence(static_cast<CameraFault>(i)));
    }
    return all;
}

std::vector<std::string> CameraCheck::report() const {
    std::vector<std::string> lines;
    const CameraModel& m = camera_.model;
    if (factor_ > 0) {
        lines.push_back(fmt::format("depth unit    {:.0f} per metre fit the steps of this sensor, {:.0f} are given",
                                    camera_.depth_units_per_m * factor_, camera_.depth_units_per_m));
    } else {
        lines.emplace_back("depth unit    not known: this sensor's depth has no steps to tell it by");
    }
    if (correction_.is_known) {
        const auto& v = correction_.value;
        const auto& s = correction_.sigma;
        const double fx = m.fx * std::exp(v[0]), fy = m.fy * std::exp(v[1]);
        lines.push_back(
            fmt::format("focal length  fx {:.0f} +- {:.0f} px, given {:.1f}; fy {:.0f} +- {:.0f}, given {:.1f}", fx,
                        fx * s[0], m.fx, fy, fy * s[1], m.fy));
        lines.push_back(
            fmt::format("centre        cx {:.0f} +- {:.0f} px, given {:.1f}; cy {:.0f} +- {:.0f}, given {:.1f}",
                        m.cx + v[2], s[2], m.cx, m.cy + v[3], s[3], m.cy));
        lines.push_back(fmt::format("residuals     {:.2f} as given, {:.2f} corrected, of {} pairs of views",
                                    correction_.cost_before, correction_.cost, correction_.pairs));
    } else {
        lines.emplace_back(
            "focal length, centre  not known: too little motion; turn the camera slowly left, right, up, down");
    }
    lines.push_back(
        all_edges_.borders < kShiftBorders
            ? std::string("registration  not known: too few borders in depth while the camera was slow")
            : fmt::format("registration  borders in depth lie {} px {} of the picture's (a hint; 0 to 5 is usual)",
                          std::abs(shift_px_), shift_px_ > 0 ? "left" : "right"));
    lines.push_back(fmt::format("belonging     {} of {} frames with depth that does not belong to colour",
                                stranger_frames_, frames_));
    return lines;
}

}  // namespace stillmesh
