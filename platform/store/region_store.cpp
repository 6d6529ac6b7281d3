#include "platform/store/region_store.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/base/hash.hpp"
#include "engine/geometry/turn_distance.hpp"
#include "platform/linux/process.hpp"

namespace stillmesh {
namespace {

using namespace store_records;

constexpr std::int64_t kSyncInterval_ns = 1'000'000'000;  // what a power cut may take; a kill takes less
constexpr std::uint32_t kTriesMax = 8;                    // damaged regions passed over for one answer
constexpr std::uint32_t kTidyLooks = 1024;                // entries looked at for one to move, per region written
constexpr std::uint32_t kTidyMoves = 2;
constexpr std::uint32_t kForgottenShare = 64;  // of regions_max go at once: looking for them is a pass over all

std::string segment_name(std::uint64_t number) {
    std::array<char, 32> name{};
    static_cast<void>(std::snprintf(name.data(), name.size(), "%08llu.seg", static_cast<unsigned long long>(number)));
    return name.data();
}
// 0: no segment.
std::uint64_t number_of(const std::string& name) {
    if (name.size() < 12 || name.size() > 22 || name.substr(name.size() - 4) != ".seg") return 0;
    std::uint64_t number = 0;
    for (std::size_t i = 0; i + 4 < name.size(); ++i) {
        if (name[i] < '0' || name[i] > '9') return 0;
        number = 10 * number + static_cast<std::uint64_t>(name[i] - '0');
    }
    return name == segment_name(number) ? number : 0;
}

int write_at(int descriptor, std::span<const std::byte> bytes, std::uint64_t offset) {
    while (!bytes.empty()) {
        const ssize_t count = ::pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return count < 0 ? errno : ENOSPC;
        bytes = bytes.subspan(static_cast<std::size_t>(count));
        offset += static_cast<std::uint64_t>(count);
    }
    return 0;
}
bool read_at(int descriptor, std::span<std::byte> bytes, std::uint64_t offset) {
    while (!bytes.empty()) {
        const ssize_t count = ::pread(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return false;
        bytes = bytes.subspan(static_cast<std::size_t>(count));
        offset += static_cast<std::uint64_t>(count);
    }
    return true;
}

void sync_folder(const std::string& folder) {
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return;
    static_cast<void>(::fsync(descriptor));
    static_cast<void>(::close(descriptor));
}

// Words of a record, each above the one before; false: they are not.
bool decode_words(std::span<const std::byte> bytes, std::uint32_t count, std::vector<WordWeight>& out) {
    ByteReader reader(bytes);
    out.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
        WordWeight word;
        word.word = reader.u16();
        word.weight = reader.u32();
        if (!out.empty() && word.word <= out.back().word) return false;
        if (word.weight > kBagWeightOne) return false;
        out.push_back(word);
    }
    return reader.is_ok();
}

}  // namespace

// --- opening ---------------------------------------------------------------------------------------------------------

bool RegionStore::open(const RegionStoreOptions& options, std::string& message) {
    close();
    message.clear();
    options_ = options;
    counts_ = {};
    problem_.clear();
    sequence_ = 0;
    tidy_cursor_ = 0;
    record_.reserve(kHeadBytes + kWordBytes * kWordsMax + (std::size_t{512} << 10U));
    words_.reserve(kWordsMax);
    without_.reserve(4096);
    const auto refuse = [&](const std::string& why) {
        message = why;
        close();
        return false;
    };
    std::string where = options_.folder;
    if (!where.empty()) {
        struct stat status {};
        const bool is_there = ::stat(where.c_str(), &status) == 0;
        if (is_there && !S_ISDIR(status.st_mode))
            return refuse(where + ": is no folder; choose another place for the map store.");
        if (!is_there && options_.is_scratch) return refuse(where + ": there is no such map store.");
        if (!is_there && ::mkdir(where.c_str(), 0755) != 0) {
            return refuse(where + ": cannot be made: " + std::strerror(errno) +
                          "; choose another place for the map store.");
        }
        if (!lock(message)) return refuse(std::string(message));
    }
    const std::string pages = options_.is_scratch || !options_.is_durable ? std::string() : where;
    if (const int error = index_.open(pages, options_.regions_max); error != 0) {
        return refuse(pages + ": cannot be written: " + std::strerror(error) +
                      "; choose another place for the map store.");
    }
    if (!where.empty() && !open_segments(message)) return refuse(std::string(message));
    if (!begin_segment()) return refuse(std::string(problem_));
    if (counts_.regions > options_.regions_max) make_room();
    is_open_ = true;
    if (counts_.cut_bytes > 0 || counts_.damaged > 0) {
        message = where + ": ";
        if (counts_.damaged > 0) {
            message += std::to_string(counts_.damaged) + " damaged records were left out";
            if (counts_.cut_bytes > 0) message += "; ";
        }
        if (counts_.cut_bytes > 0) {
            message += "the last record was not written to its end (" + std::to_string(counts_.cut_bytes) +
                       " bytes) and is gone";
        }
        message += "; all others are there.";
    }
    return true;
}

bool RegionStore::lock(std::string& message) {
    const std::string file = options_.folder + "/lock";
    lock_ = options_.is_scratch ? ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW)
                                : ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (lock_ < 0) {
        if (options_.is_scratch && errno == ENOENT) {
            message = options_.folder + ": is no map store.";
        } else {
            message = options_.folder + ": cannot be written: " + std::strerror(errno) +
                      "; choose another place for the map store.";
        }
        return false;
    }
    if (::flock(lock_, (options_.is_scratch ? LOCK_SH : LOCK_EX) | LOCK_NB) == 0) return true;
    message = options_.folder + ": another program is using this map store; nothing was changed.";
    return false;
}

