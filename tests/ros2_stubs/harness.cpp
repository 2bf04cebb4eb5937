// Runs the exported controller against the stubs. It reads one command per line and prints one answer per line.
// It counts memory allocations and blocking locks inside of `update`.
#include <dlfcn.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <sstream>
#include <thread>

#include "pretouch_controller.hpp"

// ---- counters ----

static thread_local bool counting = false;
static long allocations = 0, locks = 0, sleeps = 0;

extern "C" {
void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void *malloc(size_t size) {
    allocations += counting;
    return __libc_malloc(size);
}
void *calloc(size_t count, size_t size) {
    allocations += counting;
    return __libc_calloc(count, size);
}
void *realloc(void *memory, size_t size) {
    allocations += counting;
    return __libc_realloc(memory, size);
}
int nanosleep(const timespec *, timespec *) {
    sleeps++;
    return 0;
}
int clock_nanosleep(clockid_t, int, const timespec *, timespec *) {
    sleeps++;
    return 0;
}
int pthread_mutex_lock(pthread_mutex_t *mutex) {
    using Lock = int (*)(pthread_mutex_t *);
    static const Lock original = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
    locks += counting;
    return original(mutex);
}
}

// ---- the controller with its interfaces ----

using namespace pretouch_controller;
using hardware_interface::CommandInterface;
using hardware_interface::StateInterface;

static std::unique_ptr<PretouchController> controller;
static std::map<std::string, std::shared_ptr<StateInterface>> states;
static std::map<std::string, std::shared_ptr<CommandInterface>> commands;
static std::vector<CommandInterface::SharedPtr> references;
static geometry_msgs::msg::Wrench wrench;

template <class Handle>
static std::shared_ptr<Handle> handle(const std::string &name) {
    const auto slash = name.rfind('/');
    return std::make_shared<Handle>(name.substr(0, slash), name.substr(slash + 1));
}

static const char *text_of(CallbackReturn result) {
    return result == CallbackReturn::SUCCESS ? "success" : result == CallbackReturn::FAILURE ? "failure" : "error";
}

static std::string configure(unsigned int rate) {
    controller = std::make_unique<PretouchController>();
    controller->update_rate = rate;
    if (controller->on_init() != CallbackReturn::SUCCESS) return "error";
    const auto result = controller->on_configure({});
    if (result == CallbackReturn::SUCCESS) references = controller->export_reference_interfaces();
    return text_of(result);
}

// Lend the interfaces that the controller asks for, as far as they exist.
static std::string activate() {
    std::vector<hardware_interface::LoanedCommandInterface> lent_commands;
    std::vector<hardware_interface::LoanedStateInterface> lent_states;
    for (const auto &name : controller->command_interface_configuration().names) {
        if (commands.count(name)) lent_commands.emplace_back(commands[name]);
    }
    for (const auto &name : controller->state_interface_configuration().names) {
        if (states.count(name)) lent_states.emplace_back(states[name]);
    }
    controller->assign_interfaces(std::move(lent_commands), std::move(lent_states));
    return text_of(controller->on_activate({}));
}

static return_type update(double period) {
    const rclcpp::Time time(stub::world().now);
    const rclcpp::Duration duration(std::chrono::nanoseconds(std::llround(period * 1e9)));
    counting = true;
    const return_type result = controller->update(time, duration);
    counting = false;
    return result;
}

static double command_value() { return commands.empty() ? wrench.force.z : commands.begin()->second->value; }

// ---- test vectors ----

struct Row {
    int run, fresh, status;
    double in[6], out[5];
};

static std::vector<Row> rows_of(const std::string &path) {
    std::vector<Row> rows;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        Row r;
        if (std::sscanf(line.c_str(), "%d,%lf,%lf,%lf,%lf,%lf,%lf,%d,%lf,%lf,%lf,%lf,%lf,%d", &r.run, r.in, r.in + 1,
                        r.in + 2, r.in + 3, r.in + 4, r.in + 5, &r.fresh, r.out, r.out + 1, r.out + 2, r.out + 3,
                        r.out + 4, &r.status) == 14) {
            rows.push_back(r);
        }
    }
    // an interface of sensor outputs cannot say that there is no object
    std::vector<Row> played;
    for (const Row &row : rows) {
        const auto is_unseen = [&row](const Row &other) { return other.run == row.run && other.fresh == PRETOUCH_NO_OBJECT; };
        if (std::none_of(rows.begin(), rows.end(), is_unseen)) played.push_back(row);
    }
    return played;
}

