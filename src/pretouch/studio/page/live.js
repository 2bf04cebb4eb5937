// Mount a single live figure into an element: <div data-pretouch-figure="gain"></div>, or "drag" or "pedestal".

import { Chart, writeKey } from "./charts.js";
import { Encounter } from "./encounter.js";
import { formatQuantity, motionOf, overSpeed, problemOf, solveProblem, tradeOff } from "./model.js";

/** The approaching object of the letter's Fig. 4, with the sensor of its Table I. */
export const LETTER = {
    "sensor.model": "inverse-power", "sensor.scale": "1.30e-5", "sensor.distance_offset": "41.9 mm", "sensor.exponent": "3.32",
    "admittance.mass": "1 kg", "admittance.damping": "10 N*s/m", "admittance.stiffness": "25 N/m",
    "obstacle.position": "42.2 mm", "obstacle.velocity": "-0.3 m/s",
    "objective.kind": "excursion", "objective.position_scale": "0.5 m", "objective.velocity_scale": "0.3 m/s",
    "gain.bounds": ["-10 N*s", "-0.01 N*s"], "constraints.excursion": "0.2 m",
};

/** Return ascending times up to the longest run, which include the end of every run. */
export function timesOf(ends, count = 120) {
    const last = Math.max(...ends), grid = Array.from({ length: count }, (_, i) => (last * i) / (count - 1));
    return [...new Set([...grid, ...ends])].sort((a, b) => a - b);
}

function frame(element, title, text, slider) {
    element.classList.add("pretouch-figure");
    element.innerHTML = `<figure><figcaption><b></b> <span></span></figcaption><ul class="key"></ul><div class="chart"></div>
        <label class="slide"><span></span><input type="range"><output></output></label></figure>`;
    element.querySelector("figcaption b").textContent = title;
    element.querySelector("figcaption span").textContent = text;
    const input = element.querySelector("input");
    element.querySelector("label span").textContent = slider.label;
    Object.assign(input, slider.range);
    return { input, output: element.querySelector("output"), chart: element.querySelector(".chart"), key: element.querySelector(".key") };
}

/** A gain to drag, as in the letter's Fig. 4: distance and speed over time, next to the run without mitigation. */
function gainFigure(core, element) {
    const problem = problemOf(LETTER), solved = solveProblem(core, problem), { axis } = tradeOff(core, problem, 2);
    const [low, high] = problem.bounds.map(axis.coordinate);
    const parts = frame(element, "Drag the gain.", "The object approaches at 0.3 m/s from 42.2 mm (the letter's Fig. 4).", {
        label: "Gain Dₚ", range: { min: low, max: high, step: "any", value: axis.coordinate(solved.design.gain) },
    });
    const chart = new Chart(parts.chart, {
        x: { label: "time [ms]" }, y: [{ key: "l", label: "distance [mm]" }, { key: "v", label: "speed [m/s]" }],
        lines: [
            { label: "distance", color: "--now", axis: "l" }, { label: "speed", color: "--pin-1", axis: "v" },
            { label: "distance without mitigation", color: "--free", axis: "l", dash: [6, 4] },
        ],
    });
    writeKey(parts.key, chart.options.lines);
    const draw = () => {
        const now = solveProblem(core, problem, axis.gain(Number(parts.input.value))), free = { gain: 0, contact: now.free };
        const times = timesOf([now.contact.time, now.free.time]), motion = motionOf(core, problem, now, times);
        const before = motionOf(core, problem, free, times), speed = Math.abs(now.contact.relative_velocity);
        const mm = (column) => column.map((x) => (x === null ? null : 1e3 * x));
        chart.show([times.map((t) => 1e3 * t), mm(motion.distance), motion.relative_velocity.map((v) => (v === null ? null : Math.abs(v))), mm(before.distance)]);
        parts.output.textContent = `${formatQuantity(now.gain, "N*s", 3)}: contact at ${formatQuantity(speed, "m/s", 3)}, excursion ${formatQuantity(now.contact.largest_excursion, "m", 3)}`;
    };
    parts.input.addEventListener("input", draw);
    draw();
}

