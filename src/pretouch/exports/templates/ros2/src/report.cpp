#include "report.hpp"

#include <cmath>
#include <cstdio>

#include "diagnostic_msgs/msg/key_value.hpp"

namespace pretouch_controller {
namespace {

using diagnostic_msgs::msg::DiagnosticStatus;

std::string text_of(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
}

// Return a time in seconds with all digits down to the millisecond.
std::string seconds_of(int64_t nanoseconds) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3f", static_cast<double>(nanoseconds) * 1e-9);
    return text;
}

void add(DiagnosticStatus &status, const std::string &key, const std::string &value) {
    diagnostic_msgs::msg::KeyValue entry;
    entry.key = key;
    entry.value = value;
    status.values.push_back(entry);
}

std::string summary_of(const Record &last, bool refused, bool as_exported) {
    const int32_t flags = last.output.status;
    if (flags & PRETOUCH_LOST) return "The sensor is lost: no usable reading for longer than the timeout.";
    if (refused) return "Inputs were refused.";
    if (flags & PRETOUCH_STALE) return "A reading is overdue.";
    if (flags & (PRETOUCH_FORCE_LIMITED | PRETOUCH_MOTION_LIMITED)) return "A limit acts.";
    if (last.changed > 0) return "The controller manager changed commands, so the motion is not that of the law.";
    if (!as_exported) return "Parameters differ from the exported design.";
    return flags & PRETOUCH_DETECTING ? "An object is detected." : "No object is detected.";
}

}  // namespace

std::string reason_of(const Record &record, const LawParameters &numbers) {
    const int32_t flags = record.output.status;
    const double age = record.sample.age;
    std::string reason;
    if (flags & PRETOUCH_INVALID) {
        if (record.seen == Seen::too_near) {
            reason = "nearer than the sensor can measure";
        } else if (!std::isfinite(record.sample.reading)) {
            reason = "not a finite number";
        } else if (!(age >= 0 && age <= numbers.sensing.timeout)) {
            reason = "age of " + text_of(age) + " s, not between 0 s and the timeout of " +
                     text_of(numbers.sensing.timeout) + " s";
        } else {
            reason = "not newer than the last reading";
        }
    } else if (flags & PRETOUCH_SATURATED) {
        reason = "saturated: at or above " + text_of(numbers.sensing.saturation);
    } else if (flags & PRETOUCH_IMPLAUSIBLE) {
        reason = "changes faster than the largest rate of " + text_of(numbers.sensing.largest_rate) + " 1/s";
    }
    if (flags & PRETOUCH_INPUT_FAULT) {
        reason += reason.empty() ? "" : "; ";
        reason += "reference or contact force is not a number or too large";
    }
    return reason;
}

DiagnosticStatus status_of(const Record &last, const std::vector<Record> &refused, const LawParameters &numbers,
                           uint32_t dropped) {
    DiagnosticStatus status;
    const int32_t flags = last.output.status;
    const bool as_exported = is_as_exported(numbers);
    const bool is_limited = (flags & (PRETOUCH_STALE | PRETOUCH_FORCE_LIMITED | PRETOUCH_MOTION_LIMITED)) != 0;
    if (flags & PRETOUCH_LOST) {
        status.level = DiagnosticStatus::ERROR;
    } else if (!refused.empty() || is_limited || !as_exported || last.changed > 0) {
        status.level = DiagnosticStatus::WARN;
    } else {
        status.level = DiagnosticStatus::OK;
    }
    status.message = summary_of(last, !refused.empty(), as_exported);
    add(status, "reading", text_of(last.reading));
    add(status, "reading unchanged for [s]", text_of(last.unchanged));
    add(status, "xi", text_of(numbers.sensing.floor * std::exp(last.output.log_level)));
    add(status, "ln(xi/floor)", text_of(last.output.log_level));
    add(status, "object detected", flags & PRETOUCH_DETECTING ? "yes" : "no");
    add(status, "virtual force [N]", text_of(last.output.virtual_force));
    add(status, "in contact", flags & PRETOUCH_IN_CONTACT ? "yes" : "no");
    add(status, "status flags", std::to_string(flags));
    add(status, "refused inputs", std::to_string(last.refused));
    add(status, "late periods", std::to_string(last.late));
    add(status, "interfaces not read", std::to_string(last.missed_read));
    add(status, "commands not written", std::to_string(last.missed_write));
    add(status, "commands changed by others", std::to_string(last.changed));
    add(status, "records dropped", std::to_string(dropped));
    add(status, "as exported", as_exported ? "yes" : "no");
    for (const Record &record : refused) {
        add(status, "refused at " + seconds_of(record.time) + " s",
            text_of(record.sample.reading) + ": " + reason_of(record, numbers));
    }
    return status;
}

}  // namespace pretouch_controller