static void feed(const Row &row) {
    states["proximity/reading"]->value = row.in[0];
    states["proximity/age"]->value = row.in[1];
    states["proximity/count"]->value += row.fresh;
    states["contact/force"]->value = row.in[2];
    stub::world().now += 1000000;
    if (controller->chained) {
        for (int i = 0; i < 3; i++) references[i]->value = row.in[3 + i];
    } else {
        trajectory_msgs::msg::JointTrajectoryPoint point;
        point.positions = {row.in[3]};
        point.velocities = {row.in[4]};
        point.accelerations = {row.in[5]};
        stub::send("~/reference", point);
    }
}

static bool start_vectors(unsigned int rate, bool chained) {
    for (auto &state : states) state.second->value = 0;
    if (configure(rate) != "success") return false;
    controller->chained = chained;
    return activate() == "success";
}

// Print steps, and how many commands differ from one column of the vectors in any bit.
static void replay(const std::string &path, int column, unsigned int rate, bool chained) {
    int steps = 0, different = 0, run = -1;
    for (const Row &row : rows_of(path)) {
        if (row.run != run && !start_vectors(rate, chained)) {
            std::cout << "no start\n";
            return;
        }
        run = row.run;
        feed(row);
        if (update(1.0 / rate) != return_type::OK) different++;
        const double found = command_value(), wanted = row.out[column];
        different += !(found == wanted || (std::isnan(found) && std::isnan(wanted)));
        steps++;
        for (const auto &timer : stub::world().timers) timer();
    }
    std::cout << steps << " " << different << "\n";
}

static double time_by(clockid_t clock) {  // [us]
    timespec t;
    clock_gettime(clock, &t);
    return static_cast<double>(t.tv_sec) * 1e6 + static_cast<double>(t.tv_nsec) * 1e-3;
}

// Print times of a call [us], first of `update`, then of the law alone: the longest by the wall clock, the longest
// computing time, the slowest row of the vectors if each row counts with its fastest repetition, and the median.
static void measure(const std::string &path, long calls, unsigned int rate) {
    const auto rows = rows_of(path);
    const auto time_of = [&](const auto &call) {
        double longest = 0;
        std::vector<double> times(static_cast<std::size_t>(calls)), fastest(rows.size(), 1e9);
        for (std::size_t i = 0; i < times.size(); i++) {
            const Row &row = rows[i % rows.size()];
            feed(row);
            const double start = time_by(CLOCK_MONOTONIC), begun = time_by(CLOCK_THREAD_CPUTIME_ID);
            call(row);
            times[i] = time_by(CLOCK_THREAD_CPUTIME_ID) - begun;
            const double elapsed = time_by(CLOCK_MONOTONIC) - start;
            longest = std::max(longest, elapsed);
            fastest[i % rows.size()] = std::min(fastest[i % rows.size()], elapsed);
            if (i % 100 == 0) {
                for (const auto &timer : stub::world().timers) timer();
            }
        }
        std::sort(times.begin(), times.end());
        std::cout << longest << " " << times.back() << " " << *std::max_element(fastest.begin(), fastest.end()) << " "
                  << times[times.size() / 2] << "\n";
    };
    if (!start_vectors(rate, true)) std::abort();
    time_of([&](const Row &) { update(1.0 / rate); });
    LawState state;
    start_law(pretouch_design, state);
    time_of([&](const Row &row) {
        const pretouch_sample sample = {row.in[0], row.in[1], row.in[2], row.in[3], row.in[4], row.in[5], row.fresh};
        pretouch_output out;
        step_law(pretouch_design, state, sample, out);
    });
}

// ---- commands ----

static void diagnose() {
    stub::world().publications[stub_params().diagnostics.topic] = [](const void *data) {
        const auto &message = *static_cast<const diagnostic_msgs::msg::DiagnosticArray *>(data);
        for (const auto &status : message.status) {
            std::cout << int{status.level} << "\t" << status.message;
            for (const auto &entry : status.values) std::cout << "\t" << entry.key << "=" << entry.value;
        }
    };
    for (const auto &timer : stub::world().timers) timer();
    std::cout << "\n";
}