bool RegionStore::open_segments(std::string& message) {
    DIR* const folder = ::opendir(options_.folder.c_str());
    if (folder == nullptr) {
        message = options_.folder + ": cannot be read: " + std::strerror(errno) + ".";
        return false;
    }
    std::vector<std::uint64_t> numbers;
    std::vector<std::string> left;  // by an index whose name could not be taken away
    bool is_strange = false;
    int error = 0;
    for (;;) {
        errno = 0;
        const dirent* const found = ::readdir(folder);
        if (found == nullptr) {
            error = errno;  // a folder half read must not pass for a smaller store
            break;
        }
        const std::string name = found->d_name;
        const std::uint64_t number = number_of(name);
        if (number != 0) {
            numbers.push_back(number);
        } else if (is_name_of_pages(name)) {
            left.push_back(options_.folder + "/" + name);
        } else {
            is_strange = is_strange || (name != "." && name != ".." && name != "lock");
        }
    }
    static_cast<void>(::closedir(folder));
    if (error != 0) {
        message = options_.folder + ": cannot be read: " + std::strerror(error) + ".";
        return false;
    }
    if (numbers.empty() && is_strange) {
        message = options_.folder + ": holds other files and no map store; choose another place for it.";
        if (!options_.is_scratch) static_cast<void>(::unlink((options_.folder + "/lock").c_str()));
        return false;
    }
    if (!options_.is_scratch) {
        for (const std::string& file : left) static_cast<void>(::unlink(file.c_str()));
    }
    std::sort(numbers.begin(), numbers.end());
    for (const std::uint64_t number : numbers) {
        Segment segment;
        segment.file = options_.folder + "/" + segment_name(number);
        segment.descriptor =
            ::open(segment.file.c_str(), (options_.is_scratch ? O_RDONLY : O_RDWR) | O_CLOEXEC | O_NOFOLLOW);
        if (segment.descriptor < 0) {
            message = segment.file + ": cannot be read: " + std::strerror(errno) + ".";
            return false;
        }
        Segment& kept = segments_[number] = segment;
        if (!scan(number, kept, number == numbers.back(), message)) return false;
    }
    return true;
}

