#include "platform/cli/configuration_file.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stillmesh::configuration_file_test {
namespace {

struct Sample {
    double tau_m = 0.1;
    std::uint32_t features = 1000;
    bool use_mesh = true;
    float ratio = 0.9F;

    [[nodiscard]] std::vector<ParameterView> parameters() {
        return {{"tau_m", &tau_m, 0.01, 10, "m", "largest change of an edge's length"},
                {"features", &features, 50, 4000, "", "features per frame"},
                {"use_mesh", &use_mesh, 0, 1, "", "extract the static region"},
                {"ratio", &ratio, 0, 1, "", "second best"}};
    }
};

// Promise: good keys change their parameters, others stay; whole numbers do for reals.
TEST(ConfigurationFile, Applies) {
    Sample sample;
    std::string message;
    ASSERT_EQ(apply_configuration("tau_m = 1\nuse_mesh = false\n", "c.toml", sample.parameters(), message), Status::kOk)
        << message;
    EXPECT_EQ(sample.tau_m, 1.0);
    EXPECT_FALSE(sample.use_mesh);
    EXPECT_EQ(sample.features, 1000U);
}

// Promise: unknown keys, wrong types and values out of range are refused with file, key, value and range, and then
// nothing at all is changed.
TEST(ConfigurationFile, RefusesByName) {
    const std::vector<std::pair<const char*, const char*>> cases = {
        {"features = 500\ntau = 0.2", "c.toml: key 'tau' (value 0.2) is unknown"},
        {"features = 500\nfeatres = 5", "did you mean 'features'?"},
        {"features = 500\ntau_m = 11", "c.toml: key 'tau_m' is 11; it must be 0.01 to 10 m."},
        {"features = 500\ntau_m = nan", "c.toml: key 'tau_m' is nan"},
        {"features = 10", "it must be a whole number from 50 to 4000."},
        {"features = 100.5", "key 'features' is 100.5; it must be a whole number"},
        {"features = -1", "key 'features' is -1"},
        {"use_mesh = 1", "key 'use_mesh' is 1; it must be true or false."},
        {"ratio = \"x\"", "key 'ratio' is \"x\""},
        {"features = 500\nratio = [1]", "must be a single number"},
        {"features = ", "c.toml, line 1: is not TOML"}};
    for (const auto& [text, sentence] : cases) {
        Sample sample;
        std::string message;
        EXPECT_EQ(apply_configuration(text, "c.toml", sample.parameters(), message), Status::kInvalid) << text;
        EXPECT_NE(message.find(sentence), std::string::npos) << message;
        EXPECT_EQ(sample.features, 1000U) << text;
    }
}

// Promise: what --print-config prints is read back to the same bits.
TEST(ConfigurationFile, RoundTrip) {
    Sample sample;
    sample.tau_m = 0.1 + 0.2;
    sample.ratio = 1.0F;
    const std::string text = configuration_toml(sample.parameters());
    Sample read;
    std::string message;
    ASSERT_EQ(apply_configuration(text, "c.toml", read.parameters(), message), Status::kOk) << message << text;
    EXPECT_EQ(read.tau_m, sample.tau_m);
    EXPECT_EQ(read.ratio, 1.0F);
    EXPECT_NE(text.find("largest change of an edge's length"), std::string::npos);
}

}  // namespace
}  // namespace stillmesh::configuration_file_test
