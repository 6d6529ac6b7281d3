// An array in a file without a name, mapped into memory: it may be far larger than memory, the system writes to disk
// what it has no room for. Grows by doubling; never shrinks. Elements are plain data, zeros when new. All the space is
// asked for before it is used, so that a full disk is an answer and no signal.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace stillmesh {

// The name that the file has for a moment on file systems that know none without: killed in that moment, it stays.
inline constexpr std::string_view kPagesName = "stillmesh-index.";
inline bool is_name_of_pages(std::string_view name) {
    return name.starts_with(kPagesName) && name.size() == kPagesName.size() + 6;
}

template <typename T>
class PagedArray {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    PagedArray() = default;
    ~PagedArray() { close(); }
    PagedArray(const PagedArray&) = delete;
    PagedArray& operator=(const PagedArray&) = delete;

    // 0, or errno. No folder: in memory after all.
    [[nodiscard]] int open(const std::string& folder) {
        close();
        if (folder.empty()) {
            descriptor_ = ::memfd_create("stillmesh index", MFD_CLOEXEC);
            return descriptor_ < 0 ? errno : 0;
        }
        descriptor_ = ::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
        if (descriptor_ >= 0) return 0;
        std::string name = folder + "/" + std::string(kPagesName) + "XXXXXX";  // file systems without O_TMPFILE
        descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
        if (descriptor_ < 0) return errno;
        static_cast<void>(::unlink(name.c_str()));
        return 0;
    }
    // Room for so many. 0, or errno: what was there stays.
    [[nodiscard]] int reserve(std::size_t count) {
        if (count <= capacity_) return 0;
        std::size_t wanted = capacity_ == 0 ? 4096 / sizeof(T) + 1 : capacity_;
        while (wanted < count) wanted *= 2;
        const std::size_t bytes = wanted * sizeof(T);
        if (const int error = ::posix_fallocate(descriptor_, 0, static_cast<off_t>(bytes)); error != 0) return error;
        void* const there = data_ == nullptr
                                ? ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0)
                                : ::mremap(data_, capacity_ * sizeof(T), bytes, MREMAP_MAYMOVE);
        if (there == MAP_FAILED) return errno;
        data_ = static_cast<T*>(there);
        capacity_ = wanted;
        return 0;
    }
    void fill_zero() {
        if (data_ != nullptr) std::memset(static_cast<void*>(data_), 0, capacity_ * sizeof(T));
    }
    [[nodiscard]] std::size_t capacity() const { return capacity_; }
    [[nodiscard]] T& operator[](std::size_t i) { return data_[i]; }
    [[nodiscard]] const T& operator[](std::size_t i) const { return data_[i]; }

private:
    void close() {
        if (data_ != nullptr) static_cast<void>(::munmap(data_, capacity_ * sizeof(T)));
        if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
        data_ = nullptr;
        capacity_ = 0;
        descriptor_ = -1;
    }
    int descriptor_ = -1;
    T* data_ = nullptr;
    std::size_t capacity_ = 0;
};

}  // namespace stillmesh