// Applies a segment's records. False: `message` says why.
bool RegionStore::scan(std::uint64_t number, Segment& segment, bool is_last, std::string& message) {
    struct stat status {};
    if (::fstat(segment.descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
        message = segment.file + ": is no regular file.";
        return false;
    }
    const auto size = static_cast<std::size_t>(status.st_size);
    segment.size = size;
    // Killed, or without power, while it was begun: there is nothing in it. What the disk was not given in time is
    // zero.
    if (is_last && size <= kSegmentHeaderBytes) {
        std::array<std::byte, kSegmentHeaderBytes> header{};
        write_segment_header(header, options_.origin, number);
        std::array<std::byte, kSegmentHeaderBytes> begun{};
        const bool is_ours =
            read_at(segment.descriptor, std::span(begun).first(size), 0) &&
            std::equal(begun.begin(), begun.begin() + static_cast<std::ptrdiff_t>(size), header.begin(),
                       [](std::byte there, std::byte ours) { return there == ours || there == std::byte{0}; });
        if (is_ours) {
            if (!options_.is_scratch) {
                if (const int error = write_at(segment.descriptor, header, 0); error != 0) {
                    message = segment.file + ": cannot be written: " + std::strerror(error) + ".";
                    return false;
                }
            }
            segment.size = kSegmentHeaderBytes;
            counts_.bytes += segment.size;
            return true;
        }
    }
    void* const there = size == 0 ? nullptr : ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, segment.descriptor, 0);
    if (there == MAP_FAILED) {
        message = segment.file + ": cannot be read: " + std::strerror(errno) + ".";
        return false;
    }
    const std::span<const std::byte> bytes(static_cast<const std::byte*>(there), size);
    StoreOrigin origin;
    std::uint64_t its_number = 0;
    std::uint32_t version = 0;
    SegmentFault fault = read_segment_header(bytes, origin, its_number, version);
    if (fault == SegmentFault::kNone && its_number != number) fault = SegmentFault::kDamaged;
    bool is_right = fault == SegmentFault::kNone && origin == options_.origin;
    if (fault == SegmentFault::kOtherVersion) {
        message = segment.file + ": is of version " + std::to_string(version) + "; this program reads version " +
                  std::to_string(kStoreVersion) + ".";
    } else if (fault != SegmentFault::kNone) {
        message = segment.file + ": is damaged at its begin; move it away to go on without what is in it.";
    } else if (origin.camera_crc != options_.origin.camera_crc) {
        message = options_.folder + ": this map store was made with another camera or calibration.";
    } else if (origin.vocabulary_crc != options_.origin.vocabulary_crc) {
        message = options_.folder + ": this map store was made with another vocabulary.";
    } else if (origin.features_crc != options_.origin.features_crc) {
        message = options_.folder +
                  ": this map store was made with other features (--features, features.levels, features.scale_factor).";
    }
    const auto read = [&](std::size_t at, RecordHead& head) {
        const std::span<const std::byte> rest = bytes.subspan(at);
        if (!read_head(rest, head) || rest.size() < head.size()) return false;
        const std::span<const std::byte> words = rest.subspan(kHeadBytes, kWordBytes * head.words);
        if (crc32(words) != head.words_crc || !decode_words(words, head.words, words_)) return false;
        // What a power cut left of the last seconds may be holes.
        return !is_last || crc32(rest.subspan(kHeadBytes + words.size(), head.body_bytes)) == head.body_crc;
    };
    std::size_t at = kSegmentHeaderBytes;
    while (is_right && at < size) {
        RecordHead head;
        if (!read(at, head)) {
            std::size_t next = at;
            do {
                next = find_letters(bytes, next + 1);
            } while (next < size && !read(next, head));
            if (next == size) {
                if (is_last) {
                    counts_.cut_bytes += size - at;
                    if (!options_.is_scratch && ::ftruncate(segment.descriptor, static_cast<off_t>(at)) != 0) {
                        message = segment.file + ": cannot be written: " + std::strerror(errno) + ".";
                        is_right = false;
                    }
                    segment.size = at;
                } else {
                    ++counts_.damaged;
                }
                break;
            }
            ++counts_.damaged;
            at = next;
        }
        if (head.sequence > sequence_ && head.sequence <= options_.sequence_max) {
            sequence_ = head.sequence;
            const std::uint32_t before = index_.place_of(head.id);
            if (head.kind == RecordKind::kUse) {
                if (before != RegionIndex::kNone) index_.set_used(before, head.sequence);
            } else {
                if (before != RegionIndex::kNone) remove(before);
                if (head.kind == RecordKind::kRegion && !add(head, number, at, words_)) {
                    message = problem_;
                    is_right = false;
                }
            }
        }
        at += head.size();
    }
    if (there != nullptr) static_cast<void>(::munmap(there, size));
    counts_.bytes += segment.size;
    return is_right;
}

