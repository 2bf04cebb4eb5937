// What a proximity sensor sees in a MuJoCo model, by rays; see robots/sight.py. The module of the page has no MuJoCo.

#ifndef __wasm__

#include "robot.hpp"

namespace pretouch {

namespace {

constexpr double PAST = 1e-9;    // m: a ray that passes a body of the robot continues as far beyond its surface
constexpr double CLOSE = 1e-13;  // of ln xi: Newton's method for the equivalent distance ends there
constexpr int STEPS = 50;

struct Vector {
    double x, y, z;
};

Vector turned(const double *frame, const double *v) {
    return {frame[0] * v[0] + frame[1] * v[1] + frame[2] * v[2], frame[3] * v[0] + frame[4] * v[1] + frame[5] * v[2],
            frame[6] * v[0] + frame[7] * v[1] + frame[8] * v[2]};
}

// Returns the distance along a ray to the first object beyond the length `passed`, negative if there is none. Other
// bodies of the robot are passed unless they are in front of the contact surface.
double cast(const pretouch_sight &sight, void *data, const double *start, const double *ray, double cosine,
            double passed, int *geom, double *normal) {
    while (true) {
        const double beyond[3] = {start[0] + passed * ray[0], start[1] + passed * ray[1], start[2] + passed * ray[2]};
        const double distance =
            sight.engine->ray(sight.model, data, beyond, ray, nullptr, 1, sight.body, geom, normal);
        if (distance < 0.0) return distance;
        if ((passed + distance) * cosine > sight.behind + sight.flush || *geom < 0 || !sight.own[*geom])
            return passed + distance;
        passed += distance + PAST;
    }
}

// Returns the distance at which the curve of a sensor has this ln xi; infinite beyond the farthest one.
double invert(const pretouch_sight &sight, double target, double distance) {
    for (int i = 0; i < STEPS; i++) {
        const double error = target - log_output(*sight.curve, distance);
        if (fabs(error) <= CLOSE * (1.0 + fabs(target))) break;
        distance = larger(distance + error / log_slope(*sight.curve, distance), sight.lowest);
        if (!(distance <= sight.farthest)) return INFINITY;
    }
    return distance;
}

}  // namespace

void see_axis(const pretouch_sight &sight, void *data, const double *point, const double *frame,
              pretouch_glance &glance) {
    const Vector u = turned(frame, sight.rays);
    const double ray[3] = {u.x, u.y, u.z};
    const double start[3] = {point[0] - sight.behind * u.x, point[1] - sight.behind * u.y,
                             point[2] - sight.behind * u.z};
    int geom = -1;
    const double depth = cast(sight, data, start, ray, 1.0, 0.0, &geom, glance.normal);
    if (depth < 0.0) {
        glance = {INFINITY, {0.0, 0.0, 0.0}, -1};
    } else {
        glance.distance = depth - sight.behind;
        glance.geom = geom;
    }
}

double see_beam(const pretouch_sight &sight, void *data, const double *point, const double *frame,
                const pretouch_glance *axis) {
    const int count = sight.count;
    double *const rays = sight.scratch, *const normals = rays + 3 * count, *const distances = normals + 3 * count;
    pretouch_glance own;
    if (count == 1) {  // the axis is the only ray
        if (!axis) {
            see_axis(sight, data, point, frame, own);
            axis = &own;
        }
        const Vector u = turned(frame, sight.rays);
        rays[0] = u.x, rays[1] = u.y, rays[2] = u.z;
        for (int k = 0; k < 3; k++) normals[k] = axis->normal[k];
        distances[0] = axis->geom < 0 ? -1.0 : axis->distance + sight.behind;
    } else {
        for (int i = 0; i < count; i++) {
            const Vector u = turned(frame, sight.rays + 3 * i);
            rays[3 * i] = u.x, rays[3 * i + 1] = u.y, rays[3 * i + 2] = u.z;
        }
        const double start[3] = {point[0] - sight.behind * rays[0], point[1] - sight.behind * rays[1],
                                 point[2] - sight.behind * rays[2]};
        sight.engine->multi_ray(sight.model, data, start, rays, nullptr, 1, sight.body, sight.geoms, distances,
                                normals, count, INFINITY);
        for (int i = 0; i < count; i++) {
            const bool surface = distances[i] >= 0.0 && distances[i] * sight.cosines[i] <= sight.behind + sight.flush;
            if (surface && sight.geoms[i] >= 0 && sight.own[sight.geoms[i]])
                distances[i] = cast(sight, data, start, rays + 3 * i, sight.cosines[i], distances[i] + PAST,
                                    sight.geoms + i, normals + 3 * i);
        }
    }
    // ln xi of each ray that meets something. A tilted surface may be nearer than the contact surface next to the axis;
    // there, the curve continues straight.
    double level = -INFINITY, nearest = INFINITY, total = 0.0;
    for (int i = 0; i < count; i++) {
        total += sight.cosines[i];
        const double distance = distances[i] * sight.cosines[i] - sight.behind;
        if (!(distances[i] >= 0.0 && distance <= sight.farthest)) {
            distances[i] = NAN;
            continue;
        }
        const double inside = larger(distance, sight.lowest);
        distances[i] = log_output(*sight.curve, inside) + sight.first_slope * (distance - inside);
        level = larger(level, distances[i]);
        nearest = smaller(nearest, distance);
    }
    if (nearest == INFINITY) return INFINITY;
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        if (isnan(distances[i])) continue;
        const double *ray = rays + 3 * i, *normal = normals + 3 * i;
        const double facing = fabs(normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2]);
        sum += exp(distances[i] - level) * facing;
    }
    return invert(sight, level + log(sum / total), larger(nearest, sight.lowest));
}

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

void pretouch_sight_glance(const pretouch_sight *sight, void *data, const double *point, const double *frame,
                           pretouch_glance *glance) {
    see_axis(*sight, data, point, frame, *glance);
}

double pretouch_sight_distance(const pretouch_sight *sight, void *data, const double *point, const double *frame) {
    return see_beam(*sight, data, point, frame, nullptr);
}

#endif
