// Solve requests with the core of the page: node solve.mjs CORE MODULE < requests.json > results.json
import fs from "node:fs";
import { performance } from "node:perf_hooks";
import { pathToFileURL } from "node:url";

const [, , bytes, module] = process.argv;
const { loadCore, sensorCurve } = await import(pathToFileURL(module).href);
const core = await loadCore(fs.readFileSync(bytes));

// JSON has no infinities
const restore = (key, value) => (value === "inf" ? Infinity : value === "-inf" ? -Infinity : value);
const keep = (key, value) =>
    typeof value === "number" && !Number.isFinite(value) ? String(value) : value;

const results = JSON.parse(fs.readFileSync(0, "utf-8"), restore).map(({ kind, encounter, sensor, ...more }) => {
    const curve = sensorCurve(sensor);
    if (kind === "contact") return core.solve(encounter, curve, more.gains, more.horizon);
    if (kind === "trace") return core.trace(encounter, curve, more.gain, more.horizon, more.times);
    if (kind === "design") return core.design(encounter, curve, more);
    if (kind === "drag") {
        const phi = core.dragOfRatio(encounter, curve, more.ratio);
        const motion = core.traceDrag(encounter, curve, phi, more.horizon, more.times);
        return { ...core.drag(encounter, curve, [phi], more.horizon)[0], motion };
    }
    if (kind === "time") {
        const seconds = [];
        for (let k = 0; k < more.repeats; k++) {
            const start = performance.now();
            if (more.gains) core.solve(encounter, curve, more.gains, more.horizon);
            else core.design(encounter, curve, more);
            seconds.push((performance.now() - start) / 1e3);
        }
        return seconds;
    }
    throw new Error(`unknown request ${kind}`);
});
process.stdout.write(JSON.stringify(results, keep));
