// An encounter of a whole robot in MuJoCo: sensors, laws, reference, tracking and contacts, see robots/encounter.py.
// Python continues a run after what happens once or rarely, such as the first detection of a site.

#ifndef __wasm__

#include <setjmp.h>
#include <string.h>

#include "robot.hpp"

namespace pretouch {

namespace {

constexpr double AT_SURFACE = 2e-3;  // m: a point of the site's body belongs to its surface up to this height
constexpr double MARGIN = 1e-9;      // rad or m: a joint counts as at the end of its range
constexpr int SURFACE = 1, RIGID = 2;
constexpr int JOINT_RANGE = 1, SINGULARITY = 2;
enum Phase : int64_t { PERIOD, STEP, REFERENCE, APPLY, END };

using Run = pretouch_robot_run;
using Site = pretouch_robot_site;

double dot(const double *a, const double *b, int64_t n) {
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}
double norm(const double *v) { return sqrt(dot(v, v, 3)); }

const double *point_of(const Run &run, const Site &site) { return run.site_points + 3 * site.index; }
const double *frame_of(const Run &run, const Site &site) { return run.site_frames + 9 * site.index; }

// Writes the axis of a sensor in the world frame.
void axis_of(const Run &run, const Site &site, double *axis) {
    const double *frame = frame_of(run, site), *u = site.sight->rays;
    for (int i = 0; i < 3; i++) axis[i] = dot(frame + 3 * i, u, 3);
}

// Position, velocity and acceleration of a reference at a time within a period of the controller.
void interpolate(const double *target, double period, double at, double *motion, int64_t stride) {
    const double s = at / period, a = target[1] * period, b = target[3] * period;
    const double second = 3.0 * (target[2] - target[0]) - 2.0 * a - b;
    const double third = a + b - 2.0 * (target[2] - target[0]);
    motion[0] += target[0] + s * (a + s * (second + s * third));
    motion[stride] += (a + s * (2.0 * second + 3.0 * s * third)) / period;
    motion[2 * stride] += (2.0 * second + 6.0 * s * third) / (period * period);
}

// ---- controllers ----

// Runs one step of the law of a site with its latest reading; returns whether it has detected its first object.
bool ask(Site &site, double t) {
    Sensor &sensor = *static_cast<Sensor *>(site.sensor);
    const int32_t fresh = deliver(sensor, t);
    const pretouch_sample sample = {sensor.reading,    larger(t - sensor.measured, 0.0), -site.force,
                                    site.approach * t, site.approach,                    0.0,
                                    fresh};
    site.step(site.parameters, site.law, &sample, &site.output);
    site.target[0] = site.target[2];
    site.target[1] = site.target[3];
    site.target[2] = site.output.position;
    site.target[3] = site.output.velocity;
    if (site.detected || !(site.output.status & PRETOUCH_DETECTING) || !isfinite(site.glance.distance)) return false;
    site.detected = 1;
    return true;
}

bool touched(const Site &site) { return !isnan(site.time); }

// Moves the hand of a centering law for one period.
void move_hand(Run &run) {
    const pretouch_output &one = run.sites[run.hand_first].output, &two = run.sites[run.hand_second].output;
    bool any = false;
    for (int64_t i = 0; i < run.site_count; i++) any = any || touched(run.sites[i]);
    double wanted = 0.0;
    if (!any && (one.status & two.status & PRETOUCH_DETECTING))
        wanted = run.hand_gain * (two.log_level - one.log_level + run.hand_floors);
    const double before = run.hand_velocity;
    run.hand_target[0] = run.hand_position;
    run.hand_target[1] = before;
    run.hand_velocity += run.hand_share * (wanted - before);
    run.hand_position += run.period * (before + run.hand_velocity) / 2.0;
    run.hand_target[2] = run.hand_position;
    run.hand_target[3] = run.hand_velocity;
}

// Runs the controllers at the start of a period; returns whether a site has detected its first object.
bool ask_all(Run &run) {
    const double t = static_cast<double>(run.number) * run.period;
    bool detected = false;
    for (int64_t i = 0; i < run.site_count; i++) detected = ask(run.sites[i], t) || detected;
    for (int64_t i = 0; i < run.site_count; i++)
        if (isnan(run.sites[i].output.position)) run.phase = END;  // such as a law in Python that has failed
    if (run.hand_first >= 0) move_hand(run);
    return detected;
}

// ---- references ----

// Follows the path of a single site over known anchors to one within the spacing of a point. Returns whether it got
// there.
bool follow_table(Run &run, double point) {
    pretouch_robot_path &path = run.path;
    const int64_t n = run.driven_count, width = 3 * n + 3;
    const double step = point - path.points[0];
    const int64_t count = static_cast<int64_t>(fabs(step) / path.spacing);
    for (int64_t i = 0; i < count; i++) {
        const double next = path.points[0] + copysign(path.spacing, step);
        const int64_t row = static_cast<int64_t>(nearbyint(next / path.spacing)) - path.first;
        if (row < 0 || row >= path.rows) return false;
        const double *at = path.table + row * width;
        if (at[0] == 0.0) return false;
        memcpy(path.joints, at + 1, static_cast<size_t>(n) * sizeof(double));
        memcpy(path.motions, at + 1 + n, static_cast<size_t>(n) * sizeof(double));
        memcpy(path.turn, at + 1 + 2 * n, static_cast<size_t>(n) * sizeof(double));
        path.direction[0] = at[1 + 3 * n];
        path.points[0] = at[2 + 3 * n];
    }
    return true;
}

// Computes the joint reference for the motion of the sites. Returns false if the path needs another anchor. what:
// output, what keeps the reference from following the sites.
bool set_reference(Run &run, int64_t *what) {
    pretouch_robot_path &path = run.path;
    const int64_t n = run.driven_count, m = run.site_count;
    const double *points = run.motion, *velocities = points + m, *accelerations = velocities + m;
    double along = 0.0, swing = 0.0, distance = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        along = swing = distance = 0.0;
        for (int64_t i = 0; i < m; i++) {
            const double step = points[i] - path.points[i];
            distance += step * step;
            along += step * path.direction[i];
            swing += velocities[i] * path.direction[i];
        }
        if (pass == 1 || run.anchored || !(distance >= path.spacing * path.spacing)) break;
        if (path.blocked * (points[0] - path.points[0]) > 0.0) break;
        path.blocked = 0.0;
        path.ends = 0;
        if (m != 1 || !follow_table(run, points[0])) return false;
    }
    double *position = run.reference, *velocity = position + n, *acceleration = velocity + n;
    bool inside = !(path.ends && distance >= path.spacing * path.spacing);
    for (int64_t j = 0; j < n; j++) {
        const double *motions = path.motions + j * m, *turn = path.turn + j * m;
        double x = path.joints[j], v = 0.0, a = 0.0;
        for (int64_t i = 0; i < m; i++) {
            const double step = points[i] - path.points[i], motion = motions[i] + along * turn[i];
            x += (motions[i] + along / 2.0 * turn[i]) * step;
            v += motion * velocities[i];
            a += motion * accelerations[i] + swing * turn[i] * velocities[i];
        }
        position[j] = x;
        velocity[j] = v;
        acceleration[j] = a;
        inside = inside && !(x < path.ranges[2 * j] - MARGIN || x > path.ranges[2 * j + 1] + MARGIN);
    }
    *what = distance >= 4.0 * path.spacing * path.spacing ? SINGULARITY : 0;
    const size_t size = static_cast<size_t>(n) * sizeof(double);
    if (inside) {
        memcpy(path.inside, position, size);
    } else {  // rest in the last possible position
        memcpy(position, path.inside, size);
        memset(velocity, 0, 2 * size);
        *what = JOINT_RANGE;
    }
    return true;
}

void set_motion(Run &run) {
    const int64_t m = run.site_count;
    const double at = static_cast<double>(run.sub_step) * run.time_step;
    memset(run.motion, 0, static_cast<size_t>(3 * m) * sizeof(double));
    for (int64_t i = 0; i < m; i++) {
        interpolate(run.sites[i].target, run.period, at, run.motion + i, m);
        if (run.hand_first < 0 || run.sites[i].hand == 0.0) continue;
        double hand[3] = {0.0, 0.0, 0.0};
        interpolate(run.hand_target, run.period, at, hand, 1);
        for (int64_t k = 0; k < 3; k++) run.motion[k * m + i] += run.sites[i].hand * hand[k];
    }
}

// Replaces the reference by the last one that the controller of the joints has taken and that has arrived. Before the
// first one arrives, it follows the motion of the first one backward in time.
void delay_reference(Run &run) {
    if (!run.setpoints) return;
    const pretouch_joint_feedback &f = run.feedback;
    const int64_t n = run.driven_count, width = 1 + 3 * n;
    const double time = static_cast<double>(run.number) * run.period + static_cast<double>(run.sub_step) * run.time_step;
    const size_t size = static_cast<size_t>(3 * n) * sizeof(double);
    const double next = f.interval * static_cast<double>(run.setpoint_tail);
    if (f.interval == 0.0 || time >= next - INSTANT) {
        double *row = run.setpoints + run.setpoint_tail % run.most_setpoints * width;
        row[0] = time + f.delay;
        memcpy(row + 1, run.reference, size);
        run.setpoint_tail++;
    }
    while (run.setpoint_head + 1 < run.setpoint_tail &&
           run.setpoints[(run.setpoint_head + 1) % run.most_setpoints * width] <= time + INSTANT)
        run.setpoint_head++;
    const double *row = run.setpoints + run.setpoint_head % run.most_setpoints * width;
    memcpy(run.reference, row + 1, size);
    const double early = row[0] - time;
    if (early > INSTANT)
        for (int64_t j = 0; j < n; j++) run.reference[j] -= early * run.reference[n + j];
}

// ---- torques ----

// How the active equality constraints move the base: the rows A of unit length, shape (count, nv), and the
// singular value decomposition of their columns A_b of the base, U S V^T. `left` has the columns U S.
struct Constraints {
    double *rows, *left, *right, *sizes, *first, *second;
    int64_t count;
    double largest;
};

// Reads the constraints of a step; returns false if they do not fit into the memory.
bool read_constraints(Run &run, Constraints &c) {
    const int64_t nv = run.nv, b = run.base_count, all = *run.constraint_count;
    c.count = 0;
    if (!run.equality) return true;
    const int64_t number = *run.equality_count;
    if (number > run.most_equalities || all > run.most_constraints) return false;
    c.rows = run.equality;
    c.left = c.rows + run.most_equalities * nv;
    c.right = c.left + run.most_equalities * b;
    c.sizes = c.right + 2 * b * b;
    c.first = c.sizes + b;
    c.second = c.first + b;
    for (int64_t i = 0; i < number; i++) {
        double *row = c.rows + c.count * nv;
        run.selected[i] = 1.0;
        run.engine->mul_jac_t(run.model, run.data, row, run.selected);
        run.selected[i] = 0.0;
        const double size = sqrt(dot(row, row, nv));
        if (!(size > 0.0)) continue;
        for (int64_t j = 0; j < nv; j++) row[j] /= size;
        for (int64_t k = 0; k < b; k++) c.left[c.count * b + k] = row[run.base[k]];
        c.count++;
    }
    orthogonalize(c.left, c.count, b, c.right);
    c.largest = 0.0;
    for (int64_t k = 0; k < b; k++) {
        double sum = 0.0;
        for (int64_t i = 0; i < c.count; i++) sum += c.left[i * b + k] * c.left[i * b + k];
        c.sizes[k] = sqrt(sum);
        c.largest = larger(c.largest, c.sizes[k]);
    }
    return true;
}

bool is_held(const Constraints &c, int64_t k) { return c.sizes[k] > DEPENDENT * c.largest; }
bool is_loose(const Constraints &c, int64_t k) { return !(c.sizes[k] > DEPENDENT * larger(1.0, c.largest)); }

// Adds the motion of the base that the constraints cause to a velocity of the joints, -A_b^+ A_q w.
void follow(const Run &run, const Constraints &c, double *velocity) {
    const int64_t b = run.base_count;
    for (int64_t k = 0; k < b; k++) c.first[k] = 0.0;
    for (int64_t i = 0; i < c.count; i++) {
        const double moved = dot(c.rows + i * run.nv, velocity, run.nv);  // the base is still at rest
        for (int64_t k = 0; k < b; k++)
            if (is_held(c, k)) c.first[k] -= c.left[i * b + k] * moved / (c.sizes[k] * c.sizes[k]);
    }
    for (int64_t j = 0; j < b; j++) velocity[run.base[j]] = dot(c.right + j * b, c.first, b);
}

// Returns the force on a joint that the constraints transmit from forces on the base, row j of -A_q^T (A_b^+)^T f_b.
// second: output of set_multipliers.
void set_multipliers(const Run &run, const Constraints &c, const double *force) {
    const int64_t b = run.base_count;
    for (int64_t k = 0; k < b; k++) {
        double sum = 0.0;
        for (int64_t j = 0; j < b; j++) sum += c.right[j * b + k] * force[run.base[j]];
        c.second[k] = is_held(c, k) ? sum / (c.sizes[k] * c.sizes[k]) : 0.0;
    }
}
double transmitted(const Run &run, const Constraints &c, int64_t degree) {
    double sum = 0.0;
    for (int64_t i = 0; i < c.count; i++)
        sum -= c.rows[i * run.nv + degree] * dot(c.left + i * run.base_count, c.second, run.base_count);
    return sum;
}

// The torques of the tracking. With the wanted accelerations w of the joints, the load h, the motion P w of the base
// that constraints cause and a basis B of the motions that they leave, the forces are f = M (P w, w) + h. The base moves
// so that B^T f_b - B^T M_bb B u is 0, and the torques are those of g = f - M (B u, 0): g_q + P^T g_b. Returns false if
// Python has to compute them.
bool set_wanted(Run &run) {
    const pretouch_joint_feedback &f = run.feedback;
    const int64_t n = run.driven_count, b = run.base_count, nv = run.nv;
    const double *position = run.reference, *velocity = position + n, *acceleration = velocity + n;
    double *vector = run.scratch, *product = vector + nv, *column = product + nv, *matrix = column + nv,
           *y = matrix + b * b;
    const size_t size = static_cast<size_t>(nv) * sizeof(double);
    Constraints held = {};
    if (b && !read_constraints(run, held)) return false;
    memset(vector, 0, size);
    for (int64_t j = 0; j < n; j++)
        vector[run.driven[j]] = f.acceleration * acceleration[j] + f.velocity * velocity[j] -
                                f.damping * run.qvel[run.driven[j]] +
                                f.stiffness * (position[j] - run.qpos[run.places[j]]);
    if (held.count) follow(run, held, vector);
    run.engine->mul_m(run.model, run.data, product, vector);
    for (int64_t i = 0; i < nv; i++) product[i] += run.bias[i] - run.passive[i];
    int64_t loose = 0;  // number of columns of B
    for (int64_t k = 0; k < b; k++) {
        if (held.count && !is_loose(held, k)) continue;
        if (held.count)
            for (int64_t i = 0; i < b; i++) held.right[b * b + loose * b + i] = held.right[i * b + k];
        loose++;
    }
    if (loose) {
        const auto basis = [&](int64_t k) {  // writes column k of B as a velocity
            memset(vector, 0, size);
            if (!held.count) vector[run.base[k]] = 1.0;
            for (int64_t i = 0; held.count && i < b; i++) vector[run.base[i]] = held.right[b * b + k * b + i];
        };
        for (int64_t k = 0; k < loose; k++) {
            basis(k);
            y[k] = dot(vector, product, nv);
            run.engine->mul_m(run.model, run.data, column, vector);
            for (int64_t i = 0; i < loose; i++) {
                basis(i);
                matrix[i * loose + k] = dot(vector, column, nv);
            }
        }
        if (!factor(matrix, loose)) return false;
        solve_lower(matrix, y, loose);
        solve_upper(matrix, y, loose);
        memset(column, 0, size);
        for (int64_t k = 0; k < loose; k++) {
            basis(k);
            for (int64_t i = 0; i < nv; i++) column[i] += y[k] * vector[i];
        }
        run.engine->mul_m(run.model, run.data, vector, column);
        for (int64_t i = 0; i < nv; i++) product[i] -= vector[i];
    }
    if (held.count) set_multipliers(run, held, product);
    for (int64_t j = 0; j < n; j++) {
        const double more = held.count ? transmitted(run, held, run.driven[j]) : 0.0;
        run.wanted[j] = f.scale * (product[run.driven[j]] + more);
    }
    return true;
}

// Applies the wanted torques within the limits of the drives.
void apply(Run &run) {
    bool limited = false;
    for (int64_t j = 0; j < run.driven_count; j++) {
        const double low = run.highest[2 * j], high = run.highest[2 * j + 1], wanted = run.wanted[j];
        run.torques[j] = wanted < low ? low : wanted > high ? high : wanted;
        limited = limited || run.torques[j] != wanted;
        run.applied[run.driven[j]] = run.torques[j];
    }
    for (int64_t i = 0; i < run.site_count; i++)
        if (!touched(run.sites[i]) && limited) run.sites[i].saturated += run.time_step;
}

void record(Run &run) {
    if (!run.rows) return;
    const int64_t m = run.site_count, n = run.driven_count;
    double *row = run.rows + run.row_count++ * (1 + 3 * m + n + run.nq);
    *row++ = static_cast<double>(run.number) * run.period + static_cast<double>(run.sub_step) * run.time_step;
    for (int64_t i = 0; i < m; i++) {
        row[i] = run.sites[i].glance.distance;
        row[m + i] = run.sites[i].target[2];
        row[2 * m + i] = run.sites[i].force;
    }
    memcpy(row + 3 * m, run.torques, static_cast<size_t>(n) * sizeof(double));
    memcpy(row + 3 * m + n, run.qpos, static_cast<size_t>(run.nq) * sizeof(double));
}

// ---- contacts ----

// A contact point that transmits a force: its geoms (-1 for a flex), their bodies, point, unit vector from the first to
// the second body, and force on the second body.
struct Push {
    int geoms[2], bodies[2];
    double point[3], normal[3], force[3];
};

bool read_push(const Run &run, int number, Push &push) {
    double wrench[6];
    run.engine->contact_force(run.model, run.data, number, wrench);
    if (wrench[0] == 0.0 && wrench[1] == 0.0 && wrench[2] == 0.0) return false;
    const char *at = run.contacts + static_cast<int64_t>(number) * run.contact_size;
    int flexes[2];
    double frame[9];
    memcpy(push.geoms, at + run.contact_fields[0], sizeof push.geoms);
    memcpy(flexes, at + run.contact_fields[1], sizeof flexes);
    memcpy(push.point, at + run.contact_fields[2], sizeof push.point);
    memcpy(frame, at + run.contact_fields[3], sizeof frame);
    for (int i = 0; i < 2; i++)
        push.bodies[i] = push.geoms[i] >= 0 ? run.geom_body[push.geoms[i]] : flexes[i] >= 0 ? run.flex_body[flexes[i]] : 0;
    for (int k = 0; k < 3; k++) {
        push.normal[k] = frame[k];
        push.force[k] = frame[k] * wrench[0] + frame[3 + k] * wrench[1] + frame[6 + k] * wrench[2];
    }
    return true;
}

// Returns which of the two geoms of a contact is the surface of a site, -1 if neither is.
int surface_side(const Run &run, const Site &site, const Push &push) {
    for (int side = 0; side < 2; side++) {
        const int geom = push.geoms[side];
        if (geom < 0) continue;
        if (site.surface[geom] & SURFACE) return side;
        if (site.surface[geom] & RIGID) {
            double axis[3];
            axis_of(run, site, axis);
            const double *point = point_of(run, site);
            double ahead = 0.0;
            for (int k = 0; k < 3; k++) ahead += (push.point[k] - point[k]) * axis[k];
            if (fabs(ahead) <= AT_SURFACE) return side;
        }
    }
    return -1;
}

// Returns which of two bodies in contact is the robot's, -1 if the robot touches nothing else.
int robot_side(const Run &run, const int *bodies) {
    const bool own[2] = {run.own[bodies[0]] != 0, run.own[bodies[1]] != 0};
    if (own[0] != own[1]) return own[1];
    if (own[0])  // a part that moves hits one that stays where it is
        for (int side = 0; side < 2; side++)
            if (run.moving[bodies[side]] && run.still[bodies[1 - side]]) return side;
    return -1;
}

bool supports(const Run &run, const int *bodies) {
    const int low = bodies[0] < bodies[1] ? bodies[0] : bodies[1], high = bodies[0] + bodies[1] - low;
    const int64_t pair = low * run.bodies + high;
    for (int64_t i = 0; i < run.support_count; i++)
        if (run.support[i] == pair) return true;
    return false;
}

// The normal relative velocity at a contact point, negative if both bodies approach. velocity: of all joints before the
// contact.
double approach_speed(Run &run, const Push &push, const double *velocity) {
    double *jacobian = run.scratch + run.nv, speed = 0.0;  // the first part of the memory holds the velocities
    for (int side = 0; side < 2; side++) {
        run.engine->jac(run.model, run.data, jacobian, nullptr, push.point, push.bodies[side]);
        for (int k = 0; k < 3; k++)
            speed += (side == 1 ? 1.0 : -1.0) * push.normal[k] * dot(jacobian + k * run.nv, velocity, run.nv);
    }
    return speed;
}

pretouch_robot_touch *find_touch(Run &run, int body, int other, int site) {
    for (int64_t i = 0; i < run.touch_count; i++) {
        pretouch_robot_touch &touch = run.touches[i];
        if (touch.body == body && touch.other == other && touch.site == site) return &touch;
    }
    return nullptr;
}

// Adds a contact point to the forces of this step on the robot and on a pair of bodies.
void add_touch(Run &run, const Push &push, const double *velocity, double *robot) {
    const int side = robot_side(run, push.bodies);
    if (side < 0) return;
    int site = -1;
    for (int64_t i = 0; site < 0 && i < run.site_count; i++)
        if (surface_side(run, run.sites[i], push) == side) site = static_cast<int>(i);
    if (site < 0 && supports(run, push.bodies)) return;
    const double sign = side == 1 ? 1.0 : -1.0;
    for (int k = 0; k < 3; k++) robot[k] += sign * push.force[k];
    pretouch_robot_touch *touch = find_touch(run, push.bodies[side], push.bodies[1 - side], site);
    if (!touch) {
        if (run.touch_count == run.most_touches) return;
        touch = run.touches + run.touch_count++;
        *touch = {push.bodies[side], push.bodies[1 - side], site, 0, run.now - run.time_step,
                  approach_speed(run, push, velocity), 0.0, {0.0, 0.0, 0.0}};
    }
    if (!touch->current) memset(touch->total, 0, sizeof touch->total);
    touch->current = 1;
    for (int k = 0; k < 3; k++) touch->total[k] += sign * push.force[k];
}

// Records the force of this step on the robot.
void finish_touches(Run &run, const double *robot) {
    run.force = norm(robot);
    double strongest = -1.0;
    for (int64_t i = 0; i < run.touch_count; i++) {
        pretouch_robot_touch &touch = run.touches[i];
        if (!touch.current) continue;
        touch.current = 0;
        const double force = norm(touch.total);
        touch.peak = larger(touch.peak, force);
        if (run.force > 0.0 && force > strongest) {
            strongest = force;
            run.pair_body = touch.body;
            run.pair_other = touch.other;
        }
    }
    const double begun = run.now - run.time_step;
    if (run.force > 0.0) {
        for (int k = 0; k < 3; k++) run.pair_direction[k] = robot[k] / run.force;
        run.last = begun;
        if (isnan(run.first)) run.first = begun;
    }
    if (run.force > run.peak) {
        run.peak = run.force;
        run.summit = begun;
    }
}

// Returns the speed at which the centers of mass of robot and object approach along the last force.
double closing_speed(Run &run) {
    run.engine->subtree_vel(run.model, run.data);
    const double *own = run.subtree_velocity + 3 * run.body_root[run.pair_body];
    const double *other = run.subtree_velocity + 3 * run.body_root[run.pair_other];
    const bool moves = run.body_tree[run.pair_other] >= 0;
    double speed = 0.0;
    for (int k = 0; k < 3; k++) speed += ((moves ? other[k] : 0.0) - own[k]) * run.pair_direction[k];
    return speed;
}

// Returns whether the force on the robot has passed its largest value; see Touches in robots/touches.py.
bool has_passed_peak(Run &run) {
    if (isnan(run.first)) return true;
    if (!run.returns && run.force == 0.0 && run.now - run.last >= run.follow_time) return true;
    if (run.now - run.summit < larger(run.patience, run.summit - run.first)) return false;
    return !(run.floats && closing_speed(run) > run.resting);
}

bool is_over(Run &run) {
    for (int64_t i = 0; i < run.site_count; i++)
        if (!touched(run.sites[i])) return false;
    const double after = run.now - run.last_contact;
    if (after < run.follow_time) return false;
    return after >= larger(run.follow_time, run.longest) || has_passed_peak(run);
}

// ---- sensors and contacts of a site ----

void sense(Run &run, Site &site, double before) {
    Sensor &sensor = *static_cast<Sensor *>(site.sensor);
    while (sensor.instant <= run.now + INSTANT) {
        const double distance =
            see_beam(*site.sight, run.data, point_of(run, site), frame_of(run, site), &site.glance);
        const double ahead = (run.now - sensor.instant) / run.time_step;
        const double moved = site.glance.distance - before;
        const double shift = isfinite(distance) && isfinite(moved) ? -moved * ahead : 0.0;
        look(sensor, isfinite(distance) ? larger(distance + shift, 0.0) : run.unseen);
    }
}

// The force on the surface of a site along its axis in this step, and its strongest contact point.
struct SiteForce {
    double along, strongest;
    Push push;
};

void add_site_force(const Run &run, const Site &site, const Push &push, SiteForce &force) {
    const int side = surface_side(run, site, push);
    if (side < 0) return;
    double axis[3];
    axis_of(run, site, axis);
    force.along += (side == 0 ? 1.0 : -1.0) * dot(push.force, axis, 3);
    if (norm(push.force) > force.strongest) {
        force.strongest = norm(push.force);
        force.push = push;
    }
}

// Updates reading and force of a site after a step; returns whether its first contact was in this step.
bool watch(Run &run, Site &site, const double *velocity, int count) {
    const double before = site.glance.distance, h = run.time_step;
    see_axis(*site.sight, run.data, point_of(run, site), frame_of(run, site), site.glance);
    sense(run, site, before);
    if (!touched(site)) site.excursion = larger(site.excursion, fabs(site.target[2] - site.approach * run.now));
    SiteForce force = {0.0, -1.0, {}};
    Push push;
    for (int i = 0; i < count; i++)
        if (read_push(run, i, push)) add_site_force(run, site, push, force);
    site.force = force.along;
    site.peak = larger(site.peak, site.force);
    site.impulse += site.force * h;
    const bool meets = site.glance.distance <= 0.0 && before > 0.0;
    if (touched(site) || !(meets || site.force > 0.0)) return false;
    const bool on_axis = meets && before < INFINITY;
    const double part = on_axis ? before / (before - site.glance.distance) : 0.0;
    site.time = run.last_contact = run.now - (1.0 - part) * h;
    if (on_axis)
        site.speed = (site.glance.distance - before) / h;
    else if (force.strongest >= 0.0)  // no ray has met the object at the contact point
        site.speed = approach_speed(run, force.push, velocity);
    return true;
}

// Advances MuJoCo by one step, and updates all sites.
void advance(Run &run) {
    const pretouch_engine &engine = *run.engine;
    double *velocity = run.scratch;
    memcpy(velocity, run.qvel, static_cast<size_t>(run.nv) * sizeof(double));
    engine.step2(run.model, run.data);
    engine.kinematics(run.model, run.data);
    engine.com_pos(run.model, run.data);
    run.now = static_cast<double>(run.number) * run.period + static_cast<double>(run.sub_step + 1) * run.time_step;
    const int count = *run.contact_count;
    double robot[3] = {0.0, 0.0, 0.0};
    Push push;
    for (int i = 0; i < count; i++)
        if (read_push(run, i, push)) add_touch(run, push, velocity, robot);
    finish_touches(run, robot);
    run.touched = 0;
    for (int64_t i = 0; i < run.site_count; i++)
        if (watch(run, run.sites[i], velocity, count)) run.touched |= int64_t{1} << i;
}

// Returns whether the run goes on after a period.
bool end_period(Run &run) {
    run.now = static_cast<double>(run.number) * run.period + run.period;
    run.number++;
    run.sub_step = 0;
    if (is_over(run)) return false;
    for (int64_t i = 0; i < run.nq; i++)
        if (!isfinite(run.qpos[i])) return false;
    return run.number < run.periods;
}

int64_t continue_run(Run &run) {
    while (true) {
        int64_t what = 0;
        switch (run.phase) {
        case PERIOD:
            run.phase = STEP;
            if (ask_all(run)) return PRETOUCH_RUN_DETECTED;
            break;
        case STEP:
            if (run.rows && run.row_count == run.most_rows) return PRETOUCH_RUN_ROWS;
            run.engine->step1(run.model, run.data);
            set_motion(run);
            run.anchored = 0;
            run.phase = REFERENCE;
            [[fallthrough]];
        case REFERENCE:
            if (!set_reference(run, &what)) {
                run.anchored = 1;
                return PRETOUCH_RUN_ANCHOR;
            }
            for (int64_t i = 0; i < run.site_count; i++)
                if (!touched(run.sites[i]) && !run.sites[i].obstacle) run.sites[i].obstacle = what;
            delay_reference(run);
            run.phase = APPLY;
            if (run.ask_torques || !set_wanted(run)) return PRETOUCH_RUN_TORQUES;
            [[fallthrough]];
        case APPLY:
            apply(run);
            record(run);
            advance(run);
            run.phase = ++run.sub_step < run.steps || end_period(run) ? (run.sub_step ? STEP : PERIOD) : END;
            if (run.touched) return PRETOUCH_RUN_TOUCHED;
            break;
        default:
            run.passed = has_passed_peak(run);
            return PRETOUCH_RUN_ENDED;
        }
    }
}

// What MuJoCo's log handler needs to leave a run that MuJoCo stops.
struct Escape {
    jmp_buf place;
    char *message;
};
thread_local Escape *escape = nullptr;

constexpr int LOG_ERROR = 3;  // mjLOG_ERROR
struct LogMessage {           // the start of mjLogMessage
    int level, topic;
    char subject[1024];
};

// Leaves the run after an error. MuJoCo counts its warnings in the data, from which Python reads them.
void on_message(const void *message) {
    const LogMessage &log = *static_cast<const LogMessage *>(message);
    if (log.level != LOG_ERROR || !escape) return;
    const size_t most = sizeof(pretouch_robot_run::message) - 1;
    const void *const end = memchr(log.subject, 0, most);
    const size_t length = end ? static_cast<size_t>(static_cast<const char *>(end) - log.subject) : most;
    memcpy(escape->message, log.subject, length);
    escape->message[length] = 0;
    longjmp(escape->place, 1);
}

}  // namespace

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

int64_t pretouch_run_robot(pretouch_robot_run *run) {
    auto *const set_handler = run->engine->set_log_handler;
    if (!set_handler) return continue_run(*run);
    Escape own;
    own.message = run->message;
    Escape *const outer = escape;
    pretouch_log_handler *const former = set_handler(on_message);
    escape = &own;
    const int64_t result = setjmp(own.place) ? int64_t{PRETOUCH_RUN_FAILED} : continue_run(*run);
    escape = outer;
    set_handler(former);
    return result;
}

#endif