void RegionStore::close() {
    if (is_open_) sync();
    for (auto& [number, segment] : segments_) {
        if (segment.descriptor >= 0) static_cast<void>(::close(segment.descriptor));
    }
    segments_.clear();
    if (lock_ >= 0) static_cast<void>(::close(lock_));
    lock_ = -1;
    is_open_ = false;
}

bool RegionStore::fail(const char* what, int error) {
    if (problem_.empty()) {
        problem_ = options_.folder + ": " + what + ": " + std::strerror(error) +
                   "; nothing more is kept in the map store, what it holds is whole.";
    }
    return false;
}

// --- writing ---------------------------------------------------------------------------------------------------------

// So that there is one to write to.
bool RegionStore::begin_segment() {
    const bool has_room = !segments_.empty() && segments_.rbegin()->second.size < options_.segment_bytes_max;
    // In scratch the folder's own segments are not written to.
    if (has_room && !(options_.is_scratch && !segments_.rbegin()->second.file.empty())) return true;
    if (!segments_.empty() && !options_.is_scratch) sync();
    const std::uint64_t number = segments_.empty() ? 1 : segments_.rbegin()->first + 1;
    Segment segment;
    if (options_.is_scratch) {
        segment.descriptor = ::memfd_create("stillmesh segment", MFD_CLOEXEC);
    } else {
        segment.file = options_.folder + "/" + segment_name(number);
        segment.descriptor = ::open(segment.file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0644);
    }
    if (segment.descriptor < 0) return fail("cannot be written", errno);
    std::array<std::byte, kSegmentHeaderBytes> header{};
    write_segment_header(header, options_.origin, number);
    int error = write_at(segment.descriptor, header, 0);
    // Down to the disk before any record: after a power cut a segment without its header would be refused for ever.
    if (error == 0 && options_.is_durable && ::fdatasync(segment.descriptor) != 0 && errno != EINVAL) error = errno;
    if (error != 0) {
        static_cast<void>(::close(segment.descriptor));
        if (!segment.file.empty()) static_cast<void>(::unlink(segment.file.c_str()));
        return fail("cannot be written", error);
    }
    segment.size = kSegmentHeaderBytes;
    counts_.bytes += segment.size;
    segments_[number] = segment;
    counts_.segments = segments_.size();
    if (!options_.is_scratch && options_.is_durable) sync_folder(options_.folder);
    return true;
}

bool RegionStore::append(RecordHead& head, std::span<const WordWeight> words, std::span<const std::byte> body) {
    if (has_failed()) return false;
    if (sequence_ >= kNumberMax || head.id > kNumberMax) return fail("has no number left for a record", EOVERFLOW);
    if (!begin_segment()) return false;
    head.sequence = sequence_ + 1;
    if (head.used == 0 || head.used > head.sequence) head.used = head.sequence;
    head.words = static_cast<std::uint32_t>(words.size());
    head.body_bytes = static_cast<std::uint32_t>(body.size());
    record_.resize(head.size());
    ByteWriter writer(std::span<std::byte>{record_}.subspan(kHeadBytes));
    for (const WordWeight& word : words) {
        writer.u16(word.word);
        writer.u32(word.weight);
    }
    const std::span<const std::byte> written =
        std::span<std::byte>(record_).subspan(kHeadBytes, kWordBytes * words.size());
    head.words_crc = crc32(written);
    std::copy(body.begin(), body.end(), record_.begin() + static_cast<std::ptrdiff_t>(kHeadBytes + written.size()));
    head.body_crc = crc32(body);
    write_head(std::span<std::byte, kHeadBytes>(record_.data(), kHeadBytes), head);
    Segment& segment = segments_.rbegin()->second;
    if (const int error = write_at(segment.descriptor, record_, segment.size); error != 0) {
        // What was begun is taken back; if that fails too, the next opening cuts it off.
        [[maybe_unused]] const int cut = ::ftruncate(segment.descriptor, static_cast<off_t>(segment.size));
        return fail("cannot be written", error);
    }
    segment.size += record_.size();
    counts_.bytes += record_.size();
    sequence_ = head.sequence;
    is_dirty_ = true;
    return true;
}

