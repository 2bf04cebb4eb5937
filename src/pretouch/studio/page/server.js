// Ask the server of the studio for what the page does not compute: files, fits, noise, evidence and exports.

import { byId } from "./app.js";
import { Chart } from "./charts.js";
import { formatQuantity } from "./model.js";

const POLL = 400; // ms between two questions about a running computation
const make = (tag, properties) => Object.assign(document.createElement(tag), properties);

/** Connect the page with its server: show what needs it, and load the opened file. */
export async function connect(page, server) {
    const studio = new Studio(page, server);
    for (const element of document.querySelectorAll(".server")) element.hidden = false;
    byId("static-note").hidden = true;
    byId("save").hidden = byId("reload").hidden = !server.file;
    await studio.start();
}

class Studio {
    constructor(page, server) {
        Object.assign(this, { page, server, jobs: new Map(), fitting: false, wanted: null });
        page.toml = () => this.text();
        page.onCommit = () => this.#committed();
        this.#controls();
        this.#charts();
    }

    async start() {
        const { page, server } = this;
        if (server.text && page.state.disk === undefined) await page.keepTyped(() => this.reload());
        else if (server.text && page.state.disk !== server.text) this.#say("The file has changed since this page was used; Reload file discards the changes of the page.");
        for (const name of JSON.parse(sessionStorage.getItem("pretouch:jobs") ?? "[]")) this.#follow(name);
    }

    // ---- requests ----

    /** Ask the server; throw an error with a sentence if there is no answer. */
    async ask(name, body, { raw = null, method = "POST", headers = {} } = {}) {
        let response;
        try {
            const content = raw ?? (body === undefined ? undefined : JSON.stringify(body));
            response = await fetch(`/api/${name}`, { method, body: content, headers: { "X-Pretouch-Token": this.server.token, ...headers } });
        } catch {
            const text = "The server does not answer. The page goes on computing, and keeps your inputs; start pretouch studio again for files, fits and simulations.";
            this.#say(text);
            throw new Error(text);
        }
        if (!response.headers.get("content-type")?.includes("json")) {
            this.#say("");
            return response.blob();
        }
        const answer = await response.json();
        if (!response.ok) throw new Error(answer.message ?? `the server answered ${response.status}`);
        this.#say("");
        return answer;
    }

