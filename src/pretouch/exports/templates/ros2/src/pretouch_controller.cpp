#include "pretouch_controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <tuple>

#include "hardware_interface/types/hardware_interface_type_values.hpp"
#include "parameters.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "sensor_curve.hpp"

namespace pretouch_controller {
namespace {

constexpr double rate_tolerance = 0.005;     // of the control rate; rates of ROS are whole numbers of Hz
constexpr double late_periods = 1.5;         // periods after which an update counts as late
constexpr double smallest_scale = 1e-9;      // of joint_units_per_meter
constexpr double same_command = 1e-9;        // relative difference up to which two commands are equal
constexpr auto rest_pause = std::chrono::milliseconds(5);  // until a force of 0 that was not published is tried again
const char *const reference_names[3] = {hardware_interface::HW_IF_POSITION, hardware_interface::HW_IF_VELOCITY,
                                        hardware_interface::HW_IF_ACCELERATION};

bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

}  // namespace

// ---- lifecycle ----

CallbackReturn PretouchController::on_init() {
    try {
        listener_ = std::make_shared<ParamListener>(get_node());
        params_ = listener_->get_params();
    } catch (const std::exception &error) {
        RCLCPP_ERROR(get_node()->get_logger(), "A parameter is wrong: %s", error.what());
        return CallbackReturn::ERROR;
    }
    return CallbackReturn::SUCCESS;
}

CallbackReturn PretouchController::on_configure(const rclcpp_lifecycle::State &) {
    params_ = listener_->get_params();
    if (!check_names() || !check_parameters()) return CallbackReturn::FAILURE;
    clock_ = get_node()->get_clock();
    numbers_ = with_chosen_values(params_.law);
    start_law(numbers_, state_);
    if (!is_as_exported(numbers_)) {
        RCLCPP_WARN(get_node()->get_logger(), "Parameters law.* differ from the design that pretouch exported.");
    }
    compare_joint_limits();
    const double period = numbers_.sensing.period;
    report_every_ = static_cast<uint32_t>(std::lround(std::fmax(params_.diagnostics.period / period, 1.0)));
    most_unwritten_ = static_cast<uint32_t>(std::lround(std::fmax(numbers_.sensing.timeout / period, 1.0)));
    subscribe();
    if (has_output("wrench")) {
        wrench_.header.frame_id = params_.wrench.frame;
        wrench_publisher_ = get_node()->create_publisher<geometry_msgs::msg::WrenchStamped>(
            params_.wrench.topic, rclcpp::SystemDefaultsQoS());
        realtime_wrench_ = std::make_unique<realtime_tools::RealtimePublisher<geometry_msgs::msg::WrenchStamped>>(
            wrench_publisher_);
        rest_is_due_ = true;  // the timer sends the first message, which also reserves its memory
        rest_timer_ = get_node()->create_wall_timer(rest_pause, [this]() { send_due_rest(); });
    }
    diagnostics_publisher_ = get_node()->create_publisher<diagnostic_msgs::msg::DiagnosticArray>(
        params_.diagnostics.topic, rclcpp::SystemDefaultsQoS());
    diagnostics_timer_ = get_node()->create_wall_timer(std::chrono::duration<double>(params_.diagnostics.period),
                                                       [this, publisher = diagnostics_publisher_]() {
                                                           publish_diagnostics(*publisher);
                                                       });
    return CallbackReturn::SUCCESS;
}

bool PretouchController::fail(const std::string &reason) const {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", reason.c_str());
    return false;
}

// Return whether this controller knows all parameters that were given to its node. A misspelled one would be ignored.
bool PretouchController::check_names() {
    for (const auto &given : get_node()->get_node_parameters_interface()->get_parameter_overrides()) {
        const std::string &name = given.first;
        if (is_known_parameter(name)) continue;
        const std::string nearest = nearest_parameter(name);
        const std::string problem = "This controller has no parameter " + name;
        if (!nearest.empty()) return fail(problem + "; did you mean " + nearest + "?");
        RCLCPP_WARN(get_node()->get_logger(), "%s; it is ignored.", problem.c_str());
    }
    return true;
}

// Return whether the parameters are numbers and fit together. The range of each one was checked before, but a comparison
// with NaN is no range.
bool PretouchController::check_parameters() const {
    const char *const not_finite = first_not_finite(params_);
    if (not_finite != nullptr) return fail(std::string(not_finite) + " is not a finite number");
    const double period = pretouch_design.sensing.period;
    const unsigned int rate = get_update_rate();
    if (!(std::fabs(rate * period - 1) <= rate_tolerance)) {
        return fail("update_rate is " + std::to_string(rate) + " Hz, but the law was designed for a period of " +
                    std::to_string(period) + " s; set update_rate to " + std::to_string(std::lround(1 / period)));
    }
    if (!has_output("wrench") && params_.joint.empty()) {
        return fail("joint is empty, but the output '" + params_.output + "' needs the name of a joint");
    }
    if (std::fabs(params_.joint_units_per_meter) < smallest_scale) {
        return fail("joint_units_per_meter is 0 or nearly 0; set the joint's motion per meter toward the object");
    }
    if (!params_.contact_force.interface.empty() && params_.contact_force.scale == 0) {
        return fail("contact_force.scale is 0, so a contact would never be seen; set the force per unit of "
                    "contact_force.interface, or leave that empty");
    }
    if (reads_interface() && params_.reading.new_when == "count" && params_.reading.count_interface.empty()) {
        return fail("reading.count_interface is empty, but reading.new_when is 'count'");
    }
    if (!(params_.law.saturation > params_.law.offset + params_.law.floor)) {
        return fail("law.saturation is not above the sum of law.offset and law.floor");
    }
    if (has_output("effort") && params_.effort.stiffness == 0 && params_.effort.damping == 0) {
        return fail("effort.stiffness and effort.damping are both 0, so the joint would not follow the law");
    }
    const auto &axis = params_.wrench.axis;
    const double length = axis.size() == 3 ? std::hypot(axis[0], axis[1], axis[2]) : 0;
    if (has_output("wrench") && !(std::fabs(length - 1) <= 1e-6)) {
        return fail("wrench.axis has the length " + std::to_string(length) + ", expected a unit vector");
    }
    const bool is_one_axis = axis.size() == 3 && std::fabs(axis[0]) + std::fabs(axis[1]) + std::fabs(axis[2]) <= 1 + 1e-6;
    if (has_output("wrench") && !is_one_axis) {
        RCLCPP_WARN(get_node()->get_logger(),
                    "wrench.axis is not along one axis of its frame. An admittance_controller that selects fewer axes takes "
                    "only a part of the force.");
    }
    return true;
}

// Warn if the limits of the joint in the URDF are tighter than those of the law: the controller manager clips commands.
void PretouchController::compare_joint_limits() const {
    const auto &all = get_hard_joint_limits();
    const auto found = all.find(params_.joint);
    if (found == all.end() || has_output("wrench")) return;
    const double scale = std::fabs(params_.joint_units_per_meter);
    const auto &law = numbers_.drive.limits;
    const auto compare = [this, scale](bool exists, double limit, double wanted, const char *parameter) {
        if (!exists || !(limit < scale * wanted)) return;
        RCLCPP_WARN(get_node()->get_logger(),
                    "The URDF limits joint %s to %g, but %s allows %g. The controller manager may clip the commands, so "
                    "that the motion differs from the verified one. Verify the design with the limit of the joint.",
                    params_.joint.c_str(), limit, parameter, scale * wanted);
    };
    const auto &joint = found->second;
    compare(joint.has_velocity_limits, joint.max_velocity, law.speed, "law.largest_speed");
    compare(joint.has_acceleration_limits, joint.max_acceleration, law.acceleration, "law.largest_acceleration");
}

void PretouchController::subscribe() {
    if (params_.reading.source == "range_topic") {
        range_subscription_ = get_node()->create_subscription<sensor_msgs::msg::Range>(
            params_.reading.topic, rclcpp::SensorDataQoS(), [this](const sensor_msgs::msg::Range &message) {
                const auto range = static_cast<double>(message.range);
                const Seen seen = seen_at(range, static_cast<double>(message.min_range),
                                          static_cast<double>(message.max_range));
                receive(range, seen, rclcpp::Time(message.header.stamp).nanoseconds());
            });
    } else if (params_.reading.source == "number_topic") {
        number_subscription_ = get_node()->create_subscription<std_msgs::msg::Float64>(
            params_.reading.topic, rclcpp::SensorDataQoS(),
            [this](const std_msgs::msg::Float64 &message) { receive(message.data, Seen::reading, 0); });
    }
    reference_subscription_ = get_node()->create_subscription<trajectory_msgs::msg::JointTrajectoryPoint>(
        "~/reference", rclcpp::SystemDefaultsQoS(), [this](const trajectory_msgs::msg::JointTrajectoryPoint &message) {
            if (message.positions.empty()) {
                fail("A message on ~/reference has no position and is ignored.");
                return;
            }
            ReceivedReference reference;
            reference.position = message.positions[0];
            reference.velocity = message.velocities.empty() ? 0 : message.velocities[0];
            reference.acceleration = message.accelerations.empty() ? 0 : message.accelerations[0];
            reference.arrived = clock_->now().nanoseconds();
            reference.exists = true;
            received_reference_.set(reference);
        });
}

// Keep a reading of a topic. Without a time stamp, it was measured `reading.delay` ago.
void PretouchController::receive(double value, Seen seen, int64_t measured) {
    const auto delay = static_cast<int64_t>(params_.reading.delay * 1e9);
    latest_.value = value;
    latest_.seen = seen;
    latest_.measured = measured != 0 ? measured : clock_->now().nanoseconds() - delay;
    latest_.number++;
    received_.set(latest_);
}

controller_interface::InterfaceConfiguration PretouchController::command_interface_configuration() const {
    if (has_output("wrench")) return {controller_interface::interface_configuration_type::NONE, {}};
    return {controller_interface::interface_configuration_type::INDIVIDUAL, {params_.joint + "/" + params_.output}};
}

controller_interface::InterfaceConfiguration PretouchController::state_interface_configuration() const {
    std::vector<std::string> names;
    const auto &joint = params_.state_joint.empty() ? params_.joint : params_.state_joint;
    if (has_output("position") || has_output("effort")) names.push_back(joint + "/position");
    if (has_output("effort")) names.push_back(joint + "/velocity");
    if (reads_interface()) {
        names.push_back(params_.reading.interface);
        if (!params_.reading.count_interface.empty()) names.push_back(params_.reading.count_interface);
        if (!params_.reading.age_interface.empty()) names.push_back(params_.reading.age_interface);
    }
    if (!params_.contact_force.interface.empty()) names.push_back(params_.contact_force.interface);
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
}

// Export position, velocity and acceleration of the reference x_d in units of the joint.
std::vector<hardware_interface::CommandInterface::SharedPtr>
PretouchController::on_export_reference_interfaces_list() {
    const std::string prefix =
        std::string(get_node()->get_name()) + "/" + (params_.joint.empty() ? "axis" : params_.joint);
    std::vector<hardware_interface::CommandInterface::SharedPtr> references;
    for (const char *name : reference_names) {
        references.push_back(std::make_shared<hardware_interface::CommandInterface>(prefix, name));
        std::ignore = references.back()->set_value(0.0);
    }
    return references;
}

CallbackReturn PretouchController::on_activate(const rclcpp_lifecycle::State &) {
    start_law(numbers_, state_);
    counters_ = Record{};
    counters_.reading = std::numeric_limits<double>::quiet_NaN();
    since_report_ = report_every_;  // the first period is reported
    unwritten_in_a_row_ = 0;
    behind_ = reference_unchanged_ = since_reading_ = 0;
    is_first_period_ = true;
    has_written_ = false;
    if (!find_interfaces() || !start_reference() || !check_first_reading()) return CallbackReturn::FAILURE;
    send_rest();
    is_active_ = true;
    return CallbackReturn::SUCCESS;
}

bool PretouchController::find_input(const std::string &name, Input &input) {
    input = nullptr;
    if (name.empty()) return true;
    for (const auto &candidate : state_interfaces_) {
        if (candidate.get_name() != name) continue;
        try {
            std::ignore = candidate.get_optional();
        } catch (const std::exception &error) {
            return fail("The state interface " + name + " is not a number of type double: " + error.what());
        }
        input = &candidate;
        return true;
    }
    return fail("The state interface " + name + " is missing; check the name and that its hardware is active.");
}

bool PretouchController::find_interfaces() {
    const auto &joint = params_.state_joint.empty() ? params_.joint : params_.state_joint;
    const auto if_read = [this](const std::string &name) { return reads_interface() ? name : std::string(); };
    const bool needs_position = has_output("position") || has_output("effort");
    command_ = nullptr;
    for (auto &candidate : command_interfaces_) {
        if (candidate.get_name() == params_.joint + "/" + params_.output) command_ = &candidate;
    }
    if (command_ == nullptr && !has_output("wrench")) {
        return fail("The command interface " + params_.joint + "/" + params_.output + " is missing.");
    }
    return find_input(if_read(params_.reading.interface), reading_) &&
           find_input(if_read(params_.reading.count_interface), count_) &&
           find_input(if_read(params_.reading.age_interface), age_) &&
           find_input(params_.contact_force.interface, contact_force_) &&
           find_input(needs_position ? joint + "/position" : std::string(), joint_position_) &&
           find_input(has_output("effort") ? joint + "/velocity" : std::string(), joint_velocity_);
}

// Hold the present position until a reference arrives.
bool PretouchController::start_reference() {
    const double position = value_of(joint_position_, 0);
    if (!std::isfinite(position)) {
        return fail("The position of the joint is not a finite number, so the robot would jump at the activation.");
    }
    received_reference_.set(ReceivedReference{});
    reference_ = ReceivedReference{};
    const double values[3] = {position, 0, 0};
    for (std::size_t i = 0; i < 3; i++) {
        references_[i] = values[i];
        if (i < ordered_exported_reference_interfaces_.size()) {
            std::ignore = ordered_exported_reference_interfaces_[i]->set_value(values[i]);
        }
    }
    state_.drive.reference = position / params_.joint_units_per_meter;
    return true;
}

// Readings that came before the activation are not new, but they show whether the sensor works.
bool PretouchController::check_first_reading() {
    const double none = std::numeric_limits<double>::quiet_NaN();
    if (reads_interface()) {
        last_reading_ = value_of(reading_, none);
        last_count_ = value_of(count_, 0);
        if (!std::isfinite(last_reading_)) {
            return fail("The state interface " + params_.reading.interface + " has no reading (NaN); start the sensor.");
        }
        return true;
    }
    const ReceivedReading last = received_.get();
    last_number_ = last.number;
    const double age = static_cast<double>(clock_->now().nanoseconds() - last.measured) * 1e-9;
    const bool is_current = last.number > 0 && age <= numbers_.sensing.timeout;
    if (!is_current && params_.reading.required) {
        return fail(last.number == 0
                        ? "No reading has arrived on " + params_.reading.topic + "."
                        : "The last reading on " + params_.reading.topic + " is " + std::to_string(age) +
                              " s old; the timeout is " + std::to_string(numbers_.sensing.timeout) + " s.");
    }
    is_without_reading_ = !is_current;  // said outside of the control loop
    return true;
}

// Command no motion and no force beyond the reference. A position command stays as it is. The controller manager calls
// this within a control period, so nothing waits here: what cannot be sent now, a timer sends.
void PretouchController::send_rest() {
    if (command_ != nullptr && !has_output("position")) std::ignore = command_->set_value(0.0);
    if (realtime_wrench_) rest_is_due_ = !send_force(0);
}

// Send a force of 0 that could not be sent, or that was never sent. This runs outside of the control loop.
void PretouchController::send_due_rest() {
    if (!rest_is_due_ || is_active_) return;
    geometry_msgs::msg::WrenchStamped rest;
    rest.header.frame_id = params_.wrench.frame;
    rest.header.stamp = clock_->now();
    if (realtime_wrench_->try_publish(rest)) rest_is_due_ = false;
}

CallbackReturn PretouchController::on_deactivate(const rclcpp_lifecycle::State &) {
    send_rest();
    is_active_ = false;
    reading_ = count_ = age_ = contact_force_ = joint_position_ = joint_velocity_ = nullptr;
    command_ = nullptr;
    return CallbackReturn::SUCCESS;
}

CallbackReturn PretouchController::on_cleanup(const rclcpp_lifecycle::State &) {
    diagnostics_timer_.reset();
    rest_timer_.reset();
    diagnostics_publisher_.reset();
    realtime_wrench_.reset();
    wrench_publisher_.reset();
    range_subscription_.reset();
    number_subscription_.reset();
    reference_subscription_.reset();
    return CallbackReturn::SUCCESS;
}

// ---- one period: nothing below allocates memory or waits for a lock ----

return_type PretouchController::update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) {
    if (const auto received = received_reference_.try_get()) reference_ = *received;
    if (!reference_.exists) return return_type::OK;
    const double age = static_cast<double>(clock_->now().nanoseconds() - reference_.arrived) * 1e-9;
    const bool is_current = age <= params_.reference_timeout;  // an old reference stays where it is
    const double values[3] = {reference_.position, is_current ? reference_.velocity : 0,
                              is_current ? reference_.acceleration : 0};
    for (std::size_t i = 0; i < 3; i++) {
        std::ignore = ordered_exported_reference_interfaces_[i]->set_value(values[i]);
    }
    return return_type::OK;
}

