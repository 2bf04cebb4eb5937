// Stand-ins for the parts of ROS 2 that the exported controller uses. They declare only what it needs, with the
// signatures of ROS 2 Jazzy, also which functions are const, and run without ROS. A test sets the clock, fills topics and reads messages and logs.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace stub {
// One world per process: time, topics, messages and logs.
struct World {
    int64_t now = 1;  // [ns]
    std::map<std::string, std::function<void(const void *)>> subscriptions;
    std::map<std::string, std::function<void(const void *)>> publications;  // called with each message
    std::vector<std::function<void()>> timers;
    std::vector<std::string> errors, warnings;
    std::map<std::string, int> overrides;  // names of the parameters that a file gives
    std::map<std::string, double> largest_velocities;  // of the joints in the URDF
    bool publishers_are_busy = false;
};
inline World &world() {
    static World one;
    return one;
}
template <class Message>
void send(const std::string &topic, const Message &message) {
    world().subscriptions.at(topic)(&message);
}
}  // namespace stub

#define STUB_LOG(list, logger, ...)                   \
    do {                                              \
        (void)(logger);                               \
        char stub_line[1024];                         \
        std::snprintf(stub_line, 1024, __VA_ARGS__);  \
        stub::world().list.push_back(stub_line);      \
    } while (0)
#define RCLCPP_ERROR(...) STUB_LOG(errors, __VA_ARGS__)
#define RCLCPP_WARN(...) STUB_LOG(warnings, __VA_ARGS__)
#define PLUGINLIB_EXPORT_CLASS(Derived, Base)                                                       \
    static_assert(std::is_base_of<Base, Derived>::value && !std::is_abstract<Derived>::value, "plugin");

namespace builtin_interfaces::msg {
struct Time {
    int32_t sec = 0;
    uint32_t nanosec = 0;
};
}  // namespace builtin_interfaces::msg

namespace std_msgs::msg {
struct Header {
    builtin_interfaces::msg::Time stamp;
    std::string frame_id;
};
struct Float64 {
    double data = 0;
};
}  // namespace std_msgs::msg

namespace sensor_msgs::msg {
struct Range {
    std_msgs::msg::Header header;
    float min_range = 0, max_range = 0, range = 0;
};
}  // namespace sensor_msgs::msg

namespace geometry_msgs::msg {
struct Vector3 {
    double x = 0, y = 0, z = 0;
};
struct Wrench {
    Vector3 force, torque;
};
struct WrenchStamped {
    std_msgs::msg::Header header;
    Wrench wrench;
};
}  // namespace geometry_msgs::msg

namespace trajectory_msgs::msg {
struct JointTrajectoryPoint {
    std::vector<double> positions, velocities, accelerations, effort;
};
}  // namespace trajectory_msgs::msg

namespace diagnostic_msgs::msg {
struct KeyValue {
    std::string key, value;
};
struct DiagnosticStatus {
    static constexpr unsigned char OK = 0, WARN = 1, ERROR = 2, STALE = 3;
    unsigned char level = 0;
    std::string name, message, hardware_id;
    std::vector<KeyValue> values;
};
struct DiagnosticArray {
    std_msgs::msg::Header header;
    std::vector<DiagnosticStatus> status;
};
}  // namespace diagnostic_msgs::msg

