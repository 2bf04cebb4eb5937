// Call the compiled core of pretouch, which is the same C++ that Python calls, built for WebAssembly.
//
// All numbers are in SI units. Signs are those of pretouch: x points away from the sensor, an approach has l' < 0, and a
// gain that mitigates is negative.

export const COLUMNS = [
    "time", "distance", "displacement", "displacement_velocity", "displacement_acceleration", "relative_velocity",
    "virtual_force", "largest_excursion", "largest_travel", "largest_speed", "largest_acceleration",
    "largest_virtual_force", "closest_distance", "settling_distance", "displacement_integral",
]; // of pretouch/motion/layout.py
export const STATUS = ["contact", "never", "horizon", "left-range", "unresolved"];
export const CONTACT = 0;
export const SEARCH = { uncertain: 0, optimal: 1, infeasible: 2 };
const UNRESOLVED = 4n;
const GROWTH = 64; // ratio of successive ranges of a curve, for objects that recede beyond the first
const LARGEST_START = 2 ** 43; // m, of pretouch/motion/curve.py

// Ratio of half width and distance from the singularity of an inverse power: its series to the power 9 on a piece then
// has a relative error of 0.03^10 = 6e-16.
const PIECE_RATIO = 0.03;

/** Load the compiled core from the bytes of its WebAssembly module. */
export async function loadCore(bytes) {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    instance.exports._initialize?.();
    return new Core(instance.exports);
}

/** Load the compiled core from its module, compressed by gzip and written in base64. */
export async function unpackCore(text) {
    const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return loadCore(await new Response(stream).arrayBuffer());
}

/** Return the sensor curve in the form that the compiled core reads, from a description of the sensor.
 *
 * A description has a model and its parameters: `distance_offset` and `exponent` of an inverse power, `rate` of an
 * exponential of first order, `rate` and `curvature` of one of second order; and the `recess` of the sensor. Any other
 * curve comes from Python, with its `pieces` and `windows`. */
export function sensorCurve(sensor) {
    const recess = sensor.recess ?? 0;
    if (sensor.model === "inverse-power") {
        const middle = -(sensor.distance_offset + recess), n = -sensor.exponent;
        return {
            low: 0, high: sensor.maximum_distance ?? Infinity, constant: null, falling: true,
            slope: (l) => n / (l - middle),
            windows: (top) => [[0, 0, top, 0, middle, n]],
            pieces: (top) => inversePowerPieces(middle, n, top),
        };
    }
    if (sensor.model === "exponential-1") {
        const rate = sensor.rate;
        return {
            low: 0, high: sensor.maximum_distance ?? Infinity, constant: rate, falling: rate < 0, slope: () => rate,
            windows: (top) => [[0, 0, top, 0, 0, 0, rate]],
            pieces: (top) => [[top / 2, top / 2, rate]],
        };
    }
    if (sensor.model === "exponential-2") {
        const b = sensor.curvature, rate = sensor.rate + 2 * b * recess;
        const turning = b > 0 ? -rate / (2 * b) : Infinity;
        const slope = (l) => rate + 2 * b * l;
        return {
            low: 0, high: Math.min(sensor.maximum_distance ?? Infinity, turning), falling: rate < 0 && b >= 0, slope,
            constant: b === 0 ? rate : null,
            windows: (top) => [[0, 0, top, 0, top / 2, 0, slope(top / 2), b, 0, 0]],
            pieces: (top) => [[top / 2, top / 2, slope(top / 2), b * top]],
        };
    }
    const { pieces, windows, low, high } = sensor;
    return {
        low, high: high ?? Infinity, constant: null, falling: sensor.falling, slope: (l) => slopeOfPieces(pieces, l),
        windows: () => windows, pieces: () => pieces, top: sensor.top, open: sensor.open,
    };
}

function inversePowerPieces(middle, n, top) {
    const rows = [], growth = (1 + PIECE_RATIO) / (1 - PIECE_RATIO);
    for (let low = 0; low < top; ) {
        const high = Math.min(top, middle + (low - middle) * growth), at = (low + high) / 2, half = (high - low) / 2;
        const ratio = -half / (at - middle), row = [at, half];
        for (let j = 0, term = n / (at - middle); j < 10; j++, term *= ratio) row.push(term);
        rows.push(row);
        low = high;
    }
    return rows;
}