static void run(const std::string &line) {
    std::istringstream words(line);
    std::string verb, name, value;
    words >> verb >> name >> value;
    const auto number = [](const std::string &text) { return std::strtod(text.c_str(), nullptr); };
    if (verb == "param") {
        stub::world().overrides[name] = 1;
        std::cout << set_stub_parameter(name, value);
    } else if (verb == "busy") {
        stub::world().publishers_are_busy = name == "1";
    } else if (verb == "largest_velocity") {
        stub::world().largest_velocities[name] = number(value);
    } else if (verb == "timers") {
        for (const auto &timer : stub::world().timers) timer();
    } else if (verb == "set_reference") {  // as a controller before this one does
        references[0]->value = number(name);
        references[1]->value = number(value);
    } else if (verb == "time_states") {  // longest computing times of deactivations and activations [us], and sleeps
        double longest[2] = {0, 0};
        for (int i = 0; i < static_cast<int>(number(name)); i++) {
            for (int k = 0; k < 2; k++) {
                const double start = time_by(CLOCK_THREAD_CPUTIME_ID);
                if (k == 0) controller->on_deactivate({});
                if (k == 1) controller->on_activate({});
                longest[k] = std::max(longest[k], time_by(CLOCK_THREAD_CPUTIME_ID) - start);
            }
        }
        std::cout << longest[0] << " " << longest[1] << " " << sleeps << "\n";
    } else if (verb == "set_command") {  // as the controller manager does
        commands[name]->value = number(value);
    } else if (verb == "state") {
        if (!states.count(name)) states[name] = handle<StateInterface>(name);
        states[name]->value = number(value);
    } else if (verb == "command") {
        commands[name] = handle<CommandInterface>(name);
    } else if (verb == "block") {
        if (states.count(name)) states[name]->blocked = value == "1";
        if (commands.count(name)) commands[name]->blocked = value == "1";
    } else if (verb == "wrong_type") {
        states[name]->wrong_type = true;
    } else if (verb == "configure") {
        stub::world().publications[stub_params().wrench.topic] = [](const void *data) {
            wrench = static_cast<const geometry_msgs::msg::WrenchStamped *>(data)->wrench;
        };
        std::cout << configure(static_cast<unsigned int>(number(name))) << "\n";
    } else if (verb == "chained") {
        controller->chained = name == "1";
    } else if (verb == "activate") {
        std::cout << activate() << "\n";
    } else if (verb == "deactivate") {
        std::cout << text_of(controller->on_deactivate({})) << " " << command_value() << "\n";
    } else if (verb == "cleanup") {
        std::cout << text_of(controller->on_cleanup({})) << "\n";
    } else if (verb == "time") {
        stub::world().now = static_cast<int64_t>(number(name));
    } else if (verb == "range") {
        sensor_msgs::msg::Range message;
        message.range = static_cast<float>(number(name));
        message.header.stamp = rclcpp::Time(static_cast<int64_t>(number(value)));
        words >> message.min_range >> message.max_range;
        stub::send("~/reading", message);
    } else if (verb == "number") {
        std_msgs::msg::Float64 message;
        message.data = number(name);
        stub::send("~/reading", message);
    } else if (verb == "reference") {
        trajectory_msgs::msg::JointTrajectoryPoint message;
        if (!name.empty()) message.positions = {number(name)};
        if (!value.empty()) message.velocities = {number(value)};
        stub::send("~/reference", message);
    } else if (verb == "update") {  // a number of periods of a length; prints the last result and the command
        return_type result = return_type::OK;
        for (int i = 0; i < std::max(1, static_cast<int>(number(name))); i++) {
            result = update(value.empty() ? 1e-3 : number(value));
        }
        std::printf("%s %.17g\n", result == return_type::OK ? "ok" : "error", command_value());
        std::fflush(stdout);
    } else if (verb == "wrench") {
        std::printf("%.17g %.17g %.17g\n", wrench.force.x, wrench.force.y, wrench.force.z);
        std::fflush(stdout);
    } else if (verb == "diagnose") {
        diagnose();
    } else if (verb == "interfaces") {
        for (const auto &n : controller->command_interface_configuration().names) std::cout << n << " ";
        std::cout << "|";
        for (const auto &n : controller->state_interface_configuration().names) std::cout << " " << n;
        std::cout << " |";
        for (const auto &reference : references) std::cout << " " << reference->get_name();
        std::cout << "\n";
    } else if (verb == "log") {
        for (const auto &text : stub::world().warnings) std::cout << "warning: " << text << "\t";
        for (const auto &text : stub::world().errors) std::cout << "error: " << text << "\t";
        std::cout << "\n";
    } else if (verb == "replay") {  // replay COLUMN RATE CHAINED FILE
        std::string chained, path;
        words >> chained >> path;
        replay(path, static_cast<int>(number(name)), static_cast<unsigned int>(number(value)), chained == "1");
    } else if (verb == "measure") {  // measure CALLS RATE FILE
        std::string path;
        words >> path;
        measure(path, static_cast<long>(number(name)), static_cast<unsigned int>(number(value)));
    } else if (verb == "counts") {
        std::cout << allocations << " " << locks << "\n";
    } else if (verb == "count_check") {  // shows that the counters work
        counting = true;
        std::vector<int> memory(100, 1);
        std::mutex mutex;
        mutex.lock();
        mutex.unlock();
        counting = false;
        std::this_thread::sleep_for(std::chrono::microseconds(1));
        std::cout << allocations << " " << locks << " " << sleeps << " " << memory[0] << "\n";
    } else {
        std::cout << "unknown command " << verb << "\n";
    }
    std::cout.flush();
}

int main() {
    for (std::string line; std::getline(std::cin, line);) run(line);
    controller.reset();  // before the world that it uses
    return 0;
}