return_type PretouchController::update_and_write_commands(const rclcpp::Time &time, const rclcpp::Duration &period) {
    pretouch_sample sample{};
    pretouch_output output{};
    if (period.seconds() > late_periods * numbers_.sensing.period) counters_.late++;
    check_command();
    read_reference(sample);
    catch_up(period.seconds(), sample);
    read_sensor(sample);
    if (contact_force_ != nullptr) {
        sample.contact_force = params_.contact_force.scale * value_of(contact_force_, 0);
    }
    step_law(numbers_, state_, sample, output);
    const bool written = write(output);
    if (!written) counters_.missed_write++;
    unwritten_in_a_row_ = written ? 0 : unwritten_in_a_row_ + 1;
    record(time, sample, output);
    const bool is_lost = params_.reading.stop_when_lost && (output.status & PRETOUCH_LOST) != 0;
    return is_lost || unwritten_in_a_row_ >= most_unwritten_ ? return_type::ERROR : return_type::OK;
}

// Run the periods that late updates left out, without a reading: so the law keeps the time by which readings are dated.
// They count up to the timeout, after which the sensor is lost anyway.
void PretouchController::catch_up(double elapsed, pretouch_sample sample) {
    const double period = numbers_.sensing.period;
    behind_ += is_first_period_ || !std::isfinite(elapsed) ? 0 : elapsed - period;
    is_first_period_ = false;
    const double most = period * static_cast<double>(most_unwritten_);
    behind_ = std::fmin(std::fmax(behind_, -period), most);
    for (pretouch_output unused; behind_ >= period / 2; behind_ -= period) step_law(numbers_, state_, sample, unused);
}