function slopeOfPieces(pieces, l) {
    const [middle, half, ...terms] = pieces.find(([at, width]) => l <= at + width) ?? pieces[pieces.length - 1];
    return terms.reduceRight((sum, term) => sum * ((l - middle) / half) + term, 0);
}

/** Return an upper limit of a distance, rounded up to a power of two, as `reach_to` in pretouch/motion/curve.py. */
const reachTo = (distance) => 2 ** (Math.floor(Math.log2(distance)) + 1);

/** Return the coordinate asinh(gain / scale) in which gains are searched and drawn, as GainAxis of pretouch.designs. */
export function gainAxis([low, high]) {
    const small = Math.min(Math.abs(low), Math.abs(high)), large = Math.max(Math.abs(low), Math.abs(high));
    const scale = low * high > 0 ? small : 1e-3 * large;
    return { scale, low, high, coordinate: (gain) => Math.asinh(gain / scale), gain: (u) => scale * Math.sinh(u) };
}

class Core {
    constructor(exports) {
        this.exports = exports;
        this.base = exports.__heap_base.value;
        this.next = this.base;
    }

    /** Solve an encounter with several gains, or one encounter for each gain.
     *
     * Returns one object for each gain with its status and the columns of pretouch. */
    solve(encounter, curve, gains, horizon) {
        return this.#with(() => {
            const rows = this.#room(15 * gains.length), status = this.#room(gains.length);
            this.#solve(encounter, curve, gains, horizon, rows, status);
            const values = this.#read(rows, 15 * gains.length);
            const ends = Array.from(new BigInt64Array(this.exports.memory.buffer, status, gains.length), Number);
            return ends.map((end, i) => ({
                status: end, gain: gains[i], ...Object.fromEntries(COLUMNS.map((name, j) => [name, values[15 * i + j]])),
            }));
        });
    }

    /** Return the motion of one encounter at ascending times up to its end: distance, position, velocity, force. */
    trace(encounter, curve, gain, horizon, times) {
        return this.#with(() => {
            const m = times.length, at = this.#put(times), trace = this.#put(new Float64Array(4 * m).fill(NaN));
            let end = null;
            if (curve.constant === null) {
                const rows = this.#room(15), status = this.#room(1);
                this.#solve(encounter, curve, [gain], horizon, rows, status, at, m, trace);
                end = this.#read(rows + 8, 4); // a time within rounding of the end is not filled
            } else {
                const e = encounter, c = curve.constant * gain;
                const row = this.#put([e[0], e[1] + c, e[2], e[3], e[4], c * e[6], c * e[7]]);
                this.exports.pretouch_respond(row, 1n, at, BigInt(m), trace + 8, 4n * BigInt(m), 4n, 3n);
            }
            const values = this.#read(trace, 4 * m), [, , , , , p, v, a] = encounter;
            const motion = { time: Array.from(times), distance: [], displacement: [], velocity: [], acceleration: [] };
            motion.relative_velocity = [];
            motion.virtual_force = [];
            for (let i = 0; i < m; i++) {
                const t = times[i];
                let [l, y, u, w] = values.slice(4 * i, 4 * i + 4);
                if (end === null) l = p + (v + (a * t) / 2) * t - y;
                else if (Number.isNaN(l)) [l, y, u, w] = end;
                motion.distance.push(l);
                motion.displacement.push(y);
                motion.velocity.push(u);
                motion.acceleration.push(w);
                motion.relative_velocity.push(v + a * t - u);
                motion.virtual_force.push(gain * curve.slope(Math.max(l, 0)) * (v + a * t - u));
            }
            return motion;
        });
    }

    /** Find the optimal gain: { status, gain, objective }, with status one of SEARCH.
     *
     * terms: rows [quantity, factor, exponent, follows]; limits: rows [quantity, factor, exponent]; both as
     * `pretouch_find_gains` of native/core/pretouch.h. */
    design(encounter, curve, { terms, limits, bounds, horizon }) {
        return this.#with(() => {
            const reach = Math.min(reachTo(encounter[5] - encounter[3]), curve.high);
            const axis = gainAxis(bounds), out = this.#room(3), linear = curve.constant !== null;
            const shared = linear ? 0 : this.#curves(curve.windows(reach)), top = this.#top(curve, reach);
            const pieces = linear || reach > LARGEST_START ? 0 : this.#pieces(curve, top);
            this.exports.pretouch_find_gains(
                this.#put(encounter), 1n, curve.slope(0), shared, pieces, curve.low, curve.high, curve.falling ? 1 : 0,
                horizon, this.#put(terms.flat()), BigInt(terms.length), this.#put(limits.flat()),
                BigInt(limits.length), axis.scale, axis.coordinate(axis.low), axis.coordinate(axis.high), axis.low,
                axis.high, out,
            );
            const [gain, objective, status] = this.#read(out, 3);
            return { status, gain, objective };
        });
    }

    /** Solve approaches of a uniformly moving object under drags phi [N s^2]; the admittance does not act.
     *
     * Returns one object for each drag: status, time, distance, relative_velocity, growth (2 phi / M times the integral
     * of g^2), excursion, largest_acceleration, largest_virtual_force and largest_speed. */
    drag(encounter, curve, drags, horizon, times = null) {
        return this.#with(() => {
            const [mass, , , x0, u0, p, v, a] = encounter, n = drags.length, l = p - x0, speed = v - u0;
            const columns = [drags.map((phi) => phi / mass), a, l, speed * speed, 0, l, v, a];
            const inputs = this.#room(2 * columns.length);
            columns.forEach((column, i) => {
                this.#word(inputs + 16 * i, this.#put([column].flat()));
                this.#long(inputs + 16 * i + 8, Array.isArray(column) ? 1 : 0);
            });
            const reach = Math.min(reachTo(l), curve.high), curves = this.#curves(curve.windows(reach));
            const rows = this.#room(6 * n), status = this.#room(n), cells = this.#room(n), peaks = this.#room(7 * n);
            const wanted = this.#room(8), m = times?.length ?? 0, trace = m && this.#put(new Float64Array(2 * m * n).fill(NaN));
            [rows, status, cells, peaks].forEach((at, i) => this.#word(wanted + 4 * i, at));
            for (let i = 4; i < 11; i++) this.#word(wanted + 4 * i, 0);
            if (m) this.#word(wanted + 40, this.#put(drags.flatMap(() => times)));
            this.#long(wanted + 48, m);
            this.#word(wanted + 56, trace);
            this.exports.pretouch_drag_approaches(inputs, BigInt(n), curves, horizon, wanted);
            const ends = new BigInt64Array(this.exports.memory.buffer, status, n), row = this.#read(rows, 6 * n);
            const peak = this.#read(peaks, 7 * n), path = m ? this.#read(trace, 2 * m * n) : null;
            return drags.map((phi, i) => {
                const [time, distance, square, , growth] = row.slice(6 * i, 6 * i + 6);
                const [largest, , smallest, fastest, slowest] = peak.slice(7 * i, 7 * i + 7);
                return {
                    status: Number(ends[i]), gain: phi, time, distance, growth, relative_velocity: -Math.sqrt(square),
                    largest_excursion: Math.abs(p + (v + (a * time) / 2) * time - distance),
                    largest_acceleration: Math.max(Math.abs(largest), Math.abs(smallest)),
                    largest_virtual_force: mass * Math.abs(largest),
                    largest_speed: Math.max(Math.abs(fastest), Math.abs(slowest)),
                    path: path && path.slice(2 * m * i, 2 * m * (i + 1)),
                };
            });
        });
    }

    /** Return the motion under a drag at ascending times, in the form of `trace`. */
    traceDrag(encounter, curve, phi, horizon, times) {
        const [mass, , , x0, u0, p, v, a] = encounter, [end] = this.drag(encounter, curve, [phi], horizon, times);
        const motion = { time: Array.from(times), distance: [], displacement: [], velocity: [], acceleration: [] };
        Object.assign(motion, { relative_velocity: [], virtual_force: [] });
        times.forEach((t, i) => {
            let l = end.path[2 * i], speed = -end.path[2 * i + 1];
            if (Number.isNaN(l)) [l, speed] = 2 * t < end.time ? [p - x0, v - u0] : [end.distance, end.relative_velocity];
            const force = -phi * (curve.slope(Math.max(l, 0)) * speed) ** 2;
            motion.distance.push(l);
            motion.relative_velocity.push(speed);
            motion.displacement.push(p + (v + (a * t) / 2) * t - l);
            motion.velocity.push(v + a * t - speed);
            motion.acceleration.push(force / mass);
            motion.virtual_force.push(force);
        });
        return motion;
    }

    /** Return the drag phi [N s^2] with which the contact speed is a share of the approach speed: M ln(1/rho) / G. */
    dragOfRatio(encounter, curve, ratio) {
        // 2 k G of an approach with a small k = phi / M gives the integral G of g^2, as slope_integral of pretouch.
        const [mass] = encounter, l = encounter[5] - encounter[3];
        let steepest = 0;
        for (let i = 0; i <= 256; i++) steepest = Math.max(steepest, Math.abs(curve.slope((l * i) / 256)));
        const k = 1 / (steepest ** 2 * l), unit = [1, 0, 0, 0, 0, l, -1, 0, 0, 0];
        const [{ growth }] = this.drag(unit, curve, [k], Infinity);
        return (mass * Math.log(1 / ratio) * 2 * k) / growth;
    }

    #solve(encounter, curve, gains, horizon, rows, status, times = 0, m = 0, trace = 0) {
        const n = BigInt(gains.length), many = Array.isArray(encounter[0]);
        const values = this.#put(many ? encounter.flat() : gains.flatMap(() => encounter)), at = this.#put(gains);
        if (curve.constant !== null) {
            const { pretouch_solve_linear: solve } = this.exports;
            solve(values, n, curve.constant, at, horizon, curve.low, curve.high, rows, status);
            return;
        }
        const farthest = Math.max(...(many ? encounter : [encounter]).map((e) => e[5] - e[3]));
        for (let top = this.#top(curve, farthest); ; top *= GROWTH) {
            const pieces = this.#pieces(curve, top);
            this.exports.pretouch_solve_series(
                values, n, at, pieces, horizon, rows, status, times, BigInt(m), trace, 0, 0n,
            );
            if (curve.top || top >= curve.high || top > LARGEST_START) return;
            const ends = new BigInt64Array(this.exports.memory.buffer, status, gains.length);
            const row = new Float64Array(this.exports.memory.buffer, rows, 15 * gains.length);
            if (!ends.some((end, i) => end === UNRESOLVED && row[15 * i + 1] >= top)) return;
        }
    }

    /** Return the end of the pieces: four times the largest distance, rounded up to a power of two. */
    #top(curve, distance) {
        return curve.top ?? 2 ** Math.ceil(Math.log2(4 * distance));
    }

    #pieces(curve, top) {
        const rows = curve.pieces(Math.min(top, curve.high)), at = this.#room(5);
        this.#word(at, this.#put(rows.flat()));
        const open = curve.open ?? top < curve.high;
        [rows.length, rows[0].length, curve.low <= 0, open].forEach((x, i) => this.#long(at + 8 + 8 * i, Number(x)));
        return at;
    }

    #curves(windows) {
        const at = this.#room(5), starts = this.#room(2), which = this.#room(1);
        this.#word(at, this.#put(windows.flat()));
        this.#long(at + 8, windows.length);
        this.#long(at + 16, windows[0].length);
        this.#long(starts, 0);
        this.#long(starts + 8, windows.length);
        this.#long(which, 0);
        this.#word(at + 24, starts);
        this.#word(at + 28, which);
        this.#long(at + 32, 0);
        return at;
    }

    // Arrays lie one after the other from __heap_base on, and are given up together when a call has ended.
    #with(call) {
        const mark = this.next;
        try {
            return call();
        } finally {
            this.next = mark;
        }
    }

    #room(numbers) {
        const at = (this.next + 15) & ~15;
        this.next = at + 8 * numbers;
        const missing = this.next - this.exports.memory.buffer.byteLength;
        if (missing > 0) this.exports.memory.grow(Math.ceil(missing / 65536));
        return at;
    }

    #put(numbers) {
        const at = this.#room(numbers.length);
        new Float64Array(this.exports.memory.buffer, at, numbers.length).set(numbers);
        return at;
    }

    #read(at, count) {
        return Array.from(new Float64Array(this.exports.memory.buffer, at, count));
    }

    #word(at, value) {
        new DataView(this.exports.memory.buffer).setUint32(at, value, true);
    }

    #long(at, value) {
        new DataView(this.exports.memory.buffer).setBigInt64(at, BigInt(value), true);
    }
}