bool RegionStore::keep(const LeavingRegion& region) {
    if (!is_open_ || has_failed()) return false;
    const std::uint32_t before = index_.place_of(region.id);
    if (before == RegionIndex::kNone && has_twin(region)) {
        ++counts_.known;
        return true;
    }
    if (before == RegionIndex::kNone && counts_.regions >= options_.regions_max) make_room();
    RecordHead head;
    head.kind = RecordKind::kRegion;
    head.id = region.id;
    head.time_ns = region.time_ns;
    std::copy_n(region.position_m, 3, head.position_m);
    std::copy_n(region.axis, 3, head.axis);
    if (!append(head, region.words, region.body)) return false;
    if (before != RegionIndex::kNone) remove(before);
    const auto& [number, segment] = *segments_.rbegin();
    if (!add(head, number, segment.size - head.size(), region.words)) return false;
    ++counts_.written;
    tidy();
    if (const std::int64_t now_ns = monotonic_ns(); now_ns - synced_ns_ > kSyncInterval_ns) sync();
    return true;
}

void RegionStore::note_use(std::uint64_t id) {
    if (!is_open_) return;
    const std::uint32_t place = index_.place_of(id);
    if (place == RegionIndex::kNone) return;
    RecordHead head;
    head.kind = RecordKind::kUse;
    head.id = id;
    if (append(head, {}, {})) index_.set_used(place, head.sequence);
}

void RegionStore::sync() {
    synced_ns_ = monotonic_ns();
    if (!is_dirty_ || segments_.empty() || options_.is_scratch || !options_.is_durable) return;
    is_dirty_ = false;
    if (::fdatasync(segments_.rbegin()->second.descriptor) != 0) fail("cannot be written down to the disk", errno);
}

// The ones longest without use go.
void RegionStore::make_room() {
    const std::uint64_t excess =
        counts_.regions + std::max(options_.regions_max / kForgottenShare, 1U) - options_.regions_max;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> all;  // last use, id
    for (std::uint32_t i = 0; i < index_.size(); ++i) {
        if (index_[i].is_alive != 0) all.emplace_back(index_[i].used, index_[i].id);
    }
    const auto going = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(excess, all.size()));
    std::partial_sort(all.begin(), all.begin() + going, all.end());
    for (std::ptrdiff_t i = 0; i < going; ++i) {
        const std::uint64_t id = all[static_cast<std::size_t>(i)].second;
        RecordHead head;
        head.kind = RecordKind::kGone;
        head.id = id;
        if (!append(head, {}, {})) return;
        remove(index_.place_of(id));
        ++counts_.forgotten;
    }
}