// Count the commands that the controller manager changed after the last period, for example to a limit of the joint.
void PretouchController::check_command() {
    if (command_ == nullptr || !has_written_) return;
    const auto value = command_->get_optional();
    const double allowed = same_command * std::fmax(1.0, std::fabs(written_));
    if (value.has_value() && !(std::fabs(*value - written_) <= allowed)) counters_.changed++;
}

bool PretouchController::command(double value) {
    has_written_ = command_->set_value(value);
    written_ = value;
    return has_written_;
}

// Return the value of an interface; another value if there is no interface or another thread is writing to it.
double PretouchController::value_of(Input input, double otherwise) {
    if (input == nullptr) return otherwise;
    const auto value = input->get_optional();
    if (!value.has_value()) counters_.missed_read++;
    return value.value_or(otherwise);
}

// Velocity and acceleration of a reference that has not changed for longer than `reference_timeout` count as 0: the
// controller that wrote it has stopped.
void PretouchController::read_reference(pretouch_sample &sample) {
    bool is_changed = false;
    for (std::size_t i = 0; i < 3 && i < ordered_exported_reference_interfaces_.size(); i++) {
        const auto value = ordered_exported_reference_interfaces_[i]->get_optional();
        if (!value.has_value()) counters_.missed_read++;
        is_changed = is_changed || (value.has_value() && !is_same(*value, references_[i]));
        references_[i] = value.value_or(references_[i]);
    }
    reference_unchanged_ = is_changed ? 0 : reference_unchanged_ + numbers_.sensing.period;
    const bool has_stopped = is_in_chained_mode() && reference_unchanged_ > params_.reference_timeout;
    sample.reference_position = references_[0] / params_.joint_units_per_meter;
    sample.reference_velocity = has_stopped ? 0 : references_[1] / params_.joint_units_per_meter;
    sample.reference_acceleration = has_stopped ? 0 : references_[2] / params_.joint_units_per_meter;
}