namespace rclcpp {
class Time {
public:
    explicit Time(int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
    explicit Time(const builtin_interfaces::msg::Time &time)
        : nanoseconds_(int64_t{1000000000} * time.sec + time.nanosec) {}
    int64_t nanoseconds() const { return nanoseconds_; }
    operator builtin_interfaces::msg::Time() const {
        return {static_cast<int32_t>(nanoseconds_ / 1000000000), static_cast<uint32_t>(nanoseconds_ % 1000000000)};
    }

private:
    int64_t nanoseconds_;
};
class Duration {
public:
    explicit Duration(std::chrono::nanoseconds time) : nanoseconds_(time.count()) {}
    double seconds() const { return static_cast<double>(nanoseconds_) * 1e-9; }

private:
    int64_t nanoseconds_;
};
struct Clock {
    using SharedPtr = std::shared_ptr<Clock>;
    Time now() { return Time(stub::world().now); }
};
struct Logger {};
struct QoS {};
struct SystemDefaultsQoS : QoS {};
struct SensorDataQoS : QoS {};
template <class Message>
struct Publisher {
    using SharedPtr = std::shared_ptr<Publisher>;
    std::string topic;
    void publish(const Message &message) {
        const auto &receivers = stub::world().publications;
        if (const auto found = receivers.find(topic); found != receivers.end()) found->second(&message);
    }
};
template <class Message>
struct Subscription {
    using SharedPtr = std::shared_ptr<Subscription>;
    std::string topic;
    ~Subscription() { stub::world().subscriptions.erase(topic); }
};
struct TimerBase {
    using SharedPtr = std::shared_ptr<TimerBase>;
    ~TimerBase() { stub::world().timers.clear(); }
};
}  // namespace rclcpp

namespace rclcpp_lifecycle {
struct State {};
class LifecycleNode {
public:
    const char *get_name() const { return "pretouch_controller"; }
    rclcpp::Logger get_logger() const { return {}; }
    rclcpp::Clock::SharedPtr get_clock() { return clock_; }
    struct Parameters {
        const std::map<std::string, int> &get_parameter_overrides() const { return stub::world().overrides; }
    };
    std::shared_ptr<Parameters> get_node_parameters_interface() { return std::make_shared<Parameters>(); }
    template <class Message, class Callback>
    typename rclcpp::Subscription<Message>::SharedPtr create_subscription(const std::string &topic, const rclcpp::QoS &,
                                                                          Callback callback) {
        stub::world().subscriptions[topic] = [callback](const void *message) {
            callback(*static_cast<const Message *>(message));
        };
        return std::shared_ptr<rclcpp::Subscription<Message>>(new rclcpp::Subscription<Message>{topic});
    }
    template <class Message>
    typename rclcpp::Publisher<Message>::SharedPtr create_publisher(const std::string &topic, const rclcpp::QoS &) {
        return std::shared_ptr<rclcpp::Publisher<Message>>(new rclcpp::Publisher<Message>{topic});
    }
    template <class Number, class Ratio, class Callback>
    rclcpp::TimerBase::SharedPtr create_wall_timer(std::chrono::duration<Number, Ratio>, Callback callback) {
        stub::world().timers.push_back(callback);
        return std::make_shared<rclcpp::TimerBase>();
    }

private:
    rclcpp::Clock::SharedPtr clock_ = std::make_shared<rclcpp::Clock>();
};
}  // namespace rclcpp_lifecycle

namespace hardware_interface {
constexpr char HW_IF_POSITION[] = "position";
constexpr char HW_IF_VELOCITY[] = "velocity";
constexpr char HW_IF_ACCELERATION[] = "acceleration";

// A value that a test can block (as another thread would) or give a wrong type.
class Handle {
public:
    Handle(const std::string &prefix, const std::string &name) : name_(prefix + "/" + name) {}
    const std::string &get_name() const { return name_; }
    template <class T = double>
    [[nodiscard]] std::optional<T> get_optional() const {
        if (wrong_type) throw std::runtime_error("data type bool");
        if (blocked) return std::nullopt;
        return value;
    }
    template <class T>
    [[nodiscard]] bool set_value(const T &wanted) {
        if (blocked) return false;
        value = wanted;
        return true;
    }
    double value = std::numeric_limits<double>::quiet_NaN();
    bool blocked = false, wrong_type = false;

private:
    std::string name_;
};
struct StateInterface : Handle {
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<StateInterface>;
};
struct CommandInterface : Handle {
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<CommandInterface>;
};
class LoanedStateInterface {
public:
    explicit LoanedStateInterface(std::shared_ptr<const StateInterface> handle) : handle_(std::move(handle)) {}
    LoanedStateInterface(const LoanedStateInterface &) = delete;
    LoanedStateInterface(LoanedStateInterface &&) = default;
    const std::string &get_name() const { return handle_->get_name(); }
    template <class T = double>
    [[nodiscard]] std::optional<T> get_optional(unsigned int = 10) const {
        return handle_->get_optional<T>();
    }

private:
    std::shared_ptr<const StateInterface> handle_;
};
class LoanedCommandInterface {
public:
    template <class T = double>
    [[nodiscard]] std::optional<T> get_optional(unsigned int = 10) const {
        return handle_->get_optional<T>();
    }
    explicit LoanedCommandInterface(std::shared_ptr<CommandInterface> handle) : handle_(std::move(handle)) {}
    LoanedCommandInterface(const LoanedCommandInterface &) = delete;
    LoanedCommandInterface(LoanedCommandInterface &&) = default;
    const std::string &get_name() const { return handle_->get_name(); }
    template <class T>
    [[nodiscard]] bool set_value(const T &value, unsigned int = 10) {
        return handle_->set_value(value);
    }

private:
    std::shared_ptr<CommandInterface> handle_;
};
}  // namespace hardware_interface

namespace joint_limits {
struct JointLimits {
    double max_velocity = std::numeric_limits<double>::quiet_NaN();
    double max_acceleration = std::numeric_limits<double>::quiet_NaN();
    bool has_velocity_limits = false, has_acceleration_limits = false;
};
}  // namespace joint_limits

namespace controller_interface {
enum class CallbackReturn : uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
enum class return_type : uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : uint8_t { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration {
    interface_configuration_type type = interface_configuration_type::NONE;
    std::vector<std::string> names = {};
};

class ChainableControllerInterface {
public:
    virtual ~ChainableControllerInterface() = default;
    virtual CallbackReturn on_init() = 0;
    virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual InterfaceConfiguration command_interface_configuration() const = 0;
    virtual InterfaceConfiguration state_interface_configuration() const = 0;
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
    std::shared_ptr<const rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
    unsigned int get_update_rate() const { return update_rate; }
    bool is_in_chained_mode() const { return chained; }
    const std::unordered_map<std::string, joint_limits::JointLimits> &get_hard_joint_limits() const {
        static std::unordered_map<std::string, joint_limits::JointLimits> limits;
        for (const auto &[joint, velocity] : stub::world().largest_velocities) {
            limits[joint].max_velocity = velocity;
            limits[joint].has_velocity_limits = true;
        }
        return limits;
    }
    return_type update(const rclcpp::Time &time, const rclcpp::Duration &period) {
        if (!chained && update_reference_from_subscribers(time, period) != return_type::OK) return return_type::ERROR;
        return update_and_write_commands(time, period);
    }
    const std::vector<hardware_interface::CommandInterface::SharedPtr> &export_reference_interfaces() {
        return ordered_exported_reference_interfaces_ = on_export_reference_interfaces_list();
    }
    void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface> &&commands,
                           std::vector<hardware_interface::LoanedStateInterface> &&states) {
        command_interfaces_ = std::move(commands);
        state_interfaces_ = std::move(states);
    }
    unsigned int update_rate = 0;
    bool chained = false;

protected:
    virtual std::vector<hardware_interface::CommandInterface::SharedPtr> on_export_reference_interfaces_list() {
        return {};
    }
    virtual return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
    std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;
    std::vector<hardware_interface::CommandInterface::SharedPtr> ordered_exported_reference_interfaces_;

private:
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};
}  // namespace controller_interface

namespace realtime_tools {
template <class T>
class RealtimeThreadSafeBox {
public:
    void set(const T &value) {
        const std::lock_guard<std::mutex> guard(mutex_);
        value_ = value;
    }
    [[nodiscard]] T get() const {
        const std::lock_guard<std::mutex> guard(mutex_);
        return value_;
    }
    [[nodiscard]] std::optional<T> try_get() const {
        const std::unique_lock<std::mutex> guard(mutex_, std::try_to_lock);
        if (!guard.owns_lock()) return std::nullopt;
        return value_;
    }

private:
    T value_{};
    mutable std::mutex mutex_;
};

// Publishes at once, and copies the message into its own memory as the original does.
template <class Message>
class RealtimePublisher {
public:
    explicit RealtimePublisher(typename rclcpp::Publisher<Message>::SharedPtr publisher)
        : publisher_(std::move(publisher)) {}
    bool try_publish(const Message &message) {
        const std::unique_lock<std::mutex> guard(mutex_, std::try_to_lock);
        if (!guard.owns_lock() || stub::world().publishers_are_busy) return false;
        message_ = message;
        publisher_->publish(message_);
        return true;
    }

private:
    typename rclcpp::Publisher<Message>::SharedPtr publisher_;
    Message message_;
    std::mutex mutex_;
};
}  // namespace realtime_tools