// Bounded: while more than half of the bytes are of no use, regions of the oldest segment are written anew at the end,
// until it is empty; the oldest goes first, so that no record outlives what it replaced.
void RegionStore::tidy() {
    if (options_.is_scratch) return;
    std::uint64_t alive_bytes = 0;
    for (const auto& [number, segment] : segments_) alive_bytes += segment.alive_bytes;
    if (counts_.bytes > 2 * alive_bytes + 2 * options_.segment_bytes_max && segments_.size() > 1) {
        std::uint32_t moves = 0;
        const std::uint64_t oldest = segments_.begin()->first;
        for (std::uint32_t looks = 0; looks < kTidyLooks && moves < kTidyMoves && index_.size() > 0; ++looks) {
            tidy_cursor_ = (tidy_cursor_ + 1) % index_.size();
            const IndexedRegion entry = index_[tidy_cursor_];
            if (entry.is_alive == 0 || entry.segment != oldest) continue;
            ++moves;
            std::vector<std::byte> body(entry.body_bytes);
            std::vector<WordWeight> words;
            if (!read_words(entry, words) || !read_body(entry, body)) {
                ++counts_.damaged;
                remove(tidy_cursor_);
                continue;
            }
            RecordHead head;
            head.kind = RecordKind::kRegion;
            head.id = entry.id;
            head.used = entry.used;
            head.time_ns = entry.time_ns;
            std::copy_n(entry.position_m, 3, head.position_m);
            std::copy_n(entry.axis, 3, head.axis);
            if (!append(head, words, body)) return;
            const Segment& last = segments_.rbegin()->second;
            remove(tidy_cursor_);
            if (!add(head, segments_.rbegin()->first, last.size - head.size(), words)) return;
        }
    }
    while (segments_.size() > 1 && segments_.begin()->second.alive == 0) {
        Segment& oldest = segments_.begin()->second;
        // What replaced its regions must be on the disk before they go.
        sync();
        static_cast<void>(::unlink(oldest.file.c_str()));
        static_cast<void>(::close(oldest.descriptor));
        counts_.bytes -= oldest.size;
        segments_.erase(segments_.begin());
        counts_.segments = segments_.size();
    }
}

// --- reading ---------------------------------------------------------------------------------------------------------

bool RegionStore::read_words(const IndexedRegion& entry, std::vector<WordWeight>& words) const {
    const auto segment = segments_.find(entry.segment);
    std::vector<std::byte> bytes(kWordBytes * entry.words);
    return segment != segments_.end() && read_at(segment->second.descriptor, bytes, entry.offset + kHeadBytes) &&
           crc32(bytes) == entry.words_crc && decode_words(bytes, entry.words, words);
}

bool RegionStore::read_body(const IndexedRegion& entry, std::span<std::byte> body) const {
    const auto segment = segments_.find(entry.segment);
    if (segment == segments_.end() || body.size() < entry.body_bytes) return false;
    const std::span<std::byte> out = body.first(entry.body_bytes);
    return read_at(segment->second.descriptor, out, entry.offset + kHeadBytes + kWordBytes * entry.words) &&
           crc32(out) == entry.body_crc;
}

bool RegionStore::has_twin(const LeavingRegion& region) {
    if (region.alike_score == 0) return false;
    bool is_found = false;
    for (const std::uint32_t place : index_.begin_question(region.words)) {
        if (is_found || index_.score_of(place) < region.alike_score) continue;
        const IndexedRegion& entry = index_[place];
        double away_m2 = kTurn_m2;
        for (int k = 0; k < 3; ++k) {
            const double off = static_cast<double>(entry.position_m[k]) - static_cast<double>(region.position_m[k]);
            away_m2 += off * off - kTurn_m2 * static_cast<double>(entry.axis[k]) * static_cast<double>(region.axis[k]);
        }
        is_found = away_m2 <= options_.twin_m * options_.twin_m;
    }
    index_.end_question();
    return is_found;
}

bool RegionStore::find(const StoreQuestion& question, StoreAnswer& answer, std::span<std::byte> body) {
    answer = {};
    answer.question = question.number;
    if (!is_open_) return false;
    without_.assign(question.without.begin(), question.without.end());
    std::sort(without_.begin(), without_.end());
    const std::span<const std::uint32_t> alike = index_.begin_question(question.words);
    for (std::uint32_t tries = 0; tries < kTriesMax; ++tries) {
        std::uint32_t best = RegionIndex::kNone;
        for (const std::uint32_t at : alike) {
            const IndexedRegion& entry = index_[at];
            const std::uint32_t score = index_.score_of(at);
            if (entry.is_alive == 0 || entry.id >= question.older_than || score < question.score_min) continue;
            const bool is_better = best == RegionIndex::kNone || score > index_.score_of(best) ||
                                   (score == index_.score_of(best) && entry.id < index_[best].id);
            if (!is_better || std::binary_search(without_.begin(), without_.end(), entry.id)) continue;
            best = at;
        }
        if (best == RegionIndex::kNone) break;
        const IndexedRegion& entry = index_[best];
        if (read_body(entry, body)) {
            answer.id = entry.id;
            answer.score = index_.score_of(best);
            answer.size_bytes = entry.body_bytes;
            break;
        }
        if (entry.body_bytes > body.size()) {  // for larger limits: it stays, and is not meant
            without_.insert(std::lower_bound(without_.begin(), without_.end(), entry.id), entry.id);
            continue;
        }
        ++counts_.damaged;
        remove(best);
    }
    index_.end_question();
    return answer.size_bytes > 0;
}

