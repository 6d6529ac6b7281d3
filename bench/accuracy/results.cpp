#include "bench/accuracy/results.hpp"

#include <nlohmann/json.hpp>

namespace stillmesh::accuracy {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Measures, frames, tracked, unsure, predicted, none, hole_longest,
                                                ends_with_pose, ate_m, ate_max_m, rpe_m, rpe_deg, judged_tracked,
                                                wrong_tracked, judged_unsure, wrong_unsure, judged_predicted,
                                                wrong_predicted, right, right_tracked, wrong_first, nees_frames,
                                                covariance_bad, nees_first_sum, nees_fit_sum, nees_ate_sum, fit_m2_sum,
                                                fit_rad2_sum, said_m2_sum, said_rad2_sum, nees_first_translation_sum,
                                                nees_first_rotation_sum, nees_fit_translation_sum,
                                                nees_fit_rotation_sum, masked_frames, wrong_choices, moving,
                                                moving_accepted, still, still_accepted, keyframes, median_ms, p99_ms)

// Results written before there was dirt are clean.
static void to_json(nlohmann::json& out, const Result& result) {
    out = {{"scene", result.scene},     {"seed", result.seed},         {"is_recording", result.is_recording},
           {"variant", result.variant}, {"measures", result.measures}, {"dirt", result.dirt}};
}
static void from_json(const nlohmann::json& in, Result& result) {
    in.at("scene").get_to(result.scene);
    in.at("seed").get_to(result.seed);
    in.at("is_recording").get_to(result.is_recording);
    in.at("variant").get_to(result.variant);
    in.at("measures").get_to(result.measures);
    result.dirt = in.value("dirt", "");
}

std::string to_text(const Result& result) {
    return nlohmann::json(result).dump();
}

bool from_text(std::string_view text, Result& result) {
    try {
        result = nlohmann::json::parse(text).get<Result>();
        return true;
    } catch (const nlohmann::json::exception&) {
        return false;
    }
}

std::string to_text(const std::vector<Result>& results) {
    std::string out = "[";
    for (const Result& result : results) out += (out.size() > 1 ? ",\n " : "\n ") + to_text(result);
    return out + "\n]\n";
}

bool from_text(std::string_view text, std::vector<Result>& results) {
    try {
        results = nlohmann::json::parse(text).get<std::vector<Result>>();
        return true;
    } catch (const nlohmann::json::exception&) {
        return false;
    }
}

}  // namespace stillmesh::accuracy
