// Stands in while the engine has no front door (engine/engine.hpp): says so.
#include "platform/cli/engine_session.hpp"

namespace stillmesh {

SessionSizes session_sizes(const std::string&) {
    return {};
}

Status create_engine_session(const SessionOptions&, const CameraInfo&, std::unique_ptr<TrackingSession>&,
                             std::string& message) {
    message = "tracking is not in this build.";
    return Status::kUnavailable;
}

Status print_configuration(const SessionOptions&, std::string&, std::string& message) {
    message = "tracking is not in this build.";
    return Status::kUnavailable;
}

}  // namespace stillmesh