/** The letter's law and the drag over the approach speed: the drag reaches the same share of every speed. */
function dragFigure(core, element) {
    const problem = problemOf(LETTER), { gain } = solveProblem(core, problem).design;
    const parts = frame(element, "One law for every speed.", "The letter's gain is optimal for 0.3 m/s. The drag reaches the same share of each approach speed.", {
        label: "Share of the drag", range: { min: 0.05, max: 0.9, step: 0.01, value: 0.26 },
    });
    const chart = new Chart(parts.chart, {
        x: { label: "approach speed [m/s]" }, y: [{ key: "v", label: "contact speed [m/s]" }],
        lines: [
            { label: "no mitigation", color: "--free", dash: [6, 4] }, { label: "letter's damper", color: "--now" }, { label: "drag", color: "--pin-1" },
        ],
    });
    writeKey(parts.key, chart.options.lines);
    const speeds = Array.from({ length: 40 }, (_, i) => 0.025 * (i + 1));
    const draw = () => {
        const ratio = Number(parts.input.value), phi = core.dragOfRatio(problem.encounter, problem.curve, ratio);
        const { damped, dragged } = overSpeed(core, problem, gain, phi, speeds);
        chart.show([speeds, speeds, damped, dragged]);
        parts.output.textContent = `contact at ${formatQuantity(100 * ratio, "%", 3)} of the approach speed, φ = ${formatQuantity(phi, "N*s^2", 3)}`;
    };
    parts.input.addEventListener("input", draw);
    draw();
}

/** The pedestal that spoils a calibration: an offset that is not subtracted flattens the slope of ln xi. */
function pedestalFigure(core, element) {
    const problem = problemOf(LETTER), { slope } = problem.curve, start = problem.values["obstacle.position"];
    const parts = frame(element, "An offset that stays in the readings flattens the slope.", "The controller believes the flatter curve, so that its force is too weak far from contact.", {
        label: "Offset", range: { min: 0, max: 100, step: 1, value: 20 },
    });
    const chart = new Chart(parts.chart, {
        x: { label: "distance [mm]" }, y: [{ key: "g", label: "|slope g| [1/m]" }],
        lines: [{ label: "of the sensor", color: "--now" }, { label: "with the offset", color: "--free", dash: [6, 4] }],
    });
    writeKey(parts.key, chart.options.lines);
    const distances = Array.from({ length: 120 }, (_, i) => (start * i) / 119);
    // ln xi relative to the start is the integral of g: Simpson's rule between the points
    const rise = distances.map(() => 0);
    for (let i = distances.length - 2; i >= 0; i--) {
        const [a, b] = [distances[i], distances[i + 1]];
        rise[i] = rise[i + 1] - ((b - a) / 6) * (slope(a) + 4 * slope((a + b) / 2) + slope(b));
    }
    const draw = () => {
        const share = Number(parts.input.value) / 100; // of the output at detection
        // d ln(xi + o) / dl = g xi / (xi + o)
        const spoiled = distances.map((l, i) => -slope(l) / (1 + share / Math.exp(rise[i])));
        chart.show([distances.map((l) => 1e3 * l), distances.map((l) => -slope(l)), spoiled]);
        parts.output.textContent = `${(100 * share).toFixed(0)} % of the output at ${formatQuantity(start, "m")}: there the slope seems ${formatQuantity(100 / (1 + share), "%", 3)} of the true one`;
    };
    parts.input.addEventListener("input", draw);
    draw();
}

/** The encounter as an animation, with the letter's optimal gain. */
function encounterFigure(core, element) {
    const problem = problemOf(LETTER), solved = solveProblem(core, problem), times = timesOf([solved.contact.time]);
    element.classList.add("pretouch-figure");
    element.innerHTML = `<figure><canvas class="encounter" role="img" aria-label="Robot and approaching object"></canvas>
        <div class="slide"><button type="button">Play</button><label>Slowed down <select><option value="1">not</option><option value="10" selected>10 times</option><option value="50">50 times</option></select></label></div></figure>`;
    const scene = new Encounter(element.querySelector("canvas"));
    scene.show({ time: times, ...motionOf(core, problem, solved, times) }, problem.curve.slope);
    element.querySelector("button").addEventListener("click", () => scene.play());
    element.querySelector("select").addEventListener("change", (event) => (scene.slow = Number(event.target.value)));
    scene.draw();
}

const FIGURES = { gain: gainFigure, drag: dragFigure, pedestal: pedestalFigure, encounter: encounterFigure };

/** Mount the figure that an element names. */
export function mountFigure(core, element) {
    const name = element.dataset.pretouchFigure, make = FIGURES[name];
    if (make) make(core, element);
    else element.textContent = `There is no figure ${JSON.stringify(name)}; there are ${Object.keys(FIGURES).join(", ")}.`;
}
