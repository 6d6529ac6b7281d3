#include "platform/store/store_service.hpp"

#include <algorithm>
#include <new>
#include <system_error>
#include <utility>

#include "platform/linux/memory_reserve.hpp"

namespace stillmesh {

bool StoreService::open(const RegionStoreOptions& options, Mode mode, std::size_t body_bytes_max,
                        std::string& message) {
    mode_ = mode;
    body_bytes_max_ = body_bytes_max;
    if (!store_.open(options, message)) return false;
    content_ = store_.content();
    sequence_ = store_.sequence();
    checksum_ = store_.checksum();
    counts_ = store_.counts();
    jobs_.resize(kJobsMax);
    for (Job& job : jobs_) {
        job.words.reserve(1024);
        job.body.reserve(body_bytes_max);
        job.without.reserve(1024);
    }
    ready_.resize(kAnswersMax);
    for (Answered& answered : ready_) answered.body.resize(body_bytes_max);
    visible_.body.resize(body_bytes_max);
    working_.body.resize(body_bytes_max);
    try {
        if (mode_ == Mode::kThread) thread_ = std::thread([this] { work(); });
    } catch (const std::system_error& error) {
        message = options.folder + ": the map store has no thread to work in: " + error.what() + ".";
        store_.close();
        return false;
    }
    return true;
}

std::string StoreService::close() {
    if (!is_open()) return {};
    if (thread_.joinable()) {
        {
            const std::lock_guard lock(mutex_);
            is_closing_ = true;
        }
        changed_.notify_all();
        thread_.join();
    } else {
        do_all();
    }
    store_.sync();
    counts_ = store_.counts();
    std::string problem = store_.problem();
    if (problem.empty() && is_out_of_memory_)
        problem = "the map store: " + std::string(kNoMemory) + "; it is as it was.";
    store_.close();
    jobs_.clear();
    first_ = size_ = 0;
    return problem;
}

RegionStoreCounts StoreService::counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
}

// --- the disk's side -------------------------------------------------------------------------------------------------

void StoreService::do_job(Job& job) {
    bool is_out_of_memory = false;
    try {
        switch (job.kind) {
            case Kind::kKeep: static_cast<void>(store_.keep(job.region)); break;
            case Kind::kUse: store_.note_use(job.id); break;
            case Kind::kAsk: working_.is_found = store_.find(job.question, working_.answer, working_.body); break;
        }
    } catch (const std::bad_alloc&) {
        is_out_of_memory = true;
        working_.is_found = false;
    }
    const std::lock_guard lock(mutex_);
    if (is_out_of_memory) is_out_of_memory_ = has_failed_ = true;
    if (job.kind == Kind::kAsk) {
        if (ready_count_ == kAnswersMax) {  // nobody has polled: the oldest is forgotten
            std::rotate(ready_.begin(), ready_.begin() + 1, ready_.end());
            --ready_count_;
        }
        std::swap(ready_[ready_count_++], working_);
    }
    if (store_.has_failed()) has_failed_ = true;
    counts_ = store_.counts();
    first_ = (first_ + 1) % jobs_.size();
    if (--size_ == 0) changed_.notify_all();
}

void StoreService::do_all() {
    while (size_ > 0) do_job(jobs_[first_]);
}

void StoreService::work() {
    for (;;) {
        Job* job = nullptr;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [this] { return size_ > 0 || is_closing_; });
            if (size_ == 0) return;
            job = &jobs_[first_];
        }
        do_job(*job);
    }
}

// --- the engine's side -----------------------------------------------------------------------------------------------

StoreEvents StoreService::begin_frame(const StoreEvents& events) {
    if (!is_open()) return {};
    if (mode_ != Mode::kThread) do_all();
    const std::lock_guard lock(mutex_);
    StoreEvents out;
    taken_ = 0;
    out.is_accepting = jobs_.size() - size_ >= kPerFrame + 2 && !has_failed_;
    std::size_t wanted = has_failed_ ? 0 : ready_count_;  // the newest
    if (mode_ == Mode::kRepeated) {
        out.is_accepting = events.is_accepting;
        wanted = 0;
        for (std::size_t i = 0; i < ready_count_ && wanted == 0; ++i) {
            if (ready_[i].answer.question == events.answered) wanted = i + 1;
        }
    }
    if (wanted > 0) {
        std::swap(visible_, ready_[wanted - 1]);
        std::rotate(ready_.begin(), ready_.begin() + static_cast<std::ptrdiff_t>(wanted),
                    ready_.begin() + static_cast<std::ptrdiff_t>(ready_count_));
        ready_count_ -= wanted;
        is_visible_ = true;
        out.answered = visible_.answer.question;
    }
    is_accepting_ = out.is_accepting;
    return out;
}

StoreEvents StoreService::wait_for_room() {
    if (mode_ == Mode::kThread) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return size_ == 0; });
    }
    return begin_frame();
}

bool StoreService::has_failed() const {
    const std::lock_guard lock(mutex_);
    return has_failed_;
}

StoreService::Job* StoreService::claim() {
    return size_ == jobs_.size() ? nullptr : &jobs_[(first_ + size_) % jobs_.size()];
}

void StoreService::publish() {
    {
        const std::lock_guard lock(mutex_);
        ++size_;
    }
    changed_.notify_all();
}

StoreContent StoreService::content() const noexcept {
    return content_;
}

Status StoreService::keep(const LeavingRegion& region) noexcept {
    if (!is_open() || !is_accepting_ || taken_ == kPerFrame || region.body.size() > body_bytes_max_) {
        return Status::kFull;
    }
    Job* job = nullptr;
    {
        const std::lock_guard lock(mutex_);
        job = claim();
    }
    if (job == nullptr) return Status::kFull;
    ++taken_;
    job->kind = Kind::kKeep;
    job->region = region;
    job->words.assign(region.words.begin(), region.words.end());
    job->body.assign(region.body.begin(), region.body.end());
    job->region.words = job->words;
    job->region.body = job->body;
    publish();
    return Status::kOk;
}

Status StoreService::ask(const StoreQuestion& question) noexcept {
    if (!is_open()) return Status::kFull;
    Job* job = nullptr;
    {
        const std::lock_guard lock(mutex_);
        job = claim();
    }
    // Room for it was left by is_accepting_, unless nothing has been done for long: then no answer will come either.
    if (job == nullptr || !is_accepting_) return Status::kFull;
    job->kind = Kind::kAsk;
    job->question = question;
    job->words.assign(question.words.begin(), question.words.end());
    job->without.assign(question.without.begin(), question.without.end());
    job->question.words = job->words;
    job->question.without = job->without;
    publish();
    return Status::kOk;
}

Status StoreService::poll(StoreAnswer& answer, std::span<std::byte> body) noexcept {
    if (!is_visible_) return Status::kTimedOut;
    is_visible_ = false;
    answer = visible_.answer;
    if (!visible_.is_found) return Status::kNotFound;
    if (answer.size_bytes > body.size()) {
        answer.size_bytes = 0;
        return Status::kOk;
    }
    std::copy_n(visible_.body.begin(), answer.size_bytes, body.begin());
    return Status::kOk;
}

void StoreService::note_use(std::uint64_t id) noexcept {
    if (!is_open() || !is_accepting_ || taken_ == kPerFrame) return;
    Job* job = nullptr;
    {
        const std::lock_guard lock(mutex_);
        job = claim();
    }
    if (job == nullptr) return;
    ++taken_;
    job->kind = Kind::kUse;
    job->id = id;
    publish();
}

}  // namespace stillmesh
