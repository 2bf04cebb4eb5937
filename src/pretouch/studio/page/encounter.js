// Animate an encounter: the robot, the object, the field of the sensor, the distance and the speed.

import { color, watchColors } from "./charts.js";
import { formatQuantity } from "./model.js";

/** An animation in a canvas, of a run with `time`, `distance`, `displacement` and `relative_velocity`. */
export class Encounter {
    constructor(canvas, onTime = () => {}) {
        Object.assign(this, { canvas, onTime, run: null, now: 0, slow: 10, playing: false, before: null });
        new ResizeObserver(() => this.draw()).observe(canvas);
        watchColors(() => this.draw());
    }

    /** Show a run; slope is g(l) of its sensor, which shapes the field. */
    show(run, slope) {
        this.run = run;
        this.slope = slope;
        this.length = run.time[run.time.length - 1];
        this.now = Math.min(this.now, this.length);
        if (!this.playing) this.draw();
    }

    play() {
        if (this.playing) return;
        if (this.now >= this.length) this.now = 0;
        this.playing = true;
        this.before = null;
        requestAnimationFrame((t) => this.#step(t));
    }

    pause() {
        this.playing = false;
    }

    seek(time) {
        this.now = Math.min(Math.max(time, 0), this.length);
        this.draw();
    }

    #step(t) {
        if (!this.playing) return;
        if (this.before !== null) this.now += (t - this.before) / 1e3 / this.slow;
        this.before = t;
        if (this.now >= this.length) {
            this.now = this.length;
            this.playing = false;
        }
        this.draw();
        requestAnimationFrame((next) => this.#step(next));
    }

    #at(name) {
        const { time } = this.run, values = this.run[name];
        let i = time.findIndex((t) => t >= this.now);
        if (i < 0) i = time.length - 1;
        if (i === 0) return values[0];
        const share = (this.now - time[i - 1]) / (time[i] - time[i - 1] || 1);
        return values[i - 1] + share * (values[i] - values[i - 1]);
    }

    draw() {
        const { canvas, run } = this, width = canvas.clientWidth, height = canvas.clientHeight;
        if (!run || !width) return;
        const pixels = devicePixelRatio, ctx = canvas.getContext("2d"), paint = (name) => color(canvas, name);
        if (canvas.width !== width * pixels) Object.assign(canvas, { width: width * pixels, height: height * pixels });
        ctx.setTransform(pixels, 0, 0, pixels, 0, 0);
        ctx.clearRect(0, 0, width, height);
        const nearest = Math.min(...run.displacement), farthest = Math.max(...run.displacement.map((x, i) => x + run.distance[i]));
        const scale = (width - 150) / Math.max(farthest - nearest, 1e-6), place = (x) => 90 + (x - nearest) * scale;
        const x = this.#at("displacement"), l = Math.max(this.#at("distance"), 0), speed = this.#at("relative_velocity");
        const surface = place(x), object = place(x + l), middle = height / 2 - 8;
        // the field: its brightness falls with the distance as the output of the sensor does
        const reach = place(farthest) - surface, gradient = ctx.createLinearGradient(surface, 0, surface + reach, 0);
        for (let i = 0, level = 0; i <= 12; i++) {
            const at = ((farthest - nearest) * i) / 12;
            gradient.addColorStop(i / 12, paint("--field") + Math.round(150 * Math.exp(Math.max(level, -6))).toString(16).padStart(2, "0"));
            level += (this.slope(Math.min(at, farthest - nearest)) * (farthest - nearest)) / 12;
        }
        ctx.fillStyle = gradient;
        ctx.beginPath();
        ctx.moveTo(surface, middle - 5);
        ctx.lineTo(surface + reach, middle - 34);
        ctx.lineTo(surface + reach, middle + 34);
        ctx.lineTo(surface, middle + 5);
        ctx.fill();
        // reference of the robot, the robot, and the object
        ctx.strokeStyle = paint("--grid");
        ctx.setLineDash([3, 3]);
        ctx.beginPath();
        ctx.moveTo(place(0), 8);
        ctx.lineTo(place(0), height - 30);
        ctx.stroke();
        ctx.setLineDash([]);
        ctx.fillStyle = paint("--robot");
        ctx.beginPath();
        ctx.roundRect(-20, middle - 12, surface - 8, 24, 6);
        ctx.roundRect(surface - 30, middle - 24, 30, 48, 8);
        ctx.fill();
        ctx.fillStyle = paint("--free");
        ctx.beginPath();
        ctx.arc(object + 26, middle, 26, 0, 7);
        ctx.fill();
        // distance and speed
        const ink = paint("--ink");
        ctx.strokeStyle = ctx.fillStyle = ink;
        ctx.lineWidth = 1.5;
        ctx.beginPath();
        ctx.moveTo(surface, height - 26);
        ctx.lineTo(object, height - 26);
        ctx.stroke();
        ctx.font = "13px system-ui, sans-serif";
        const text = `distance ${formatQuantity(l, "m", 3)}   speed ${formatQuantity(Math.abs(speed), "m/s", 3)}   time ${formatQuantity(this.now, "s", 3)}`;
        ctx.textAlign = "center";
        ctx.fillText(text, width / 2, height - 6);
        this.onTime(this.now);
    }
}
