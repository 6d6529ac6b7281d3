// `stillmesh vocabulary train | info`: grows a vocabulary from images, and tells what one is.
#pragma once

#include <string>

#include "platform/vocabulary/images.hpp"
#include "platform/vocabulary/trainer.hpp"

namespace stillmesh {

struct VocabularyTrainArguments {
    ImageSources sources;
    TrainingOptions training;
    std::string out;
    bool is_json = false;
};

// Both return the program's exit code: 0; 1 could not write; 2 bad images, options or vocabulary; 128 + signal.
[[nodiscard]] int vocabulary_train_command(VocabularyTrainArguments arguments);
[[nodiscard]] int vocabulary_info_command(const std::string& file, bool is_json);

}  // namespace stillmesh