void PretouchController::read_sensor(pretouch_sample &sample) {
    counters_.seen = Seen::reading;
    if (reads_interface()) {
        read_sensor_interface(sample);
        if (reads_distance()) counters_.seen = seen_at(sample.reading, 0, 0);
    } else {
        read_sensor_topic(sample);
    }
    if (!sample.fresh) return;
    if (reads_distance()) take_distance(sample);
    counters_.reading = sample.reading;
}

// Convert a distance to the output of the sensor. Beyond the end of the curve, there is no object either.
void PretouchController::take_distance(pretouch_sample &sample) {
    if (counters_.seen == Seen::too_near) {
        sample.reading = std::numeric_limits<double>::quiet_NaN();  // refused, as if the sensor were saturated
    } else if (counters_.seen == Seen::no_object || sample.reading > curve_reach) {
        sample.reading = numbers_.sensing.offset;
        sample.fresh = PRETOUCH_NO_OBJECT;  // the law restarts with the next distance
    } else {
        sample.reading = output_at(sample.reading) + numbers_.sensing.offset;
    }
}

void PretouchController::read_sensor_interface(pretouch_sample &sample) {
    const auto reading = reading_->get_optional();
    const double count = value_of(count_, last_count_);
    if (!reading.has_value()) {  // a reading that was not taken now is taken in the next period
        counters_.missed_read++;
        return;
    }
    const bool is_changed = !is_same(*reading, last_reading_);
    counters_.unchanged = is_changed ? 0 : counters_.unchanged + numbers_.sensing.period;
    // an equal reading is another one with the same value, once per sensor period, unless a constant one means a fault
    since_reading_ += numbers_.sensing.period;
    const bool is_due = since_reading_ > numbers_.sensing.sensor_period - numbers_.sensing.period / 2;
    const bool is_repeated = is_due && !params_.reading.constant_is_lost;
    if (params_.reading.new_when == "count") {
        sample.fresh = std::isfinite(count) && count != last_count_;
    } else {
        sample.fresh = params_.reading.new_when == "every_period" || is_changed || is_repeated;
    }
    if (sample.fresh) {
        last_count_ = count;
        since_reading_ = 0;
    }
    last_reading_ = *reading;
    sample.reading = *reading;
    sample.age = age_ != nullptr ? value_of(age_, params_.reading.delay) : params_.reading.delay;
}

