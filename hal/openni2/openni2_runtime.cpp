#include "hal/openni2/openni2_runtime.hpp"

#include <OpenNI.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

namespace stillmesh::openni2 {
namespace {

// One is ended before the next is started.
[[nodiscard]] std::mutex& life_mutex() {
    static std::mutex& mutex = *new std::mutex;
    return mutex;
}

class StockRuntime final : public Runtime,
                           public openni::OpenNI::DeviceConnectedListener,
                           public openni::OpenNI::DeviceDisconnectedListener,
                           public openni::OpenNI::DeviceStateChangedListener {
public:
    ~StockRuntime() override {
        if (!is_running_) return;
        const std::lock_guard lock(life_mutex());
        openni::OpenNI::removeDeviceConnectedListener(this);
        openni::OpenNI::removeDeviceDisconnectedListener(this);
        openni::OpenNI::removeDeviceStateChangedListener(this);
        openni::OpenNI::shutdown();
    }
    [[nodiscard]] bool start(std::string& message) {
        if (openni::OpenNI::initialize() != openni::STATUS_OK) {
            message = "OpenNI2 does not start (" + extended_error() +
                      "); if its drivers are missing, install it again: sudo apt-get install --reinstall libopenni2-0";
            return false;
        }
        is_running_ = true;
        static_cast<void>(openni::OpenNI::addDeviceConnectedListener(this));
        static_cast<void>(openni::OpenNI::addDeviceDisconnectedListener(this));
        static_cast<void>(openni::OpenNI::addDeviceStateChangedListener(this));
        return true;
    }

    std::vector<DeviceName> devices() override {
        openni::Array<openni::DeviceInfo> list;
        openni::OpenNI::enumerateDevices(&list);
        std::vector<DeviceName> names;
        for (int i = 0; i < list.getSize(); ++i) {
            const openni::DeviceInfo& info = list[i];
            names.push_back(
                {info.getUri(), info.getVendor(), info.getName(), info.getUsbVendorId(), info.getUsbProductId()});
        }
        return names;
    }
    void watch(const std::shared_ptr<DeviceWatch>& watch) override {
        const std::lock_guard lock(mutex_);
        watches_.push_back(watch);
    }
    void forget(const std::shared_ptr<DeviceWatch>& watch) override {
        const std::lock_guard lock(mutex_);
        std::erase(watches_, watch);
    }

private:
    void onDeviceConnected(const openni::DeviceInfo*) override {}
    void onDeviceDisconnected(const openni::DeviceInfo* info) override {
        for_device(info, [](DeviceWatch& watch) { watch.is_gone = true; });
    }
    void onDeviceStateChanged(const openni::DeviceInfo* info, openni::DeviceState state) override {
        if (state != openni::DEVICE_STATE_ERROR) return;
        for_device(info, [](DeviceWatch& watch) { watch.has_failed = true; });
    }
    template <typename Job>
    void for_device(const openni::DeviceInfo* info, Job job) {
        if (info == nullptr) return;
        const std::lock_guard lock(mutex_);
        for (const std::shared_ptr<DeviceWatch>& watch : watches_) {
            if (watch->uri != info->getUri()) continue;
            job(*watch);
            watch->changed();
        }
    }

    bool is_running_ = false;
    std::mutex mutex_;
    std::vector<std::shared_ptr<DeviceWatch>> watches_;
};

}  // namespace

std::string extended_error() {
    std::string text = openni::OpenNI::getExtendedError();
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '\t')) text.pop_back();
    for (char& c : text) {
        if (c == '\n' || c == '\t') c = ' ';
    }
    text.erase(0, text.find_first_not_of(' '));
    return text.empty() ? "OpenNI2 does not say why" : text;
}

std::shared_ptr<Runtime> Runtime::get(std::string& message) {
    static std::weak_ptr<Runtime> running;
    const std::lock_guard lock(life_mutex());
    if (std::shared_ptr<Runtime> runtime = running.lock()) return runtime;
    auto runtime = std::make_shared<StockRuntime>();
    if (!runtime->start(message)) return nullptr;
    running = runtime;
    return runtime;
}

bool run_parked(std::function<void()> job) {
    // Never destroyed: its threads outlive everything.
    struct Parking {
        std::mutex mutex;
        std::condition_variable changed;
        std::vector<std::function<void()>> jobs;
        std::size_t parked = 0;
    };
    static Parking& parking = *new Parking;
    const auto serve = [] {
        std::unique_lock lock(parking.mutex);
        for (;;) {
            ++parking.parked;
            parking.changed.wait(lock, [] { return !parking.jobs.empty(); });
            --parking.parked;
            std::function<void()> mine = std::move(parking.jobs.back());
            parking.jobs.pop_back();
            lock.unlock();
            mine();
            mine = nullptr;
            lock.lock();
        }
    };
    const std::lock_guard lock(parking.mutex);
    if (parking.jobs.size() >= parking.parked) {
        try {
            std::thread(serve).detach();
        } catch (const std::system_error&) {
            return false;
        }
    }
    parking.jobs.push_back(std::move(job));
    parking.changed.notify_one();
    return true;
}

}  // namespace stillmesh::openni2
