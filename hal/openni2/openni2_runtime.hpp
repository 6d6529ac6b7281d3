// OpenNI2 itself, once per process: started with the first camera, listening to what is plugged in and out, ended with
// the last. No type of OpenNI2 crosses this header.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace stillmesh::openni2 {

struct DeviceName {
    std::string uri, vendor, name;
    std::uint16_t usb_vendor = 0, usb_product = 0;
};

// What OpenNI2 says of one device, from whatever thread. A driver may say it twice: flags, not counts.
struct DeviceWatch {
    std::string uri;
    std::function<void()> changed;  // called after a flag is set
    std::atomic<bool> is_gone{false};
    std::atomic<bool> has_failed{false};
};

// OpenNI2's last word, on one line.
[[nodiscard]] std::string extended_error();

class Runtime {
public:
    // The one runtime, started if it is not running; null: it cannot be started, `message` says why. To be called, as
    // everything here, inside run_parked().
    [[nodiscard]] static std::shared_ptr<Runtime> get(std::string& message);
    virtual ~Runtime() = default;

    [[nodiscard]] virtual std::vector<DeviceName> devices() = 0;
    virtual void watch(const std::shared_ptr<DeviceWatch>& watch) = 0;
    // Afterwards the watch is not called any more.
    virtual void forget(const std::shared_ptr<DeviceWatch>& watch) = 0;

protected:
    Runtime() = default;
};

// Runs `job` on a thread that is never ended, only parked and used again: OpenNI2 remembers every thread that ever
// called it and asks after each of them when a new one comes (pthread_kill), which crashes if one has ended. So
// nobody else may call it, and a job that hangs is simply left alone. False: the system has no thread left.
[[nodiscard]] bool run_parked(std::function<void()> job);

}  // namespace stillmesh::openni2