void PretouchController::read_sensor_topic(pretouch_sample &sample) {
    const auto received = received_.try_get();
    if (!received.has_value() || received->number == last_number_) return;
    last_number_ = received->number;
    sample.fresh = 1;
    sample.reading = received->value;
    counters_.seen = received->seen;
    sample.age = static_cast<double>(clock_->now().nanoseconds() - received->measured) * 1e-9;
}

// Write the command; return whether it was written.
bool PretouchController::write(const pretouch_output &output) {
    const double scale = params_.joint_units_per_meter;
    if (has_output("wrench")) return send_force(output.virtual_force);
    if (has_output("position")) return command(scale * output.position);
    if (has_output("velocity")) return command(scale * output.velocity);
    // an impedance controller; the power of the joint equals that of the force
    const double position = value_of(joint_position_, scale * output.position) / scale;
    const double velocity = value_of(joint_velocity_, scale * output.velocity) / scale;
    const double force = params_.effort.mass * output.acceleration +
                         params_.effort.damping * (output.velocity - velocity) +
                         params_.effort.stiffness * (output.position - position);
    const bool is_number = std::isfinite(force);  // false if the state of the joint is none
    return command(is_number ? force / scale : 0.0) && is_number;
}

// Hand a force along the axis to the thread that publishes it; return whether the thread was ready.
bool PretouchController::send_force(double force) {
    wrench_.header.stamp = clock_->now();
    wrench_.wrench.force.x = params_.wrench.axis[0] * force;
    wrench_.wrench.force.y = params_.wrench.axis[1] * force;
    wrench_.wrench.force.z = params_.wrench.axis[2] * force;
    return realtime_wrench_->try_publish(wrench_);
}

