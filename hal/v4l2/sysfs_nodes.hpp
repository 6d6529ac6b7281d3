// Video nodes and the USB devices behind them, from the files of sysfs, without opening a device and without libudev.
// Takes sysfs as untrusted: what is not there or is no number stays empty. Cost: six small files per node.
#pragma once

#include <string>
#include <vector>

#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

// `root` is "/sys", `devices` "/dev" but for tests.
[[nodiscard]] std::vector<V4l2Node> nodes_of_sysfs(const std::string& root = "/sys",
                                                   const std::string& devices = "/dev");

}  // namespace stillmesh::v4l2
