// ros2_control controller that moves a robot away from an approaching object before contact.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "controller_interface/chainable_controller_interface.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "geometry_msgs/msg/wrench_stamped.hpp"
#include "law.hpp"
#include "pretouch_controller/pretouch_controller_parameters.hpp"
#include "rclcpp/rclcpp.hpp"
#include "realtime_tools/realtime_publisher.hpp"
#include "realtime_tools/realtime_thread_safe_box.hpp"
#include "report.hpp"
#include "sensor_msgs/msg/range.hpp"
#include "std_msgs/msg/float64.hpp"
#include "trajectory_msgs/msg/joint_trajectory_point.hpp"

namespace pretouch_controller {

using controller_interface::CallbackReturn;
using controller_interface::return_type;

// A reading that arrived on a topic.
struct ReceivedReading {
    double value = 0;
    Seen seen = Seen::reading;
    int64_t measured = 0;  // when it was measured, by the clock of the node [ns]
    uint64_t number = 0;   // counts the readings
};

// A reference that arrived on a topic.
struct ReceivedReference {
    double position = 0, velocity = 0, acceleration = 0;
    int64_t arrived = 0;  // by the clock of the node [ns]
    bool exists = false;
};

class PretouchController : public controller_interface::ChainableControllerInterface {
public:
    CallbackReturn on_init() override;
    CallbackReturn on_configure(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_activate(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &previous) override;
    controller_interface::InterfaceConfiguration command_interface_configuration() const override;
    controller_interface::InterfaceConfiguration state_interface_configuration() const override;

protected:
    std::vector<hardware_interface::CommandInterface::SharedPtr> on_export_reference_interfaces_list() override;
    return_type update_reference_from_subscribers(const rclcpp::Time &time, const rclcpp::Duration &period) override;
    return_type update_and_write_commands(const rclcpp::Time &time, const rclcpp::Duration &period) override;

private:
    using Input = const hardware_interface::LoanedStateInterface *;
    using Command = hardware_interface::LoanedCommandInterface *;

    // lifecycle
    bool check_names();
    bool check_parameters() const;
    void compare_joint_limits() const;
    bool fail(const std::string &reason) const;
    void subscribe();
    void receive(double value, Seen seen, int64_t measured);
    bool find_interfaces();
    bool find_input(const std::string &name, Input &input);
    bool start_reference();
    bool check_first_reading();
    void send_rest();
    void send_due_rest();

    // one period
    void catch_up(double elapsed, pretouch_sample sample);
    void check_command();
    bool command(double value);
    double value_of(Input input, double otherwise);
    void read_reference(pretouch_sample &sample);
    void read_sensor(pretouch_sample &sample);
    void read_sensor_interface(pretouch_sample &sample);
    void read_sensor_topic(pretouch_sample &sample);
    void take_distance(pretouch_sample &sample);
    bool write(const pretouch_output &output);
    bool send_force(double force);
    void record(const rclcpp::Time &time, const pretouch_sample &sample, const pretouch_output &output);

    // outside of the control loop
    void publish_diagnostics(rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray> &publisher);

    bool has_output(const char *name) const { return params_.output == name; }
    bool reads_interface() const { return params_.reading.source == "interface"; }
    bool reads_distance() const {
        return params_.reading.quantity == "distance" || params_.reading.source == "range_topic";
    }

    std::shared_ptr<ParamListener> listener_;
    Params params_;
    LawParameters numbers_{};
    LawState state_{};
    rclcpp::Clock::SharedPtr clock_;

    Input reading_ = nullptr, count_ = nullptr, age_ = nullptr, contact_force_ = nullptr;
    Input joint_position_ = nullptr, joint_velocity_ = nullptr;
    Command command_ = nullptr;

    realtime_tools::RealtimeThreadSafeBox<ReceivedReading> received_;
    realtime_tools::RealtimeThreadSafeBox<ReceivedReference> received_reference_;
    ReceivedReading latest_;            // written by the subscription only
    ReceivedReference reference_;       // of the control loop
    double references_[3] = {0, 0, 0};  // last values of the reference interfaces
    double last_reading_ = 0, last_count_ = 0;
    double since_reading_ = 0;        // time since a reading of the state interface was used [s]
    double reference_unchanged_ = 0;  // time since the reference changed [s]
    double behind_ = 0;               // time by which the law is behind the clock [s]
    double written_ = 0;              // last command
    bool is_first_period_ = true, has_written_ = false;
    std::atomic<bool> is_without_reading_{false};
    uint64_t last_number_ = 0;

    rclcpp::Subscription<sensor_msgs::msg::Range>::SharedPtr range_subscription_;
    rclcpp::Subscription<std_msgs::msg::Float64>::SharedPtr number_subscription_;
    rclcpp::Subscription<trajectory_msgs::msg::JointTrajectoryPoint>::SharedPtr reference_subscription_;
    rclcpp::Publisher<geometry_msgs::msg::WrenchStamped>::SharedPtr wrench_publisher_;
    std::unique_ptr<realtime_tools::RealtimePublisher<geometry_msgs::msg::WrenchStamped>> realtime_wrench_;
    geometry_msgs::msg::WrenchStamped wrench_;
    rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_publisher_;
    rclcpp::TimerBase::SharedPtr diagnostics_timer_, rest_timer_;
    std::atomic<bool> is_active_{false}, rest_is_due_{false};

    RecordQueue records_;
    Record counters_;  // the counters of the next record
    uint32_t report_every_ = 1, since_report_ = 0, unwritten_in_a_row_ = 0, most_unwritten_ = 1;
};

}  // namespace pretouch_controller
