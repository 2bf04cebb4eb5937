// Records of the control loop, and the diagnostic message that a timer outside of the loop makes of them.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_status.hpp"
#include "law.hpp"
#include "range_reading.hpp"

namespace pretouch_controller {

// Inputs, outputs and counters of one period.
struct Record {
    int64_t time = 0;  // of the controller manager [ns]
    pretouch_sample sample{};
    pretouch_output output{};
    uint32_t refused = 0;       // periods with inputs that the law refused since the activation
    uint32_t late = 0;          // periods that came late
    uint32_t missed_read = 0;   // interfaces that could not be read
    uint32_t missed_write = 0;  // commands that could not be written
    uint32_t changed = 0;       // commands that were changed after they were written
    Seen seen = Seen::reading;  // in this period
    double reading = 0;         // last reading [unit of the scenario]
    double unchanged = 0;       // time since the value of the state interface changed [s]
};

// Return whether the law refused the reading, the reference or the contact force of this period.
inline bool is_refused(const Record &record) {
    return (record.output.status &
            (PRETOUCH_INVALID | PRETOUCH_SATURATED | PRETOUCH_IMPLAUSIBLE | PRETOUCH_INPUT_FAULT)) != 0;
}

// Queue from one writer to one reader without locks. If it is full, new records are counted and dropped.
class RecordQueue {
public:
    void push(const Record &record) {
        const std::size_t last = written_.load(std::memory_order_relaxed);
        if (last - read_.load(std::memory_order_acquire) == records_.size()) {
            dropped_.fetch_add(1, std::memory_order_relaxed);
            return;
        }
        records_[last % records_.size()] = record;
        written_.store(last + 1, std::memory_order_release);
    }

    bool pop(Record &record) {
        const std::size_t first = read_.load(std::memory_order_relaxed);
        if (first == written_.load(std::memory_order_acquire)) return false;
        record = records_[first % records_.size()];
        read_.store(first + 1, std::memory_order_release);
        return true;
    }

    uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

private:
    std::array<Record, 1024> records_{};
    std::atomic<std::size_t> written_{0}, read_{0};
    std::atomic<uint32_t> dropped_{0};
};

// Return why the law refused the inputs of a period, in words.
std::string reason_of(const Record &record, const LawParameters &numbers);

// Return the diagnostic status of the last record and of all refused readings before it.
diagnostic_msgs::msg::DiagnosticStatus status_of(const Record &last, const std::vector<Record> &refused,
                                                 const LawParameters &numbers, uint32_t dropped);

}  // namespace pretouch_controller
