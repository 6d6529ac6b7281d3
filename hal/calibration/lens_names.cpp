#include "hal/calibration/lens_names.hpp"

#include <string>

namespace stillmesh {
namespace {

struct Name {
    std::string_view name;
    LensName lens;
};
// ROS and OpenCV; Kalibr (radtan, equi) and EuRoC; ORB-SLAM3 (KannalaBrandt8) and stella_vslam; librealsense, whose
// enumeration some programs write as a number.
constexpr Name kLensNames[] = {{"pinhole", LensName::kPinhole},
                               {"perspective", LensName::kPinhole},
                               {"rectified", LensName::kPinhole},
                               {"none", LensName::kPinhole},
                               {"", LensName::kPinhole},
                               {"null", LensName::kPinhole},
                               {"plumbbob", LensName::kBrown},
                               {"radtan", LensName::kBrown},
                               {"radialtangential", LensName::kBrown},
                               {"brown", LensName::kBrown},
                               {"brownconrady", LensName::kBrown},
                               {"opencv", LensName::kBrown},
                               {"4", LensName::kBrown},
                               {"rational", LensName::kRational},
                               {"rationalpolynomial", LensName::kRational},
                               {"equidistant", LensName::kFisheye},
                               {"equi", LensName::kFisheye},
                               {"fisheye", LensName::kFisheye},
                               {"opencvfisheye", LensName::kFisheye},
                               {"kannalabrandt", LensName::kFisheye},
                               {"kannalabrandt4", LensName::kFisheye},
                               {"kannalabrandt8", LensName::kFisheye},
                               {"5", LensName::kFisheye},
                               {"0", LensName::kPinhole},
                               {"1", LensName::kOtherBrown},
                               {"2", LensName::kOtherBrown},
                               {"modifiedbrownconrady", LensName::kOtherBrown},
                               {"inversebrownconrady", LensName::kOtherBrown}};

}  // namespace

LensName lens_named(std::string_view name) {
    std::string plain;
    for (const char c : name) {
        if (c == ' ' || c == '-' || c == '_') continue;
        plain += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    }
    if (plain.starts_with("distortion.")) plain.erase(0, 11);  // as Python prints librealsense's
    for (const Name& known : kLensNames) {
        if (known.name == plain) return known.lens;
    }
    return LensName::kUnknown;
}

}  // namespace stillmesh
