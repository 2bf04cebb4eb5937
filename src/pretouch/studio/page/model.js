// Read the fields of a scenario, which are texts with units as in a scenario file, and build the problem from them.

import { gainAxis, sensorCurve } from "./core.js";

let table = null; // the units of pretouch, from _core/units.py, and the rules of the scenario file, from config/schema.py

/** Set units and rules: { units: { m: [1, [1, 0, 0, 0, 0]], ... }, prefixes: { m: 1e-3, ... }, rules: { "admittance.mass": ... } }. */
export function setUnits(units) {
    table = units;
}

/** Return factor to SI and exponents of the base units of a unit such as N*s/m or mm. */
export function parseUnit(text) {
    const plain = text.replace(/[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+/g, (m) => "^" + [...m].map((c) => "-0123456789"["⁻⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c)]).join(""));
    let factor = 1, exponents = [0, 0, 0, 0, 0], sign = 1;
    for (const [, operator, name, power] of plain.trim().matchAll(/\s*([*·/ ]?)\s*([^\s*·/^]+)(?:(?:\^|\*\*)(-?\d+))?/g)) {
        const [size, dimension] = unitOf(name, text), n = (operator === "/" ? -1 : 1) * sign * Number(power ?? 1);
        factor *= size ** n;
        exponents = exponents.map((x, i) => x + n * dimension[i]);
    }
    return [factor, exponents];
}

function unitOf(name, text) {
    if (table.units[name]) return table.units[name];
    for (const [prefix, size] of Object.entries(table.prefixes)) {
        const base = name.startsWith(prefix) && table.prefixable[name.slice(prefix.length)];
        if (base) return [size * base[0], base[1]];
    }
    throw new Error(`${text} is not a unit`);
}

/** Return the SI value of a text such as "42.2 mm"; throw an error with a sentence if it is none. */
export function parseQuantity(text, unit) {
    const comma = /^\s*([-+]?)(\d*),(\d+)(?![\d,.])([^]*)$/.exec(String(text));
    if (comma) {
        const [, sign, whole, decimals, rest] = comma;
        if (decimals.length === 3 && whole.length <= 3 && Number(whole) > 0)
            throw new Error(`found ${JSON.stringify(text)}, which may be ${sign}${whole}${decimals} or ${sign}${whole}.${decimals}; write one of these numbers, with a decimal point`);
        text = `${sign}${whole}.${decimals}${rest}`;
    }
    const match = /^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf)\s*(.*?)\s*$/.exec(String(text));
    if (!match) throw new Error(`found ${JSON.stringify(text)}, expected a number with unit, such as "1 ${unit}"`);
    const number = match[1].endsWith("inf") ? (match[1][0] === "-" ? -Infinity : Infinity) : Number(match[1]), [, dimension] = parseUnit(unit);
    if (match[2] === "") return number;
    const [factor, found] = parseUnit(match[2]);
    if (found.some((x, i) => x !== dimension[i])) throw new Error(`found the unit ${match[2]}, expected ${unit || "none"}`);
    return factor < 1 && Number.isInteger(1 / factor) ? number / (1 / factor) : number * factor;
}

/** Write an SI value in the unit that a text has, such as 0.05 as "50 mm" after the text "42.2 mm". */
export function writeLike(text, value, unit) {
    const written = /^\s*(?:[-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*$/.exec(String(text))?.[1] ?? unit;
    const factor = written === "" ? 1 : parseUnit(written)[0];
    return `${Number((value / factor).toPrecision(4))} ${written}`.trim();
}

/** Format an SI value with four digits, as format_quantity of pretouch: lengths below 1 m in mm, times in ms. */
export function formatQuantity(value, unit, digits = 4) {
    if (value === null || !Number.isFinite(value)) return "none";
    const small = { m: "mm", s: "ms" }[unit];
    const [shown, symbol] = small && Math.abs(value) < 1 ? [value * 1e3, small] : [value, unit];
    const text = Number(shown.toPrecision(digits)).toString().replace("-", "−");
    return `${text} ${symbol.replaceAll("*", " ").replace("^2", "²").replace("^3", "³")}`.trim();
}

const MODELS = ["inverse-power", "exponential-1", "exponential-2"];
const of = (...models) => (f) => !f["sensor.calibration"] && models.includes(f["sensor.model"]);
const byFrequency = (f) => "admittance.natural_frequency" in f;

/** The fields that the page shows: key of the scenario file, words, SI unit, sign, and when it is shown. */
export const FIELDS = [
    ["sensor.distance_offset", "Distance of the virtual source l₀", "m", "any", of("inverse-power")],
    ["sensor.exponent", "Exponent n", "", "positive", of("inverse-power")],
    ["sensor.rate", "Rate c of ln ξ", "1/m", "negative", of("exponential-1", "exponential-2")],
    ["sensor.curvature", "Curvature b of ln ξ", "1/m^2", "any", of("exponential-2")],
    ["sensor.recess", "Recess of the sensor", "m", "nonnegative", (f) => "sensor.recess" in f || MODELS.includes(f["sensor.model"])],
    ["sensor.maximum_distance", "End of the curve", "m", "positive", (f) => "sensor.maximum_distance" in f],
    ["admittance.mass", "Virtual mass M", "kg", "positive"],
    ["admittance.damping", "Damping D", "N*s/m", "nonnegative", (f) => !byFrequency(f)],
    ["admittance.stiffness", "Stiffness K", "N/m", "nonnegative", (f) => !byFrequency(f)],
    ["admittance.natural_frequency", "Natural frequency", "rad/s", "nonnegative", byFrequency],
    ["admittance.damping_ratio", "Damping ratio", "", "nonnegative", byFrequency],
    ["obstacle.position", "Distance at detection", "m", "positive"],
    ["obstacle.velocity", "Velocity of the object", "m/s", "any"],
    ["obstacle.acceleration", "Acceleration of the object", "m/s^2", "any"],
    ["plant.position", "Position of the robot", "m", "any", (f) => "plant.position" in f],
    ["plant.velocity", "Velocity of the robot", "m/s", "any", (f) => "plant.velocity" in f],
    ["reference.position", "Position of the reference", "m", "any", (f) => "reference.position" in f],
    ["reference.velocity", "Velocity of the reference", "m/s", "any", (f) => "reference.velocity" in f],
    ["objective.position_scale", "Typical excursion", "m", "nonzero", (f) => f["objective.kind"] === "excursion"],
    ["objective.time_scale", "Typical time", "s", "nonzero", (f) => f["objective.kind"] === "time"],
    ["objective.velocity_scale", "Typical contact speed", "m/s", "nonzero", (f) => ["excursion", "time"].includes(f["objective.kind"])],
    ["law.ratio", "Contact speed over approach speed", "", "share", (f) => f["law.kind"] === "virtual-drag"],
    ["constraints.excursion", "Largest excursion", "m", "limit"],
    ["constraints.relative_velocity", "Largest contact speed", "m/s", "limit"],
    ["constraints.acceleration", "Largest acceleration", "m/s^2", "limit"],
    ["constraints.virtual_force", "Largest virtual force", "N", "limit"],
].map(([key, label, unit, sign, shown]) => ({ key, label, unit, sign, shown: shown ?? (() => true) }));

const DEFAULTS = {
    "sensor.recess": 0, "obstacle.acceleration": 0, "obstacle.velocity": 0, "admittance.damping_ratio": 1,
    "plant.position": 0, "plant.velocity": 0, "reference.position": 0, "reference.velocity": 0, "sensor.curvature": 0,
};
const OPTIONAL = (field) => field.sign === "limit" || field.key in DEFAULTS;

/** Names of limits in a scenario file: the column of a contact and the row of the compiled search. */
export const LIMITS = {
    excursion: ["largest_excursion", 6, "m"],
    relative_velocity: ["relative_velocity", 4, "m/s"],
    acceleration: ["largest_acceleration", 9, "m/s^2"],
    virtual_force: ["largest_virtual_force", 10, "N"],
};

const HOLDS = { any: () => true, positive: (x) => x > 0, nonnegative: (x) => x >= 0, negative: (x) => x < 0, nonzero: (x) => x !== 0 };
const BARE = /^\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*$/;

/** Describe the values that a key accepts, as the command does. */
function expectedValue(key, adjective = "any") {
    return `expected ${table.rules[key].expected.replace("{}", adjective === "any" ? "" : `${adjective} `)}`;
}

/** Read a value by the rule of its key in the scenario file; throw an error with the sentence of the command. */
export function readByRule(text, { key, unit }) {
    const { sign = "any", infinite = false, words = [], largest_bare: largestBare = Infinity } = table.rules[key];
    if (words.includes(text)) return text;
    const bare = BARE.test(text), refuse = (sentence) => {
        throw new Error(`found ${bare ? String(text).trim() : JSON.stringify(text)}, ${sentence}`);
    };
    let value;
    try {
        value = parseQuantity(text, unit);
    } catch {
        refuse(expectedValue(key) + (/\d,\d/.test(text) ? " (with a decimal point, and no separator of thousands)" : ""));
    }
    if (bare && Math.abs(value) > largestBare) {
        refuse(`expected a quantity with its unit. Without a unit, the number means ${value} ${unit}, which is implausibly large. Did you mean "${value} m${unit}"? Otherwise write "${value} ${unit}"`);
    }
    if (!HOLDS[sign](value)) refuse(expectedValue(key, sign));
    if (!Number.isFinite(value) && !infinite) refuse(expectedValue(key, "finite"));
    const [smallest, largest] = table.largest.magnitudes;
    if (Number.isFinite(value) && value !== 0 && !(Math.abs(value) >= smallest && Math.abs(value) <= largest)) refuse(`${expectedValue(key)} ${table.largest.workable}`);
    return value;
}

/** Read all fields: { values in SI by key, mistakes by key }. */
export function readFields(fields) {
    const values = {}, mistakes = {};
    for (const field of FIELDS) {
        if (!field.shown(fields)) continue;
        const text = fields[field.key];
        if (text === undefined || text === "") {
            if (field.key in DEFAULTS) values[field.key] = DEFAULTS[field.key];
            else if (!OPTIONAL(field)) mistakes[field.key] = `missing, ${expectedValue(field.key, table.rules[field.key].sign)}`;
            continue;
        }
        try {
            values[field.key] = readByRule(text, field);
        } catch (error) {
            mistakes[field.key] = error.message;
        }
    }
    return { values, mistakes };
}

const get = (values, key) => values[key] ?? DEFAULTS[key];

/** Format a number as Python's format :g with a number of digits. */
function short(value, digits = 6) {
    const text = Number(value.toPrecision(digits)), size = Math.abs(text);
    if (size !== 0 && (size < 1e-4 || size >= 10 ** digits)) return text.toExponential().replace(/e([-+])(\d)$/, "e$10$2");
    return String(text);
}

/** Build the problem from fields: encounter, curve, objective, limits and bounds.
 *
 * `fixed` is what Python has read of the file and the page can not compute: a described `sensor`, or the `terms` of an
 * objective. With mistakes, the result has only them. */
export function problemOf(fields, fixed = {}) {
    const { values, mistakes } = readFields(fields), law = fields["law.kind"] === "virtual-drag" ? "drag" : "damper";
    let bounds = null;
    try {
        bounds = (law === "drag" ? ["-10 N*s", "-0.01 N*s"] : fields["gain.bounds"]).map((x) => parseQuantity(x, "N*s"));
        if (!(bounds[0] < bounds[1])) throw new Error(`found bounds from ${bounds[0]} N*s to ${bounds[1]} N*s, expected the lower bound first`);
        if (!(bounds[0] < 0)) throw new Error(`no gain from ${bounds[0]} to ${bounds[1]} N s mitigates the impact. The sign of a mitigating gain is negative. Did you mean ${-bounds[1]} to ${-bounds[0]} N s?`);
    } catch (error) {
        mistakes["gain.bounds"] = error.message;
    }
    const at = (key) => get(values, key), distance = values["obstacle.position"] - at("plant.position");
    const hasBodies = !Object.keys(mistakes).some((key) => /^(admittance|obstacle|plant|reference)\./.test(key));
    if (hasBodies && !(distance > 0)) mistakes["obstacle.position"] ??= `the distance between obstacle and robot is ${short(distance)} m, but must be positive at the start of an encounter`;
    if (fixed.sensor?.unusable) mistakes["sensor.model"] = fixed.sensor.unusable;
    const own = !fixed.sensor, end = values["sensor.maximum_distance"];
    if (own && values["sensor.distance_offset"] <= 0) {
        mistakes["sensor.distance_offset"] ??= `found ${short(values["sensor.distance_offset"])} m, expected more than 0 m, the negative of minimum_distance. Otherwise, the output is infinite inside the valid range`;
    }
    if (own && end <= 0) mistakes["sensor.maximum_distance"] ??= `found ${short(end)} m, expected more than the minimum_distance of 0 m`;
    if (law === "drag" && values["law.ratio"] > 1) {
        mistakes["law.ratio"] ??= `found ${short(values["law.ratio"])}, expected a positive number up to 1. The ratio is contact speed / approach speed, and a virtual drag reduces the speed`;
    }
    if (values["objective.velocity_scale"] === "obstacle speed" && at("obstacle.velocity") === 0) {
        mistakes["objective.velocity_scale"] ??= 'found "obstacle speed" for an obstacle at rest, expected a quantity in m/s';
    }
    if (Object.keys(mistakes).length) return { mistakes };
    const mass = values["admittance.mass"], omega = values["admittance.natural_frequency"];
    const damping = omega === undefined ? values["admittance.damping"] : 2 * at("admittance.damping_ratio") * omega * mass;
    const stiffness = omega === undefined ? values["admittance.stiffness"] : omega ** 2 * mass;
    const frequency = Math.sqrt(stiffness / mass);
    if (frequency > table.largest.fastest) {
        return { mistakes: { [omega === undefined ? "admittance.stiffness" : "admittance.natural_frequency"]: `the natural frequency of ${short(frequency, 4)} rad/s is too high, because no control loop is faster than ${table.largest.fastest.toLocaleString("en-US")} rad/s. Check mass and stiffness with their units` } };
    }
    const encounter = [
        mass, damping, stiffness, at("plant.position") - at("reference.position"),
        at("plant.velocity") - at("reference.velocity"), values["obstacle.position"] - at("reference.position"),
        at("obstacle.velocity") - at("reference.velocity"), at("obstacle.acceleration"), at("reference.velocity"), 0,
    ];
    const described = fixed.sensor ?? {
        model: fields["sensor.model"], recess: at("sensor.recess"), rate: values["sensor.rate"],
        distance_offset: values["sensor.distance_offset"], exponent: values["sensor.exponent"],
        curvature: at("sensor.curvature"), maximum_distance: values["sensor.maximum_distance"],
    };
    const curve = sensorCurve(described), slope = Math.abs(curve.slope(0));
    if (own && slope > table.largest.steepest) {
        return { mistakes: { sensor: `the sensor curve is too steep at the distance 0 m. There, the output falls by a factor of e (2.718) within a length of ${short(1 / slope, 3)} m, expected at least 1e-06 m. Check the parameters of the curve and their units` } };
    }
    if (distance > curve.high) {
        return { mistakes: { "obstacle.position": `the encounter starts at a distance of ${short(1e3 * distance, 4)} mm, but the sensor curve ends at a distance of ${short(1e3 * curve.high, 4)} mm, the end of the sensor's valid range. Start the encounter at a smaller distance.` } };
    }
    if (law === "drag" && (encounter[3] !== 0 || encounter[4] !== 0)) {
        return { mistakes: { obstacle: "found a plant that is not at rest at its reference, expected one that is" } };
    }
    if (law === "drag" && !(at("obstacle.velocity") - at("plant.velocity") < 0)) {
        return { mistakes: { obstacle: "found an obstacle that does not approach, expected a negative velocity" } };
    }
    const limits = Object.entries(LIMITS).flatMap(([name, [column, row, unit]]) => {
        const limit = values[`constraints.${name}`];
        return limit === undefined ? [] : [{ name, column, row, unit, limit }];
    });
    const rows = [...limits.map(({ row, limit }) => [row, 1 / limit, 1]), ...(fixed.limits ?? [])];
    const terms = fixed.terms ?? objectiveTerms(fields, values);
    return { mistakes, law, encounter, curve, described, terms, limits, rows, bounds, values, horizon: 600, ratio: values["law.ratio"] };
}

function objectiveTerms(fields, values) {
    const first = fields["objective.kind"] === "time" ? [0, values["objective.time_scale"]] : [1, values["objective.position_scale"]];
    const scale = values["objective.velocity_scale"], follows = scale === "obstacle speed";
    const weight = (name) => Number(fields[`objective.${name}_weight`] ?? 1);
    return [
        [first[0], weight(first[0] ? "position" : "time") / first[1] ** 2, 2, 0],
        [4, weight("velocity") / (follows ? 1 : scale) ** 2, 2, follows ? 1 : 0],
    ];
}

/** Return a copy of a problem in which the object approaches at another relative speed [m/s]. */
export function atSpeed(encounter, speed) {
    const changed = [...encounter];
    changed[6] = encounter[4] - speed;
    return changed;
}

/** Write the fields as a scenario file (TOML). */
export function tomlOf(fields) {
    const sections = {};
    for (const [key, value] of Object.entries(fields)) {
        const [section, name] = key.split(".");
        if (value === "" || name === undefined) continue;
        if (section === "law" && fields["law.kind"] !== "virtual-drag") continue;
        if (section === "gain" && fields["law.kind"] === "virtual-drag") continue;
        (sections[section] ??= []).push(`${name} = ${tomlValue(value)}`);
    }
    return Object.entries(sections).map(([section, lines]) => `[${section}]\n${lines.join("\n")}\n`).join("\n");
}

function tomlValue(value) {
    if (Array.isArray(value)) return `[${value.map(tomlValue).join(", ")}]`;
    return /^[-+]?[\d.]+(?:[eE][-+]?\d+)?$/.test(String(value)) ? String(value) : JSON.stringify(String(value));
}

/** Write the Python program that designs the same gain; a file name where the problem is that of a file. */
export function pythonOf(problem, gain, file = null) {
    const [mass, damping, stiffness] = problem.encounter, { values } = problem, n = (x) => String(x);
    const lines = ["import pretouch as pt", ""];
    if (file) {
        lines.push(`task = pt.load_scenario(${JSON.stringify(file)})`);
    } else {
        const d = problem.described;
        const curve = {
            "inverse-power": `pt.InversePower(scale=1.0, distance_offset=${n(d.distance_offset)}, exponent=${n(d.exponent)})`,
            "exponential-1": `pt.ExponentialFirstOrder(scale=1.0, rate=${n(d.rate)})`,
            "exponential-2": `pt.ExponentialSecondOrder(scale=1.0, rate=${n(d.rate)}, curvature=${n(d.curvature)})`,
        }[d.model];
        const terms = problem.terms.map(([row, factor, , follows]) => {
            const scale = follows ? '"obstacle speed"' : `${n(1 / Math.sqrt(factor))}`;
            return `pt.Term(quantity="${{ 0: "time", 1: "displacement", 4: "relative_velocity" }[row]}", scale=${scale})`;
        });
        const limits = problem.limits.map(({ name, limit }) => `pt.Constraint(name="${name}", limit=${n(limit)})`);
        const bodies = ["plant", "reference"].flatMap((body) => {
            const moved = ["position", "velocity"].filter((part) => get(values, `${body}.${part}`) !== 0);
            const inside = moved.map((part) => `${part}=${n(values[`${body}.${part}`])}`).join(", ");
            return moved.length ? [`        ${body}=pt.motion.${body === "plant" ? "Plant" : "Reference"}(${inside}),`] : [];
        });
        lines.push(
            "task = pt.Task(", "    pt.Scenario(",
            `        admittance=pt.Admittance(mass=${n(mass)}, damping=${n(damping)}, stiffness=${n(stiffness)}),`,
            `        obstacle=pt.Obstacle(position=${n(values["obstacle.position"])}, velocity=${n(get(values, "obstacle.velocity"))}, acceleration=${n(get(values, "obstacle.acceleration"))}),`,
            ...bodies, "    ),",
            d.recess ? `    pt.Recessed(sensor=${curve}, recess=${n(d.recess)}),` : `    ${curve},`,
        );
        if (problem.law === "drag") lines.push(`    drag_effect=pt.DragEffect(ratio=${n(problem.ratio)}),`);
        else lines.push(`    pt.Objective(terms=(${terms.join(", ")})),`, `    bounds=(${problem.bounds.map(n).join(", ")}),`);
        if (limits.length && problem.law !== "drag") lines.push(`    constraints=[${limits.join(", ")}],`);
        lines.push(")");
    }
    if (problem.law === "drag") lines.push("design = pt.design(task)", "print(design)");
    else lines.push("design = pt.design(task)", "print(design)", `contact = pt.find_contact(task.scenario, task.sensor, ${n(gain)}).contact`, "print(contact.relative_velocity)");
    return lines.join("\n") + "\n";
}

/** Return the conclusion of the command about a solved problem: optimal, infeasible, no-contact, uncertain, holds or fails. */
export function conclusionOf(core, problem, { contact, free, design }) {
    if (problem.law === "drag") {
        const misses = problem.limits.some(({ column, limit }) => !(Math.abs(contact[column]) <= limit * (1 + 1e-9)));
        return contact.status === 0 && !misses ? "holds" : "fails";
    }
    if (design.status === 1) return "optimal";
    const touches = free.status === 0 || tradeOff(core, problem, 96).rows.some((row) => row.status === 0);
    if (!touches) return "no-contact";
    return design.status === 2 ? "infeasible" : "uncertain";
}

/** Compute what the page shows of a problem: the design, the contact at the chosen gain, and without mitigation. */
export function solveProblem(core, problem, chosen) {
    const { encounter, curve, horizon, bounds } = problem, [free] = core.solve(encounter, curve, [0], horizon);
    if (problem.law === "drag") {
        const phi = core.dragOfRatio(encounter, curve, problem.ratio);
        const [contact] = core.drag(encounter, curve, [phi], horizon);
        return { free, contact, gain: phi, design: { status: 1, gain: phi }, unit: "N*s^2", symbol: "φ" };
    }
    const design = core.design(encounter, curve, { terms: problem.terms, limits: problem.rows, bounds, horizon });
    const axis = gainAxis(bounds), middle = axis.gain((axis.coordinate(bounds[0]) + axis.coordinate(bounds[1])) / 2);
    const gain = chosen ?? (design.status === 1 ? design.gain : middle);
    const [contact] = core.solve(encounter, curve, [gain], horizon);
    return { free, contact, gain, design, unit: "N*s", symbol: "Dₚ" };
}

/** Return the motion of a run on given times, with null after its end. */
export function motionOf(core, problem, { law, gain, contact }, times) {
    const end = contact.time, inside = times.filter((t) => t <= end);
    const method = law === "drag" ? "traceDrag" : "trace";
    const motion = inside.length ? core[method](problem.encounter, problem.curve, gain, problem.horizon, inside) : null;
    const column = (name) => times.map((t, i) => (i < inside.length ? motion[name][i] : null));
    return { distance: column("distance"), relative_velocity: column("relative_velocity"), displacement: column("displacement"), virtual_force: column("virtual_force") };
}

/** Return the trade-off: contacts over all gains between the bounds, ascending in the coordinate of gainAxis.
 *
 * With a drag, contacts over the share of the approach speed that is left at contact. */
export function tradeOff(core, problem, count) {
    if (problem.law === "drag") {
        const places = Array.from({ length: count }, (_, i) => 0.02 + (0.96 * i) / (count - 1));
        const unit = core.dragOfRatio(problem.encounter, problem.curve, 1 / Math.E); // proportional to ln(1 / ratio)
        const drags = places.map((ratio) => unit * Math.log(1 / ratio));
        return { axis: null, places, rows: core.drag(problem.encounter, problem.curve, drags, problem.horizon) };
    }
    const axis = gainAxis(problem.bounds), [low, high] = problem.bounds.map(axis.coordinate);
    const places = Array.from({ length: count }, (_, i) => low + ((high - low) * i) / (count - 1));
    const gains = places.map((u) => Math.min(Math.max(axis.gain(u), problem.bounds[0]), problem.bounds[1]));
    return { axis, places, rows: core.solve(problem.encounter, problem.curve, gains, problem.horizon) };
}

/** Return contact speeds over approach speeds [m/s] for a gain of the damper and for a drag. */
export function overSpeed(core, problem, gain, phi, speeds) {
    const encounters = speeds.map((speed) => atSpeed(problem.encounter, speed));
    const speedOf = (row) => (row.status === 0 ? Math.abs(row.relative_velocity) : null);
    const damped = core.solve(encounters, problem.curve, speeds.map(() => gain), problem.horizon).map(speedOf);
    const dragged = encounters.map((e) => speedOf(core.drag(e, problem.curve, [phi], problem.horizon)[0]));
    return { damped, dragged };
}
