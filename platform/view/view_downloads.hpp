// Files of a run that its page gives out to who has the token: as they were written last. The run says which they are,
// when it begins and when it begins another map; the server's threads read them. What a request names is one of the
// fixed names below, never a path.
#pragma once

#include <array>
#include <cstddef>
#include <mutex>
#include <string>
#include <utility>

namespace stillmesh {

struct ViewDownload {
    const char* path;  // of the request
    const char* type;
    const char* option;  // of the run that writes it
};
inline constexpr std::array<ViewDownload, 4> kViewDownloads = {{{"/room.map", "application/octet-stream", "--map-out"},
                                                                {"/grid.yaml", "text/plain", "--grid"},
                                                                {"/grid.pgm", "image/x-portable-graymap", "--grid"},
                                                                {"/cloud.ply", "application/octet-stream", "--cloud"}}};

class ViewDownloads {
public:
    using Files = std::array<std::string, kViewDownloads.size()>;  // empty: the run writes none

    void set(Files files) {
        const std::lock_guard lock(mutex_);
        files_ = std::move(files);
    }
    [[nodiscard]] std::string file(std::size_t which) const {
        const std::lock_guard lock(mutex_);
        return files_[which];
    }

private:
    mutable std::mutex mutex_;
    Files files_;
};

}  // namespace stillmesh