// Hand over one record per diagnostic period, and one for each refused input.
void PretouchController::record(const rclcpp::Time &time, const pretouch_sample &sample,
                                const pretouch_output &output) {
    counters_.time = time.nanoseconds();
    counters_.sample = sample;
    counters_.output = output;
    const bool refused = is_refused(counters_);
    if (refused) counters_.refused++;
    if (++since_report_ < report_every_ && !refused) return;
    since_report_ = since_report_ < report_every_ ? since_report_ : 0;
    records_.push(counters_);
}

// ---- outside of the control loop ----

void PretouchController::publish_diagnostics(rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray> &publisher) {
    if (is_without_reading_.exchange(false)) {
        RCLCPP_WARN(get_node()->get_logger(), "At the activation, there was no current reading on %s.",
                    params_.reading.topic.c_str());
    }
    Record last;
    std::vector<Record> refused;
    bool any = false;
    while (records_.pop(last)) {
        any = true;
        if (is_refused(last)) refused.push_back(last);
    }
    if (!any) return;  // not active
    diagnostic_msgs::msg::DiagnosticArray message;
    message.header.stamp = clock_->now();
    message.status.push_back(status_of(last, refused, numbers_, records_.dropped()));
    message.status[0].name = std::string(get_node()->get_name()) + ": pre-contact law";
    message.status[0].hardware_id = reads_interface() ? params_.reading.interface : params_.reading.topic;
    publisher.publish(message);
}

}  // namespace pretouch_controller

PLUGINLIB_EXPORT_CLASS(pretouch_controller::PretouchController, controller_interface::ChainableControllerInterface)
