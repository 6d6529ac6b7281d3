#include "platform/cli/capture_command.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "hal/live/reconnecting_camera.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/linux/process.hpp"
#include "platform/record/frame_folder_writer.hpp"

namespace stillmesh {

int capture_command(const CaptureArguments& arguments) {
    const bool is_oni = arguments.out.size() > 4 && arguments.out.ends_with(".oni");
    std::error_code error;
    if (is_oni && std::filesystem::exists(arguments.out, error)) {
        return refuse(arguments.out + ": is there already; nothing was changed.");
    }
    LiveCameraOptions options = arguments.camera;
    if (is_oni) options.record = arguments.out;
    std::string message;
    const std::unique_ptr<LiveCamera> live = make_live_camera(options, message);
    if (live == nullptr) return refuse(message);
    if (live->is_file() && is_oni) return refuse("--camera: an .oni file is not captured into another.");
    catch_stop_signals();
    ReconnectOptions reconnect;
    reconnect.now_ns = monotonic_ns;
    reconnect.sleep_until_ns = sleep_until_ns;
    reconnect.source_message = [&live] { return live->message(); };
    reconnect.silence = [&live] { return live->silence(); };
    reconnect.remark = [&live] { return live->remark(); };
    reconnect.reset = [&live] { return reset_live_camera(*live); };
    reconnect.times = live.get();
    reconnect.is_live = !live->is_file();
    ReconnectingCamera lasting(*live, reconnect);
    // An .oni file is one opening of one device: it ends when the device goes.
    DepthCamera& camera = is_oni ? static_cast<DepthCamera&>(*live) : lasting;
    if (open_live_camera(
            camera, [&live] { return live->message(); }, arguments.does_wait, message) != Status::kOk) {
        if (stop_signal() != 0) return 128 + stop_signal();
        return refuse(message);
    }
    FrameFolderWriter writer(32);
    if (!is_oni && !writer.open(arguments.out, camera.info(), message)) return refuse(message);
    if (!arguments.is_json) std::fprintf(stderr, "%s; Ctrl-C ends it\n", live->device().c_str());

    int code = kExitDone;
    std::uint64_t frames = 0;
    std::uint64_t left_out = 0;
    const std::int64_t begin_ns = monotonic_ns();
    std::int64_t last_ns = begin_ns;
    while (arguments.frames == 0 || frames < arguments.frames) {
        if (stop_signal() != 0) {
            code = 128 + stop_signal();
            break;
        }
        Frame frame;
        const Status status = camera.poll(frame);
        for (std::string news = lasting.take_news(); !news.empty(); news = lasting.take_news()) complain(news);
        if (status == Status::kEnd) break;
        if (status != Status::kOk) {
            // Without reconnecting: gone, or silent for too long.
            if (is_oni && (status == Status::kUnavailable || monotonic_ns() - last_ns > 2'000'000'000)) {
                complain("the camera is gone: the recording ends here.");
                code = kExitFailed;
                break;
            }
            static_cast<void>(camera.wait(100));
            continue;
        }
        last_ns = monotonic_ns();
        if (is_oni) {
            ++frames;
        } else if (writer.wait_for_room(std::chrono::milliseconds(live->is_file() ? 10'000 : 0))) {
            writer.add(frame);
            ++frames;
        } else {
            ++left_out;
        }
    }
    CameraRecord record;
    account_live_camera(live->counts(), record);
    const std::uint64_t dropped = live->dropped();
    camera.close();
    if (const std::string problem = writer.close(); !problem.empty()) {
        complain(problem);
        if (code == kExitDone) code = kExitFailed;
    }
    const double seconds = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
    if (arguments.is_json) {
        const nlohmann::ordered_json json = {
            {"out", arguments.out}, {"device", live->device()},          {"frames", frames},   {"left_out", left_out},
            {"dropped", dropped},   {"lag_mean_ms", record.lag_mean_ms}, {"seconds", seconds}, {"exit_code", code}};
        std::printf("%s\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    } else {
        std::printf("%s: %llu frames in %.1f s; %llu left out because the disk or the processor had no time\n",
                    arguments.out.c_str(), static_cast<unsigned long long>(frames), seconds,
                    static_cast<unsigned long long>(left_out) + dropped);
    }
    return code;
}

}  // namespace stillmesh