    #say(text) {
        byId("connection").textContent = text;
        byId("connection").hidden = !text;
    }

    // ---- the scenario file ----

    /** Return the scenario file with the present values; its comments stay. */
    async text() {
        const { fields, base = {}, text = "" } = this.page.state, changes = {};
        for (const key of new Set([...Object.keys(base), ...Object.keys(fields)])) {
            if (JSON.stringify(base[key]) === JSON.stringify(fields[key])) continue;
            changes[key] = fields[key] ?? null;
        }
        if (!Object.keys(changes).length) return text;
        return (await this.ask("change", { text, changes })).text;
    }

    /** Show the values of a scenario file. */
    async open(text, file = null, disk = undefined) {
        const { fields, fixed, notes } = await this.ask("describe", { text });
        this.page.load(fields, fixed, file, { text, base: { ...fields }, disk }); // a copy: edits change the fields
        this.#say(notes.join(". "));
    }

    /** Show the file as it is now. */
    async reload() {
        try {
            const { text } = await this.ask("reload", {});
            this.server.text = text;
            byId("conflict").hidden = true;
            await this.open(text, this.server.file, text);
        } catch (error) {
            this.#say(error.message);
        }
    }

    /** Save, unless another program or tab has changed the file since this page read it. */
    async #save({ overwrite = false } = {}) {
        try {
            const text = await this.text(), known = overwrite ? null : (this.page.state.disk ?? this.server.text);
            const { saved, changed } = await this.ask("save", { text, known });
            byId("conflict").hidden = changed === undefined;
            if (changed !== undefined) {
                byId("conflict-text").textContent = `${this.server.file} was changed outside of this page, so nothing was saved. Overwrite it with the values of this page, or show the file; Undo then returns to the values of this page.`;
                return;
            }
            this.server.text = text;
            this.page.change((state) => Object.assign(state, { text, base: { ...state.fields }, disk: text }), { commit: false });
            this.page.commit();
            byId("save").textContent = `Saved ${saved}`;
            setTimeout(() => (byId("save").textContent = "Save"), 2000);
        } catch (error) {
            this.#say(error.message);
        }
    }

    /** Let Python check the scenario, and describe the curve that the page does not compute. */
    #committed() {
        const { page } = this;
        if (page.overlay) {
            page.overlay = null; // it belongs to the values before
            page.request();
        }
        page.reservation = null; // it belongs to the values before, too
        clearTimeout(this.checking);
        this.checking = setTimeout(async () => {
            try {
                const text = await this.text();
                if (!text) return;
                if (text !== this.checked) {
                    this.checked = text;
                    const { fixed, notes } = await this.ask("describe", { text });
                    page.state.fixed = fixed;
                    page.signature = null;
                    page.update();
                    this.#say(notes.join(". "));
                }
                await this.#reserve(text);
            } catch (error) {
                this.#say(error.message);
            }
        }, 300);
    }

    /** Show which contact speeds the readings of the calibration allow, for the present gain. */
    async #reserve(text) {
        const { page } = this, { gain } = page.solved ?? {};
        if (!page.state.fields["sensor.calibration"] || gain === undefined || document.body.classList.contains("stale")) return;
        const { headline, spread } = await this.ask("reservations", { text, gain });
        if (page.solved.gain !== gain) return; // the answer is late; another one follows
        page.reservation = { gain, headline, spread };
        page.request();
    }

    // ---- calibration ----

    #charts() {
        const x = { label: "distance [mm]" }, points = { color: "--now", points: true };
        this.readings = new Chart(byId("readings"), {
            x, y: [{ key: "y", label: "reading" }], marks: () => this.#windowMarks(),
            lines: [{ ...points, label: "readings" }, { label: "fit", color: "--free" }, { label: "offset", color: "--pin-1", dash: [4, 4] }],
            onDrag: (mm) => this.#dragWindow(mm / 1e3), onDragEnd: () => (this.end = null),
        });
        this.residuals = new Chart(byId("residuals"), { x, y: [{ key: "r", label: "residual [%]" }], lines: [{ ...points, label: "residuals" }], height: 140 });
        const cloud = { label: "encounters", color: "--now", points: true };
        this.cloud = new Chart(byId("cloud-chart"), { x: { label: "largest excursion [mm]" }, y: [{ key: "v", label: "contact speed [m/s]" }], lines: [cloud] });
    }

    async #calibrate(file) {
        byId("csv-mistake").textContent = "";
        byId("fit").hidden = true;
        if (!file) return;
        if (file.size > this.server.limit) {
            byId("csv-mistake").textContent = `The file has ${(file.size / 1e6).toFixed(0)} MB; at most ${this.server.limit / 1e6} MB are read. Average repeated readings first.`;
            return;
        }
        try {
            this.data = await this.ask("calibration", null, { raw: file, headers: { "X-Name": encodeURIComponent(file.name) } });
        } catch (error) {
            byId("csv-mistake").textContent = error.message;
            return;
        }
        const { distances } = this.data, low = Math.min(...distances), high = Math.max(...distances);
        for (const id of ["near", "far"]) Object.assign(byId(id), { min: low, max: high });
        byId("fit").hidden = false;
        this.automatic = true;
        this.#showFit(this.data.fit);
    }

    #windowMarks() {
        const fit = this.window;
        return fit ? { vertical: fit.map((end) => ({ value: 1e3 * end, label: "", color: "--ink", handle: true })) } : {};
    }

    #dragWindow(l) {
        if (!this.window) return;
        this.end ??= Math.abs(l - this.window[0]) < Math.abs(l - this.window[1]) ? 0 : 1;
        const ends = [...this.window];
        ends[this.end] = l;
        this.#refit(ends);
    }

    /** Fit inside another window; while a fit runs, only the last wish is kept. */
    async #refit(ends) {
        this.window = ends[0] < ends[1] ? ends : [ends[1], ends[0]];
        this.automatic = false;
        [byId("near").value, byId("far").value] = this.window;
        this.readings.refresh();
        this.wanted = this.window;
        if (this.fitting) return;
        this.fitting = true;
        try {
            while (this.wanted) {
                const window = this.wanted;
                this.wanted = null;
                try {
                    const fit = await this.ask("fit", { name: this.data.name, window });
                    this.#showFit(fit, this.window);
                } catch (error) {
                    byId("fit-text").textContent = error.message;
                }
            }
        } finally {
            this.fitting = false;
        }
    }

    #showFit(fit, window = fit.window) {
        this.fit = fit;
        this.window = window ?? [Number(byId("near").min), Number(byId("far").max)];
        [byId("near").value, byId("far").value] = this.window;
        byId("window").textContent = this.window.map((l) => formatQuantity(l, "m", 3)).join(" to ");
        byId("use").disabled = !fit.model;
        const { distances, outputs, unit } = this.data, order = distances.map((l, i) => i).sort((a, b) => distances[a] - distances[b]);
        if (!fit.model) {
            byId("fit-text").textContent = `${fit.verdict}: ${fit.reasons.join("; ")}`;
            return;
        }
        const { slope, offset } = fit;
        byId("fit-text").textContent = `${fit.model} fits best (${fit.verdict}): slope g = ${formatQuantity(slope.value, "1/m")} (95 %: ${formatQuantity(slope.low, "1/m")} to ${formatQuantity(slope.high, "1/m")}), offset ${Number(offset.value.toPrecision(4))} ${unit} (${offset.kind}), residual ${(100 * fit.rmse).toPrecision(2)} % RMS.`;
        const [x, y] = fit.curve, at = [...order.map((i) => [distances[i], outputs[i], null]), ...x.map((l, i) => [l, null, y[i]])].sort((a, b) => a[0] - b[0]);
        const drawn = (j) => at.map((row, i) => row[j] ?? (j === 2 ? interpolated(x, y, at[i][0]) : null));
        this.readings.show([at.map((row) => 1e3 * row[0]), drawn(1), drawn(2), at.map(() => offset.value)]);
        const [l, r] = fit.residuals, sorted = l.map((_, i) => i).sort((a, b) => l[a] - l[b]);
        this.residuals.show([sorted.map((i) => 1e3 * l[i]), sorted.map((i) => 100 * r[i])]);
    }

    /** Use the fitted curve in the scenario: the file itself, or for another window the parameters. */
    #use() {
        const { fit, data, automatic } = this, curve = automatic ? { "sensor.calibration": data.name } : { ...fit.fields };
        if (automatic) curve["sensor.recess"] = `${(1e3 * fit.starts_at).toPrecision(4)} mm`;
        else {
            const recess = this.window[0];
            curve["sensor.recess"] = `${Number((1e3 * recess).toPrecision(4))} mm`;
            curve["sensor.maximum_distance"] = `${Number((1e3 * (this.fit.window[1] - recess)).toPrecision(4))} mm`;
        }
        const kept = Object.entries(this.page.state.fields).filter(([key]) => !key.startsWith("sensor."));
        const fields = { ...curve, ...Object.fromEntries(kept) };
        const { text, base, disk, file } = this.page.state;
        const model = fit.model, parameters = Object.fromEntries(Object.entries(fit.fields).map(([key, value]) => [key.slice(7), parseFloat(value)]));
        const sensor = { ...parameters, model, recess: parseFloat(curve["sensor.recess"]) / 1e3, maximum_distance: fit.window[1] - parseFloat(curve["sensor.recess"]) / 1e3 };
        this.page.load(fields, automatic ? { sensor } : {}, file);
        Object.assign(this.page.state, { text, base, disk });
        this.page.commit();
    }

    // ---- noise, uncertainty and evidence ----

    async #with(button, work) {
        byId("loop-mistake").textContent = "";
        button.disabled = true;
        try {
            await work(await this.text());
        } catch (error) {
            byId("loop-mistake").textContent = error.message;
        } finally {
            button.disabled = false;
        }
    }

    async #simulate(text) {
        const { page } = this, gain = page.solved.gain;
        this.seed = (this.seed ?? 0) + 1;
        const run = await this.ask("simulate", { text, gain, seed: this.seed });
        const contact = { ...page.solved.contact, time: run.time[run.time.length - 1] };
        page.overlay = [{
            words: "simulated with noise", law: page.problem.law, gain, contact, problem: page.problem, color: "--pin-3", dash: [1, 2],
            motion: (times) => Object.fromEntries(["distance", "relative_velocity", "displacement", "virtual_force"].map((name) => [name, times.map((t) => interpolated(run.time, run[name], t))])),
        }];
        page.update();
        this.#show(`${run.headline}\n${run.warnings.join("\n")}`);
    }

    async #cloudOf(text) {
        const { page } = this, { speed, excursion, shares, count } = await this.ask("cloud", { text, gain: page.solved.gain });
        const order = speed.map((_, i) => i).filter((i) => speed[i] !== null).sort((a, b) => excursion[a] - excursion[b]);
        byId("cloud-figure").hidden = false;
        byId("cloud-text").textContent = `${count} encounters with random inputs: ${Object.entries(shares).map(([name, share]) => `${name.replaceAll("_", " ")} ${name === "contact" ? "" : "limit met "}in ${(100 * share).toFixed(1)} %`).join(", ")}.`;
        this.cloud.show([order.map((i) => 1e3 * excursion[i]), order.map((i) => speed[i])]);
    }

    async #job(verb, text) {
        const drag = this.page.problem.law === "drag", gain = drag || ["pareto", "sweep"].includes(verb) ? null : this.page.solved.gain;
        const { job } = await this.ask("jobs", { verb, text, gain });
        this.#follow(job);
    }

    /** Show a computation and its progress until it ends. */
    async #follow(name) {
        const item = make("li"), words = make("span"), cancel = make("button", { type: "button", textContent: "Cancel" }), bar = make("progress");
        bar.setAttribute("aria-label", "running");
        item.append(words, " ", bar, " ", cancel);
        byId("jobs").prepend(item);
        this.jobs.set(name, item);
        this.#storeJobs();
        cancel.addEventListener("click", () => this.ask(`jobs/${name}`, undefined, { method: "DELETE" }).catch(() => {}));
        for (;;) {
            let job;
            try {
                job = await this.ask(`jobs/${name}`, undefined, { method: "GET" });
            } catch (error) {
                item.remove();
                this.jobs.delete(name);
                this.#storeJobs();
                if (!byId("loop-mistake").textContent) byId("loop-mistake").textContent = error.message;
                return;
            }
            words.textContent = `${job.verb}: ${job.state === "running" ? job.progress : job.state}`;
            if (job.state !== "running") {
                bar.remove();
                cancel.remove();
                this.#finished(name, item, job);
                return;
            }
            await new Promise((go) => setTimeout(go, POLL));
        }
    }

    #finished(name, item, job) {
        if (job.state === "failed") byId("loop-mistake").textContent = job.message;
        if (job.state !== "done") return;
        item.firstChild.textContent = `${job.verb}: ${job.headline}`;
        const button = (words, run) => {
            const one = make("button", { type: "button", textContent: words });
            one.addEventListener("click", run);
            item.append(" ", one);
        };
        button("All numbers", () => this.#show(job.text));
        const file = async (part, as) => this.page.download(await this.ask(`jobs/${name}/${part}`, undefined, { method: "GET" }), as);
        if (job.files["report.html"]) button("Report", () => file("report.html", `${job.verb}.html`));
        if (job.files["export.zip"]) button("Files", () => file("export.zip", "law.zip"));
    }

    #storeJobs() {
        sessionStorage.setItem("pretouch:jobs", JSON.stringify([...this.jobs.keys()]));
    }

    #show(text) {
        byId("job-text").hidden = false;
        byId("job-text").textContent = text;
    }

    // ---- controls ----

    #controls() {
        byId("open").addEventListener("change", async (event) => {
            const [file] = event.target.files;
            event.target.value = "";
            if (!file) return;
            try {
                if (file.size > 1e6) throw new Error(`The file has ${(file.size / 1e6).toFixed(0)} MB; a scenario file has at most 1 MB.`);
                await this.open(await file.text(), null);
            } catch (error) {
                this.#say(error.message);
            }
        });
        byId("save").addEventListener("click", () => this.#save());
        byId("overwrite").addEventListener("click", () => this.#save({ overwrite: true }));
        byId("take").addEventListener("click", () => this.reload());
        byId("reload").addEventListener("click", () => this.reload());
        byId("csv").addEventListener("change", (event) => {
            this.#calibrate(event.target.files[0]);
            event.target.value = "";
        });
        const drop = byId("drop");
        drop.addEventListener("dragover", (event) => {
            event.preventDefault();
            drop.classList.add("over");
        });
        drop.addEventListener("dragleave", () => drop.classList.remove("over"));
        drop.addEventListener("drop", (event) => {
            event.preventDefault();
            drop.classList.remove("over");
            this.#calibrate(event.dataTransfer.files[0]);
        });
        for (const id of ["near", "far"]) byId(id).addEventListener("input", () => this.#refit([Number(byId("near").value), Number(byId("far").value)]));
        byId("whole").addEventListener("click", async () => {
            this.automatic = true;
            this.#showFit(await this.ask("fit", { name: this.data.name, window: null }));
        });
        byId("use").addEventListener("click", () => this.#use());
        const press = (id, work) => byId(id).addEventListener("click", (event) => this.#with(event.currentTarget, work));
        press("simulate", (text) => this.#simulate(text));
        press("cloud", (text) => this.#cloudOf(text));
        for (const verb of ["verify", "pareto", "sweep", "export"]) press(verb, (text) => this.#job(verb, text));
    }
}

/** Return a value between given points, null outside. */
function interpolated(x, y, at) {
    if (!(at >= x[0] && at <= x[x.length - 1])) return null;
    let low = 0, high = x.length - 1;
    while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (x[middle] <= at) low = middle;
        else high = middle;
    }
    const share = (at - x[low]) / (x[high] - x[low] || 1);
    return y[low] + share * (y[high] - y[low]);
}
