// The page: state, inputs and figures. What needs Python is in server.js.

import { Chart, gainTicks, writeKey } from "./charts.js";
import { Encounter } from "./encounter.js";
import { LETTER, timesOf } from "./live.js";
import { FIELDS, conclusionOf, formatQuantity, motionOf, overSpeed, parseQuantity, problemOf, pythonOf, solveProblem, tomlOf, tradeOff, writeLike } from "./model.js";

const POINTS = { still: 96, dragged: 36 }; // of the trade-off curve
const HISTORY = 200;
const WITHOUT_CONTACT = 2; // s that are shown of encounters without contact
const LETTERS = "ABCDEFGH";
const NEGLIGIBLE = 1e-12; // m, a rounding error of an excursion
const SPEEDS = Array.from({ length: 16 }, (_, i) => (i + 1) / 16);
export const byId = (id) => document.getElementById(id);

const MODEL_DEFAULTS = {
    "inverse-power": { "sensor.distance_offset": "41.9 mm", "sensor.exponent": "3.32" },
    "exponential-1": { "sensor.rate": "-61 1/m" },
    "exponential-2": { "sensor.rate": "-74 1/m", "sensor.curvature": "474 1/m^2" },
};

export class Page {
    constructor(core, { key = "pretouch", name = "", fields = LETTER } = {}) {
        this.core = core;
        this.key = key;
        this.past = [];
        this.future = [];
        this.delays = []; // from an input to its picture [ms], of the last drawings
        this.painted = new MessageChannel(); // its messages arrive after the frame is drawn
        this.painted.port1.onmessage = ({ data }) => {
            this.delays.push(performance.now() - data);
            this.delays.splice(0, this.delays.length - HISTORY);
        };
        this.state = this.#restored() ?? { fields: { ...fields }, chosen: null, fixed: {}, pins: [], file: null };
        byId("name").textContent = name;
        byId("inputs").open = innerWidth >= 820; // on a telephone, the result comes first
        this.#charts();
        this.#controls();
        this.#form();
        this.update();
    }

    // ---- state ----

