// The names of the parameters, and which of them are numbers: from pretouch_controller_parameters.yaml.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace pretouch_controller {

constexpr const char *parameter_names[] = {
$parameter_names
};

// Return the name of the first number that is NaN or infinite; nullptr if there is none.
template <class Parameters>
const char *first_not_finite(const Parameters &parameters) {
$finite_checks
    return nullptr;
}

// Return whether a parameter is one of this controller, or one that ROS 2 itself reads.
inline bool is_known_parameter(const std::string &name) {
    for (const char *known : parameter_names) {
        if (name == known) return true;
    }
    for (const char *own : {"use_sim_time", "update_rate", "is_async", "start_type_description_service", "lock_memory",
                            "robot_description", "type"}) {
        if (name == own) return true;
    }
    return name.rfind("qos_overrides.", 0) == 0 || name.rfind("async_parameters.", 0) == 0 ||
           name.rfind("diagnostic_updater.", 0) == 0;
}

// Return the number of letters to change, insert or leave out, to get one name from another.
inline std::size_t changes_between(const std::string &a, const std::string &b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); j++) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); i++) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); j++) {
            const std::size_t above = row[j];
            row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
            diagonal = above;
        }
    }
    return row[b.size()];
}

// Return the parameter that a misspelled name probably means; empty if none is similar.
inline std::string nearest_parameter(const std::string &name) {
    const auto group = name.substr(0, name.find('.') + 1);  // empty without a point
    std::string nearest;
    std::size_t fewest = std::max<std::size_t>(2, name.size() / 4) + 1;
    for (const char *known : parameter_names) {
        const std::size_t changes = changes_between(name, known);
        const bool same_group = !group.empty() && std::string(known).rfind(group, 0) == 0;
        if (changes < fewest || (nearest.empty() && same_group)) {
            nearest = known;
            fewest = std::min(fewest, changes);
        }
    }
    return nearest;
}

}  // namespace pretouch_controller