StoreContent RegionStore::content() const {
    StoreContent out;
    out.regions = counts_.regions;
    for (std::uint32_t i = 0; i < index_.size(); ++i) {
        if (index_[i].is_alive == 0) continue;
        out.ids_end = std::max(out.ids_end, index_[i].id + 1);
        out.time_ns = std::max(out.time_ns, index_[i].time_ns);
    }
    return out;
}

std::uint64_t RegionStore::checksum() const {
    std::uint64_t sum = 0;
    for (std::uint32_t i = 0; i < index_.size(); ++i) {
        const IndexedRegion& entry = index_[i];
        if (entry.is_alive == 0) continue;
        StateHash hash;
        hash.add(entry.id);
        hash.add(entry.used);
        hash.add(entry.words_crc);
        hash.add(entry.body_crc);
        sum += hash.value();
    }
    return sum;
}

// --- index -----------------------------------------------------------------------------------------------------------

bool RegionStore::add(const RecordHead& head, std::uint64_t segment, std::uint64_t offset,
                      std::span<const WordWeight> words) {
    // Postings of what has gone are left behind until they are most of them.
    if (index_.is_worn(counts_.regions) && !rebuild_index()) return false;
    IndexedRegion entry{};
    entry.id = head.id;
    entry.offset = offset;
    entry.sequence = head.sequence;
    entry.used = head.used;
    entry.time_ns = head.time_ns;
    entry.segment = segment;
    entry.words = head.words;
    entry.words_crc = head.words_crc;
    entry.body_bytes = head.body_bytes;
    entry.body_crc = head.body_crc;
    std::copy_n(head.position_m, 3, entry.position_m);
    std::copy_n(head.axis, 3, entry.axis);
    if (const int error = index_.add(entry, words); error != 0) return fail("the index cannot be written", error);
    ++counts_.regions;
    ++segments_[segment].alive;
    segments_[segment].alive_bytes += head.size();
    return true;
}

void RegionStore::remove(std::uint32_t place) {
    if (place == RegionIndex::kNone || index_[place].is_alive == 0) return;
    index_.remove(place);
    forget(index_[place]);
}

void RegionStore::forget(const IndexedRegion& gone) {
    --counts_.regions;
    Segment& segment = segments_[gone.segment];
    --segment.alive;
    segment.alive_bytes -= kHeadBytes + kWordBytes * gone.words + gone.body_bytes;
}

bool RegionStore::rebuild_index() {
    tidy_cursor_ = 0;
    const int error = index_.rebuild([this](const IndexedRegion& region, std::vector<WordWeight>& words) {
        if (read_words(region, words)) return true;
        ++counts_.damaged;
        forget(region);
        return false;
    });
    return error == 0 || fail("the index cannot be written", error);
}

std::string RegionStore::find_fault() const {
    std::uint64_t alive = 0;
    for (std::uint32_t i = 0; i < index_.size(); ++i) {
        if (index_[i].is_alive == 0) continue;
        ++alive;
        if (index_.place_of(index_[i].id) != i) return "a region is not found by its id";
        if (segments_.find(index_[i].segment) == segments_.end()) return "a region without a segment";
        if (index_.score_of(i) != 0) return "a score is left over";
    }
    if (alive != counts_.regions) return "the number of regions is wrong";
    std::uint64_t in_segments = 0;
    std::uint64_t bytes = 0;
    for (const auto& [number, segment] : segments_) {
        in_segments += segment.alive;
        bytes += segment.size;
    }
    if (in_segments != alive) return "the number of regions in segments is wrong";
    if (bytes != counts_.bytes) return "the number of bytes is wrong";
    return {};
}

}  // namespace stillmesh