    #restored() {
        for (const store of [sessionStorage, localStorage]) {
            try {
                const state = JSON.parse(store.getItem(this.key));
                if (state?.fields && Array.isArray(state.pins)) return state;
            } catch {
                continue; // what an older page has stored is not used
            }
        }
        return null;
    }

    #store() {
        clearTimeout(this.storing);
        this.storing = setTimeout(() => this.keep(), 150);
    }

    /** Store the state now, in this tab and for the next one. */
    keep() {
        const text = JSON.stringify(this.state);
        for (const store of [sessionStorage, localStorage]) {
            try {
                store.setItem(this.key, text);
            } catch {
                continue; // a full store, or a browser that refuses it
            }
        }
    }

    /** Change the state; `commit` adds the state before to the history. */
    change(change, { commit = true } = {}) {
        this.before ??= structuredClone(this.state);
        change(this.state);
        if (commit) this.commit();
        this.request();
    }

    /** End a change of many steps, such as a drag. */
    commit() {
        if (this.before && JSON.stringify(this.before) !== JSON.stringify(this.state)) {
            this.past.push(this.before);
            this.past.splice(0, this.past.length - HISTORY);
            this.future = [];
        }
        this.before = null;
        this.request();
        this.#store();
        this.#buttons();
        this.onCommit?.();
    }

    travel(from, to) {
        if (!from.length) return;
        to.push(structuredClone(this.state));
        this.state = from.pop();
        this.#form();
        this.update();
        this.#store();
        this.onCommit?.();
    }

    /** Replace the scenario, such as by that of a file. */
    load(fields, fixed = {}, file = null, more = {}) {
        const typed = this.#typed(fields);
        this.change((state) => Object.assign(state, { fields, fixed, file, chosen: null }, more));
        if (typed) this.change((state) => Object.assign(state, { fields: JSON.parse(JSON.stringify({ ...state.fields, ...typed.fields })), chosen: typed.chosen }));
        this.#form();
    }

    /** Load the first scenario; what the user types until then stays, as a change that Undo takes back. */
    async keepTyped(load) {
        this.untyped = structuredClone(this.state);
        try {
            await load();
        } finally {
            this.untyped = null;
        }
    }

    /** Return the inputs that the user has changed since `keepTyped`, without those of a sensor that the file replaces. */
    #typed(fields) {
        const { state, untyped } = this;
        if (!untyped) return null;
        const keys = Object.keys({ ...untyped.fields, ...state.fields }).filter((key) => untyped.fields[key] !== state.fields[key]);
        const kept = keys.filter((key) => !(key.startsWith("sensor.") && fields["sensor.calibration"]));
        const chosen = state.chosen === untyped.chosen ? null : state.chosen;
        return kept.length || chosen !== null ? { chosen, fields: Object.fromEntries(kept.map((key) => [key, state.fields[key]])) } : null;
    }

    // ---- drawing ----

    /** Compute and draw in the next frame; several requests make one drawing. */
    request(since = performance.now()) {
        this.since ??= since;
        this.frame ??= requestAnimationFrame(() => {
            this.frame = null;
            this.update();
        });
    }

    update() {
        const { state, core } = this, problem = problemOf(state.fields, state.fixed);
        this.#mistakes(problem.mistakes);
        if (!problem.encounter) {
            const mistakes = Object.entries(problem.mistakes), count = mistakes.length;
            const sentences = mistakes.filter(([key]) => !FIELDS.some((field) => field.key === key && byId(key)));
            const text = sentences.map(([, words]) => ` ${words[0].toUpperCase()}${words.slice(1)}.`).join("");
            byId("headline").textContent = `${count} ${count === 1 ? "input needs" : "inputs need"} a correction.${text} The figures show the last valid inputs.`;
            document.body.classList.add("stale");
            byId("reservation").hidden = true;
            for (const id of ["limits", "numbers"]) byId(id).replaceChildren(); // they would belong to other inputs
            this.since = null;
            return;
        }
        document.body.classList.remove("stale");
        const solved = solveProblem(core, problem, state.chosen);
        const signature = JSON.stringify([problem.encounter, problem.described, problem.bounds, problem.law]);
        const points = this.before ? POINTS.dragged : POINTS.still;
        const enough = signature === this.signature && this.trade.places.length >= points;
        if (!enough) this.trade = tradeOff(core, problem, points); // the gain does not change it
        this.signature = signature;
        Object.assign(this, { problem, solved });
        this.#headline(problem, solved);
        this.#slider(problem, solved);
        this.#draw(problem, solved);
        this.#buttons();
        const since = this.since;
        this.since = null;
        if (since) this.painted.port2.postMessage(since);
    }

    #headline(problem, { contact, free, gain, design, unit, symbol }) {
        const speed = (row) => formatQuantity(Math.abs(row.relative_velocity), "m/s", 3);
        const chosen = problem.law !== "drag" && this.state.chosen !== null;
        const name = problem.law === "drag" ? "Drag" : chosen ? "Chosen gain" : "Optimal gain";
        let text = `${name} ${symbol} = ${formatQuantity(gain, unit)}: `;
        const conclusion = chosen ? "" : conclusionOf(this.core, problem, this.solved);
        if (conclusion === "no-contact") text = "No gain within the bounds ends in contact. ";
        if (conclusion === "uncertain") text = `The search in the page is not certain of the optimum; run pretouch design. With ${symbol} = ${formatQuantity(gain, unit)}: `;
        if (conclusion === "infeasible") text = `No gain within the bounds meets the limits. With ${symbol} = ${formatQuantity(gain, unit)}: `;
        text += contact.status === 0 ? `contact at ${speed(contact)}` : conclusion === "no-contact" ? "" : "no contact";
        if (free.status === 0) text += contact.status === 0 ? ` instead of ${speed(free)} without mitigation.` : `${text.endsWith(" ") ? "C" : "; c"}ontact at ${speed(free)} without mitigation.`;
        else if (!text.endsWith(" ")) text += contact.status === 0 ? "; no contact without mitigation." : ".";
        const { headline, spread } = this.reservation?.gain === gain ? this.reservation : {}; // they belong to one gain
        byId("headline").textContent = spread ? `${text} ${spread}` : text;
        byId("reservation").textContent = headline ?? "";
        byId("reservation").hidden = !headline;
        const items = problem.limits.map(({ name: limit, column, unit: of, limit: most }) => {
            const value = Math.abs(contact[column]), met = value <= most * (1 + 1e-9);
            const item = document.createElement("li");
            if (contact.status !== 0) {
                item.textContent = `${limit.replaceAll("_", " ")}: not judged without contact`;
                return item;
            }
            item.className = met ? "met" : "missed";
            item.textContent = `${limit.replaceAll("_", " ")} ${formatQuantity(value, of, 3)}, limit ${formatQuantity(most, of, 3)}: ${met ? "met" : "not met"}`;
            return item;
        });
        byId("limits").replaceChildren(...items);
        const shown = [["largest_excursion", "excursion", "m"], ["largest_virtual_force", "largest virtual force", "N"], ["largest_acceleration", "largest acceleration", "m/s^2"], ["time", "time to contact", "s"]];
        byId("numbers").replaceChildren(...(contact.status === 0 ? shown : []).map(([column, words, of]) => {
            const item = document.createElement("li");
            item.textContent = `${words} ${formatQuantity(contact[column], of, 3)}`;
            return item;
        }));
    }

    #slider(problem, { gain }) {
        const slider = byId("gain"), { axis } = this.trade, drag = problem.law === "drag";
        const [low, high] = drag ? [0.02, 0.98] : problem.bounds.map(axis.coordinate);
        Object.assign(slider, { min: low, max: high });
        if (document.activeElement !== slider || !this.sliding) slider.value = drag ? problem.ratio : axis.coordinate(gain);
        const text = drag ? `${formatQuantity(100 * problem.ratio, "%", 3)} of the approach speed` : formatQuantity(gain, "N*s");
        byId("gain-value").textContent = text;
        slider.setAttribute("aria-valuetext", text);
        byId("gain-label").textContent = drag ? "Share" : "Gain";
        byId("optimal").hidden = drag;
        byId("optimal").disabled = this.state.chosen === null;
    }

    #runs(problem, solved) {
        const now = { ...solved, law: problem.law, problem, words: "now", color: "--now" };
        const free = { law: "damper", gain: 0, contact: solved.free, problem, words: "without mitigation", color: "--free", dash: [6, 4] };
        const pins = this.#pinned().map((pin, i) => ({ ...pin.solved, law: pin.problem.law, problem: pin.problem, words: `pin ${LETTERS[i]}`, color: `--pin-${(i % 4) + 1}`, dash: [2, 3] }));
        return [now, free, ...pins, ...(this.overlay ?? [])];
    }

    /** The pins with their solutions, which are computed once. */
    #pinned() {
        this.solvedPins ??= new Map();
        return this.state.pins.map((pin) => {
            const key = JSON.stringify(pin);
            if (!this.solvedPins.has(key)) {
                const problem = problemOf(pin.fields, pin.fixed);
                this.solvedPins.set(key, problem.encounter ? { pin, problem, solved: solveProblem(this.core, problem, pin.chosen) } : null);
            }
            return this.solvedPins.get(key);
        }).filter(Boolean);
    }

    #draw(problem, solved) {
        const runs = this.#runs(problem, solved), ends = runs.filter((run) => run.contact.status === 0 && run.contact.time < 60).map((run) => run.contact.time);
        const times = timesOf(ends.length ? ends : [WITHOUT_CONTACT]);
        const motions = runs.map((run) => run.motion ? run.motion(times) : motionOf(this.core, run.problem, run, times));
        const lines = runs.map(({ words, color, dash }) => ({ label: words, color, dash }));
        const ms = times.map((t) => 1e3 * t), scaled = (name, by) => motions.map((m) => m[name].map((x) => (x === null ? null : by(x))));
        this.distance.show([ms, ...scaled("distance", (x) => 1e3 * x)], lines);
        this.velocity.show([ms, ...scaled("relative_velocity", Math.abs)], lines);
        this.force.show([ms, ...scaled("virtual_force", Math.abs)], lines);
        this.#keys(["distance-key", "velocity-key", "force-key"], lines);
        const { places, rows } = this.trade, value = (row, x) => (row.status === 0 ? Math.abs(x) : null);
        const tradeLines = [{ label: "contact speed", color: "--now", axis: "v" }, { label: "largest excursion", color: "--pin-1", axis: "e", dash: [6, 3] }];
        this.tradeChart.options.x = this.#tradeAxis(problem);
        if (this.tradeLaw !== problem.law) this.tradeChart.options.lines = []; // another axis: a new plot
        this.tradeLaw = problem.law;
        this.tradeChart.show([places, rows.map((row) => value(row, row.relative_velocity)), rows.map((row) => value(row, 1e3 * row.largest_excursion))], tradeLines);
        this.#keys(["trade-key"], tradeLines);
        this.#drawSpeeds(problem, solved);
        const count = times.findIndex((t) => t >= solved.contact.time) + 1 || times.length;
        const cut = (column) => column.slice(0, count), [first] = motions;
        if (first.distance[0] !== null) this.scene.show({ time: cut(times), distance: cut(first.distance), displacement: cut(first.displacement), relative_velocity: cut(first.relative_velocity) }, problem.curve.slope);
        byId("time").max = Math.min(solved.contact.time, times.at(-1));
        this.#compare(runs);
    }

    #drawSpeeds(problem, { gain }) {
        const drag = problem.law === "drag", free = problem.encounter[6] - problem.encounter[4];
        byId("speeds").parentElement.hidden = !(free < 0);
        if (!(free < 0)) return;
        const most = Math.max(1, 2 * Math.abs(free)), speeds = SPEEDS.map((s) => s * most);
        const damper = drag ? this.otherGain ?? -0.7463 : gain;
        if (!drag) this.otherGain = gain;
        const ratio = drag ? problem.ratio : Math.min(Math.max(Math.abs(this.solved.contact.relative_velocity / free), 0.02), 0.98);
        const phi = drag ? gain : this.core.dragOfRatio(problem.encounter, problem.curve, ratio);
        const { damped, dragged } = overSpeed(this.core, problem, damper, phi, speeds);
        const lines = [
            { label: "without mitigation", color: "--free", dash: [6, 4] },
            { label: `damper ${formatQuantity(damper, "N*s", 3)}`, color: drag ? "--pin-1" : "--now" },
            { label: `drag ${formatQuantity(phi, "N*s^2", 3)}`, color: drag ? "--now" : "--pin-1" },
        ];
        this.speeds.marksNow = [{ value: Math.abs(free), label: "this encounter", color: "--quiet" }];
        this.speeds.show([speeds, speeds, damped, dragged], lines.map((line, i) => ({ ...line, label: ["free", `damper${drag}`, `drag${drag}`][i] })));
        this.#keys(["speeds-key"], lines);
    }

    #tradeAxis(problem) {
        if (problem.law === "drag") return { label: "contact speed over approach speed" };
        const { axis } = this.trade;
        return {
            label: "gain Dₚ [N s]", format: (u) => Number(axis.gain(u).toPrecision(2)).toString().replace("-", "−"),
            ticks: (low, high, width) => gainTicks(axis, low, high, width / 60),
        };
    }

    #keys(ids, lines) {
        for (const id of ids) writeKey(byId(id), lines);
    }

    #compare(runs) {
        const table = byId("compare"), pins = this.state.pins;
        table.hidden = !pins.length;
        const text = JSON.stringify(runs.map(({ words, gain, contact }) => [words, gain, contact.relative_velocity, contact.largest_excursion]));
        if (table.dataset.rows === text || !pins.length) return;
        table.dataset.rows = text;
        const cell = (words, tag = "td") => Object.assign(document.createElement(tag), { textContent: words });
        const head = document.createElement("tr");
        head.append(...["", "law", "contact speed", "excursion", "largest force", "time", ""].map((words) => cell(words, "th")));
        for (const one of head.children) one.scope = "col";
        const rows = runs.filter((run) => !run.motion).map((run) => {
            const row = document.createElement("tr"), { contact } = run, pin = run.words.startsWith("pin ") ? LETTERS.indexOf(run.words[4]) : -1;
            const unit = run.law === "drag" ? "N*s^2" : "N*s", title = cell(pin >= 0 ? run.words[4] : run.words, "th");
            title.scope = "row";
            title.style.color = `var(${run.color})`;
            row.append(
                title, cell(run.gain === 0 ? "none" : formatQuantity(run.gain, unit)), cell(formatQuantity(Math.abs(contact.relative_velocity), "m/s")),
                cell(formatQuantity(Math.abs(contact.largest_excursion) < NEGLIGIBLE ? 0 : contact.largest_excursion, "m")), cell(formatQuantity(contact.largest_virtual_force, "N")), cell(formatQuantity(contact.time, "s")),
            );
            const actions = cell("");
            if (pin >= 0) {
                const use = Object.assign(document.createElement("button"), { type: "button", textContent: "Use" });
                const remove = Object.assign(document.createElement("button"), { type: "button", textContent: "Remove" });
                use.setAttribute("aria-label", `Use pin ${LETTERS[pin]}`);
                remove.setAttribute("aria-label", `Remove pin ${LETTERS[pin]}`);
                use.addEventListener("click", () => this.#usePin(pin));
                remove.addEventListener("click", () => this.change((state) => state.pins.splice(pin, 1)));
                actions.append(use, " ", remove);
            }
            row.append(actions);
            return row;
        });
        const body = document.createElement("tbody"), top = document.createElement("thead");
        top.append(head);
        body.append(...rows);
        table.replaceChildren(top, body);
    }

    #usePin(i) {
        const { fields, fixed, chosen } = structuredClone(this.state.pins[i]);
        this.change((state) => Object.assign(state, { fields, fixed, chosen }));
        this.#form();
    }

    // ---- controls ----

    #charts() {
        this.tradeChart = new Chart(byId("trade"), {
            x: {}, y: [{ key: "v", label: "contact speed [m/s]" }, { key: "e", label: "excursion [mm]" }], lines: [], marks: () => this.#tradeMarks(),
            onDrag: (u, event) => this.#choose(u, event.timeStamp), onDragEnd: () => this.commit(),
        });
        const marks = (chart) => () => ({ vertical: chart().marksNow ?? [] });
        this.speeds = new Chart(byId("speeds"), { x: { label: "approach speed [m/s]" }, y: [{ key: "v", label: "contact speed [m/s]" }], lines: [], marks: marks(() => this.speeds) });
        const chart = (id, label, key) => new Chart(byId(id), { x: { label: "time [ms]" }, y: [{ key, label }], lines: [], height: 200 });
        this.distance = chart("distance", "distance [mm]", "l");
        this.velocity = chart("velocity", "relative speed [m/s]", "v");
        this.force = chart("force", "virtual force [N]", "f");
        this.scene = new Encounter(byId("scene"), (time) => (byId("time").value = time));
    }

    #tradeMarks() {
        const { problem, solved } = this;
        if (!solved) return {};
        const drag = problem.law === "drag", { axis } = this.trade, place = drag ? problem.ratio : axis.coordinate(solved.gain);
        const vertical = [{ value: place, label: drag ? formatQuantity(solved.gain, "N*s^2", 3) : formatQuantity(solved.gain, "N*s", 3), color: "--ink", handle: true }];
        if (!drag && solved.design.status === 1 && this.state.chosen !== null) vertical.push({ value: axis.coordinate(solved.design.gain), label: "optimum", color: "--quiet" });
        const horizontal = problem.limits.flatMap(({ name, limit }) => {
            if (name === "relative_velocity") return [{ value: limit, axis: "v", label: "speed limit", color: "--limit" }];
            return name === "excursion" ? [{ value: 1e3 * limit, axis: "e", label: "excursion limit", color: "--limit", right: true }] : [];
        });
        return { vertical, horizontal, shade: this.#infeasible(problem) };
    }

    /** Return the ranges of the trade-off in which a limit is not met. */
    #infeasible(problem) {
        const { places, rows } = this.trade, ranges = [];
        const fails = rows.map((row) => row.status !== 0 || problem.limits.some(({ column, limit }) => Math.abs(row[column]) > limit));
        for (let i = 0; i < fails.length; i++) {
            if (!fails[i]) continue;
            const from = i;
            while (i + 1 < fails.length && fails[i + 1]) i++;
            ranges.push([places[Math.max(from - 0.5, 0) | 0], places[Math.min(i + 1, fails.length - 1)]]);
        }
        return ranges;
    }

    #choose(place, since) {
        if (!this.problem) return;
        this.since ??= since;
        if (this.problem.law === "drag") {
            const ratio = Math.min(Math.max(place, 0.02), 0.98).toFixed(3);
            this.change((state) => (state.fields["law.ratio"] = ratio), { commit: false });
            const field = byId("law.ratio");
            if (field) field.value = ratio;
        } else {
            const { axis } = this.trade, [low, high] = this.problem.bounds;
            const gain = Math.min(Math.max(axis.gain(place), low), high);
            this.change((state) => (state.chosen = Number(gain.toPrecision(4))), { commit: false });
        }
    }

    #controls() {
        const slider = byId("gain");
        slider.addEventListener("input", (event) => {
            this.sliding = true;
            this.#choose(Number(slider.value), event.timeStamp);
        });
        slider.addEventListener("change", () => {
            this.sliding = false;
            this.commit();
        });
        byId("optimal").addEventListener("click", () => this.change((state) => (state.chosen = null)));
        byId("undo").addEventListener("click", () => this.travel(this.past, this.future));
        byId("redo").addEventListener("click", () => this.travel(this.future, this.past));
        byId("pin").addEventListener("click", () => this.change((state) => {
            const chosen = this.problem?.law === "drag" ? null : this.solved?.gain ?? null;
            state.pins = [...state.pins, { fields: { ...state.fields }, fixed: state.fixed, chosen }].slice(-LETTERS.length);
        }));
        byId("play").addEventListener("click", () => (this.scene.playing ? this.scene.pause() : this.scene.play()));
        byId("slow").addEventListener("change", (event) => (this.scene.slow = Number(event.target.value)));
        byId("time").addEventListener("input", (event) => {
            this.scene.pause();
            this.scene.seek(Number(event.target.value));
        });
        byId("law").addEventListener("change", (event) => this.#chooseLaw(event.target.value));
        byId("model").addEventListener("change", (event) => this.#chooseModel(event.target.value));
        byId("toml").addEventListener("click", () => this.showText("Scenario file", this.toml ? this.toml() : tomlOf(this.state.fields), "scenario.toml"));
        byId("python").addEventListener("click", () => this.problem && this.showText("Python", pythonOf(this.problem, this.solved.gain, this.state.file), "design.py"));
        byId("close").addEventListener("click", () => byId("text-dialog").close());
        byId("copy").addEventListener("click", () => this.#copy());
        byId("download").addEventListener("click", () => this.download(byId("text").textContent, byId("text").dataset.name));
        addEventListener("keydown", (event) => {
            if (!(event.ctrlKey || event.metaKey) || event.target.matches("input:not([type=range]), textarea")) return;
            const key = event.key.toLowerCase();
            if (key === "z") this.travel(...(event.shiftKey ? [this.future, this.past] : [this.past, this.future]));
            else if (key === "y") this.travel(this.future, this.past);
            else return;
            event.preventDefault();
        });
        addEventListener("pagehide", () => this.keep());
    }

    async #copy() {
        try {
            await navigator.clipboard.writeText(byId("text").textContent);
            byId("copy").textContent = "Copied";
        } catch {
            getSelection().selectAllChildren(byId("text")); // without permission, Ctrl+C copies the selection
            byId("copy").textContent = "Selected: press Ctrl+C";
        }
    }

    download(content, name) {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content]));
        link.download = name;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }

    async showText(title, text, name) {
        byId("text-title").textContent = title;
        byId("text").textContent = await text;
        byId("text").dataset.name = name;
        byId("copy").textContent = "Copy";
        byId("text-dialog").showModal();
    }

    #chooseLaw(kind) {
        this.change((state) => {
            state.fields["law.kind"] = kind;
            if (kind === "virtual-drag") state.fields["law.ratio"] ??= "0.26";
            else delete state.fields["law.kind"];
            state.fields["gain.bounds"] ??= LETTER["gain.bounds"];
        });
        this.#form();
    }

    #chooseModel(model) {
        if (!MODEL_DEFAULTS[model]) return;
        this.change((state) => {
            const kept = Object.entries(state.fields).filter(([key]) => !key.startsWith("sensor.") || ["sensor.scale", "sensor.recess"].includes(key));
            state.fields = { "sensor.model": model, ...Object.fromEntries(kept), ...MODEL_DEFAULTS[model] };
            state.fixed = { ...state.fixed, sensor: undefined };
        });
        this.#form();
    }

    #buttons() {
        byId("undo").disabled = !this.past.length;
        byId("redo").disabled = !this.future.length;
    }

    /** Make the inputs of the fields that the present scenario has. */
    #form() {
        const { fields, fixed } = this.state, form = byId("fields"), groups = new Map(), drag = fields["law.kind"] === "virtual-drag";
        const { id, selectionStart, selectionEnd } = document.activeElement;
        byId("law").value = drag ? "virtual-drag" : "damper";
        const models = Object.keys(MODEL_DEFAULTS), own = fields["sensor.calibration"] ? `fitted to ${fields["sensor.calibration"]}` : fields["sensor.model"];
        const options = fixed.sensor && !models.includes(own) ? [own, ...models] : models;
        byId("model").replaceChildren(...options.map((value) => Object.assign(document.createElement("option"), { value, textContent: value })));
        byId("model").value = own;
        for (const field of FIELDS) {
            if (!field.shown(fields) || (drag && field.key.startsWith("objective."))) continue;
            const section = field.key.split(".")[0];
            if (!groups.has(section)) groups.set(section, []);
            groups.get(section).push(this.#field(field));
        }
        const words = { sensor: "Sensor", admittance: "Admittance", obstacle: "Object", plant: "Robot", reference: "Reference", objective: "Objective", law: "Law", constraints: "Limits" };
        form.replaceChildren(...[...groups].flatMap(([section, rows]) => [Object.assign(document.createElement("h3"), { textContent: words[section] }), ...rows]));
        const edited = byId(id);
        if (!id || !form.contains(edited)) return; // the keyboard stays where it was
        edited.focus();
        edited.setSelectionRange(selectionStart, selectionEnd);
    }

    #field(field) {
        const row = document.createElement("div"), label = document.createElement("label"), input = document.createElement("input"), mistake = document.createElement("p");
        row.className = "field";
        Object.assign(label, { htmlFor: field.key, textContent: field.label });
        Object.assign(input, { id: field.key, type: "text", value: this.state.fields[field.key] ?? "", spellcheck: false, inputMode: "text" });
        if (field.sign === "limit") input.placeholder = "none";
        Object.assign(mistake, { className: "mistake", id: `${field.key}-mistake`, hidden: true });
        input.setAttribute("aria-describedby", mistake.id);
        input.addEventListener("input", () => this.#write(field, input.value));
        input.addEventListener("change", () => this.commit());
        input.addEventListener("keydown", (event) => {
            if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
            event.preventDefault();
            const step = event.shiftKey ? 1.1 : 1.01;
            this.#scale(field, input, event.key === "ArrowUp" ? step : 1 / step);
            this.commit();
        });
        this.#scrub(field, label, input);
        row.append(label, input, mistake);
        return row;
    }

    #write(field, text, since) {
        this.since ??= since;
        this.change((state) => {
            if (text === "") delete state.fields[field.key];
            else state.fields[field.key] = text;
            if (field.key.startsWith("sensor.") && state.fixed.sensor) state.fixed = { ...state.fixed, sensor: undefined };
        }, { commit: false });
        this.#store();
    }

    /** Multiply a value, and write it in its own unit. */
    #scale(field, input, factor, from = input.value, since) {
        let value;
        try {
            value = parseQuantity(from, field.unit);
        } catch {
            return; // a text that is no quantity is left as it is
        }
        input.value = writeLike(from, value * factor, field.unit);
        this.#write(field, input.value, since);
    }

    /** Let a label be dragged: 200 pixels double the value. */
    #scrub(field, label, input) {
        let start = null;
        label.addEventListener("pointerdown", (event) => {
            start = { x: event.clientX, text: input.value };
            label.setPointerCapture(event.pointerId);
        });
        label.addEventListener("pointermove", (event) => {
            if (start && event.clientX !== start.x) this.#scale(field, input, 2 ** ((event.clientX - start.x) / 200), start.text, event.timeStamp);
        });
        for (const name of ["pointerup", "pointercancel"]) {
            label.addEventListener(name, () => {
                if (start) this.commit();
                start = null;
            });
        }
    }

    #mistakes(mistakes) {
        for (const { key } of FIELDS) {
            const input = byId(key);
            if (!input) continue;
            const ofSection = { "obstacle.velocity": mistakes.obstacle, "sensor.exponent": mistakes.sensor, "sensor.rate": mistakes.sensor };
            const text = mistakes[key] ?? ofSection[key] ?? "", place = byId(`${key}-mistake`);
            input.setAttribute("aria-invalid", text ? "true" : "false");
            place.hidden = !text;
            place.textContent = text;
        }
    }
}
