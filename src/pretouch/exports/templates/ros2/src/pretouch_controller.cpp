#include "pretouch_controller.hpp"

#include <chrono>
#include <cmath>
#include <exception>
#include <thread>
#include <tuple>

#include "hardware_interface/types/hardware_interface_type_values.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "sensor_curve.hpp"

namespace pretouch_controller {
namespace {

constexpr double rate_tolerance = 0.005;     // of the control rate; rates of ROS are whole numbers of Hz
constexpr double late_periods = 1.5;         // periods after which an update counts as late
constexpr int send_attempts = 100;           // to publish a message outside of the control loop
constexpr auto send_pause = std::chrono::milliseconds(1);
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
    if (!check_parameters()) return CallbackReturn::FAILURE;
    clock_ = get_node()->get_clock();
    numbers_ = with_chosen_values(params_.law);
    start_law(numbers_, state_);
    if (!is_as_exported(numbers_)) {
        RCLCPP_WARN(get_node()->get_logger(), "Parameters law.* differ from the design that pretouch exported.");
    }
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

// Return whether the parameters fit together; each one alone was checked before.
bool PretouchController::check_parameters() const {
    const double period = pretouch_design.sensing.period;
    const unsigned int rate = get_update_rate();
    if (!(std::fabs(rate * period - 1) <= rate_tolerance)) {
        return fail("update_rate is " + std::to_string(rate) + " Hz, but the law was designed for a period of " +
                    std::to_string(period) + " s; set update_rate to " + std::to_string(std::lround(1 / period)));
    }
    if (!has_output("wrench") && params_.joint.empty()) {
        return fail("joint is empty, but the output '" + params_.output + "' needs the name of a joint");
    }
    if (params_.joint_units_per_meter == 0 || !std::isfinite(params_.joint_units_per_meter)) {
        return fail("joint_units_per_meter is 0 or not finite; set the joint's motion per meter toward the object");
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
    return true;
}

void PretouchController::subscribe() {
    if (params_.reading.source == "range_topic") {
        range_subscription_ = get_node()->create_subscription<sensor_msgs::msg::Range>(
            params_.reading.topic, rclcpp::SensorDataQoS(), [this](const sensor_msgs::msg::Range &message) {
                receive(static_cast<double>(message.range), rclcpp::Time(message.header.stamp).nanoseconds());
            });
    } else if (params_.reading.source == "number_topic") {
        number_subscription_ = get_node()->create_subscription<std_msgs::msg::Float64>(
            params_.reading.topic, rclcpp::SensorDataQoS(),
            [this](const std_msgs::msg::Float64 &message) { receive(message.data, 0); });
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
void PretouchController::receive(double value, int64_t measured) {
    const auto delay = static_cast<int64_t>(params_.reading.delay * 1e9);
    latest_.value = value;
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
    since_report_ = report_every_;  // the first period is reported
    unwritten_in_a_row_ = 0;
    if (!find_interfaces() || !start_reference() || !check_first_reading()) return CallbackReturn::FAILURE;
    send_rest();  // also reserves the memory of the wrench message
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
    const std::string reason =
        last.number == 0 ? "No reading has arrived on " + params_.reading.topic + "."
                         : "The last reading on " + params_.reading.topic + " is " + std::to_string(age) +
                               " s old; the timeout is " + std::to_string(numbers_.sensing.timeout) + " s.";
    if (!is_current && params_.reading.required) return fail(reason);
    if (!is_current) RCLCPP_WARN(get_node()->get_logger(), "%s", reason.c_str());
    return true;
}

// Command no motion and no force beyond the reference. A position command stays as it is.
void PretouchController::send_rest() {
    if (command_ != nullptr && !has_output("position")) std::ignore = command_->set_value(0.0);
    for (int i = 0; realtime_wrench_ && i < send_attempts && !send_force(0); i++) {
        std::this_thread::sleep_for(send_pause);
    }
}

CallbackReturn PretouchController::on_deactivate(const rclcpp_lifecycle::State &) {
    send_rest();
    reading_ = count_ = age_ = contact_force_ = joint_position_ = joint_velocity_ = nullptr;
    command_ = nullptr;
    return CallbackReturn::SUCCESS;
}

CallbackReturn PretouchController::on_cleanup(const rclcpp_lifecycle::State &) {
    diagnostics_timer_.reset();
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
    read_reference(sample);
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

// Return the value of an interface; another value if there is no interface or another thread is writing to it.
double PretouchController::value_of(Input input, double otherwise) {
    if (input == nullptr) return otherwise;
    const auto value = input->get_optional();
    if (!value.has_value()) counters_.missed_read++;
    return value.value_or(otherwise);
}

void PretouchController::read_reference(pretouch_sample &sample) {
    for (std::size_t i = 0; i < 3 && i < ordered_exported_reference_interfaces_.size(); i++) {
        const auto value = ordered_exported_reference_interfaces_[i]->get_optional();
        if (!value.has_value()) counters_.missed_read++;
        references_[i] = value.value_or(references_[i]);
    }
    sample.reference_position = references_[0] / params_.joint_units_per_meter;
    sample.reference_velocity = references_[1] / params_.joint_units_per_meter;
    sample.reference_acceleration = references_[2] / params_.joint_units_per_meter;
}

void PretouchController::read_sensor(pretouch_sample &sample) {
    if (reads_interface()) {
        read_sensor_interface(sample);
    } else {
        read_sensor_topic(sample);
    }
    if (params_.reading.quantity == "distance") sample.reading = output_at(sample.reading) + numbers_.sensing.offset;
}

void PretouchController::read_sensor_interface(pretouch_sample &sample) {
    const auto reading = reading_->get_optional();
    const double count = value_of(count_, last_count_);
    if (!reading.has_value()) {  // a reading that was not taken now is taken in the next period
        counters_.missed_read++;
        return;
    }
    if (params_.reading.new_when == "count") {
        sample.fresh = std::isfinite(count) && count != last_count_;
    } else {
        sample.fresh = params_.reading.new_when == "every_period" || !is_same(*reading, last_reading_);
    }
    if (sample.fresh) last_count_ = count;
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
    sample.age = static_cast<double>(clock_->now().nanoseconds() - received->measured) * 1e-9;
}

// Write the command; return whether it was written.
bool PretouchController::write(const pretouch_output &output) {
    const double scale = params_.joint_units_per_meter;
    if (has_output("wrench")) return send_force(output.virtual_force);
    if (has_output("position")) return command_->set_value(scale * output.position);
    if (has_output("velocity")) return command_->set_value(scale * output.velocity);
    // an impedance controller; the power of the joint equals that of the force
    const double position = value_of(joint_position_, scale * output.position) / scale;
    const double velocity = value_of(joint_velocity_, scale * output.velocity) / scale;
    const double force = params_.effort.mass * output.acceleration +
                         params_.effort.damping * (output.velocity - velocity) +
                         params_.effort.stiffness * (output.position - position);
    const bool is_number = std::isfinite(force);  // false if the state of the joint is none
    return command_->set_value(is_number ? force / scale : 0.0) && is_number;
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
