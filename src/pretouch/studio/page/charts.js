/* global uPlot */
// Draw line charts with uPlot in the colors of the page, with marks that can be dragged.


const colors = new Map(); // reading a computed style in every frame takes longer than drawing

/** Return the value of a CSS variable; a canvas resolves neither var() nor light-dark(). */
export function color(element, name) {
    if (!colors.has(name)) colors.set(name, getComputedStyle(element).getPropertyValue(name).trim());
    return colors.get(name);
}

/** Call a function when the page changes between light and dark, by the system or by the theme of a documentation. */
export function watchColors(draw) {
    const changed = () => {
        colors.clear();
        draw();
    };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
    new MutationObserver(changed).observe(document.body, { attributes: true, attributeFilter: ["data-theme"] });
}

/** Write the key of some lines into a list. */
export function writeKey(list, lines) {
    const text = JSON.stringify(lines);
    if (list.dataset.lines === text) return;
    list.dataset.lines = text;
    list.replaceChildren(...lines.map(({ label, color: name, dash }) => {
        const item = document.createElement("li");
        item.textContent = label;
        item.style.setProperty("--color", `var(${name})`);
        item.style.setProperty("--dash", dash ? "dashed" : "solid");
        return item;
    }));
}

/** A chart in an element.
 *
 * @param element: where it is drawn; its width is that of the chart.
 * @param x: { label, format, ticks(min, max) } of the horizontal axis.
 * @param y: a list of { label, key } of the vertical axes, the second one on the right.
 * @param lines: a list of { label, color, axis, dash, width }.
 * @param onDrag: called with the horizontal value while the pointer is pressed in the chart. */
export class Chart {
    constructor(element, { x, y, lines, height = 220, onDrag = null, onDragEnd = null, marks = () => ({}) }) {
        Object.assign(this, { element, options: { x, y, lines, height }, onDrag, onDragEnd, marks, data: null });
        this.sizes = new ResizeObserver(() => this.#resize());
        this.sizes.observe(element);
        // a chart outside the window is drawn when it comes into view: a drag draws only what is seen
        this.seen = true;
        new IntersectionObserver(([entry]) => {
            this.seen = entry.isIntersecting;
            if (this.seen && this.late) this.show(...this.late);
        }, { rootMargin: "100px" }).observe(element);
        watchColors(() => this.#make());
    }

    /** Show data in uPlot's form, [x, y, y, ...]; lines may change their number. */
    show(data, lines = this.options.lines) {
        this.late = this.seen || !this.plot ? null : [data, lines];
        if (this.late) return;
        this.data = data;
        const same = this.plot && lines.length === this.options.lines.length && lines.every((line, i) => line.label === this.options.lines[i].label);
        this.options.lines = lines;
        if (same) this.plot.setData(data);
        else this.#make();
    }

    /** Draw again, because a mark has moved. */
    refresh() {
        this.plot?.redraw(false);
    }

    #resize() {
        const width = this.element.clientWidth;
        if (this.plot && width && Math.abs(width - this.plot.width) > 0) this.plot.setSize({ width, height: this.options.height });
        else if (!this.plot && this.data) this.#make();
    }

    #make() {
        this.plot?.destroy();
        this.plot = null;
        if (!this.data || !this.element.clientWidth) return;
        const { x, y, lines, height } = this.options, paint = (name) => color(this.element, name);
        const font = "12px system-ui, sans-serif", ink = paint("--quiet"), grid = { stroke: paint("--grid"), width: 1 };
        const axis = { stroke: ink, grid, ticks: { ...grid, size: 4 }, font, labelFont: font, labelSize: 18, gap: 3 };
        const values = (format) => (u, ticks) => ticks.map((tick) => format(tick));
        this.plot = new uPlot(
            {
                width: this.element.clientWidth, height, pxAlign: 0, legend: { show: false }, padding: [8, y.length > 1 ? 0 : 12, 0, 0],
                cursor: { drag: { setScale: false, x: false, y: false }, points: { size: 6 }, y: false },
                scales: { x: { time: false }, ...Object.fromEntries(y.map(({ key, range }) => [key, range ? { range } : {}])) },
                series: [
                    { label: x.label },
                    ...lines.map((line) => ({
                        label: line.label, scale: line.axis ?? y[0].key, stroke: paint(line.color), width: line.width ?? 2,
                        dash: line.dash, spanGaps: false, ...(line.points ? { paths: () => null } : {}),
                        points: line.points ? { show: true, size: 5, fill: paint(line.color), stroke: paint(line.color) } : { show: false },
                    })),
                ],
                axes: [
                    { ...axis, label: x.label, size: 28, space: 56, ...(x.ticks ? { splits: (u, i, low, high) => x.ticks(low, high, u.bbox.width / devicePixelRatio) } : {}), ...(x.format ? { values: values(x.format) } : {}) },
                    ...y.map(({ label, key, format }, i) => ({
                        ...axis, label, scale: key, side: i ? 1 : 3, size: 44, grid: i ? { show: false } : grid,
                        ...(format ? { values: values(format) } : {}),
                    })),
                ],
                hooks: { draw: [(u) => this.#drawMarks(u)] },
            },
            this.data, this.element,
        );
        if (this.onDrag) this.#listen(this.plot.over);
    }

    /** Draw vertical lines and limits over the curves. */
    #drawMarks(u) {
        const { vertical = [], horizontal = [], shade = [] } = this.marks(), { ctx, bbox } = u, pixels = devicePixelRatio;
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        ctx.font = `${12 * pixels}px system-ui, sans-serif`;
        for (const [from, to] of shade) {
            const a = u.valToPos(from, "x", true), b = u.valToPos(to, "x", true);
            ctx.fillStyle = color(this.element, "--shade");
            ctx.fillRect(Math.min(a, b), bbox.top, Math.abs(b - a), bbox.height);
        }
        const heights = horizontal.map(({ value, axis }) => u.valToPos(value, axis, true));
        horizontal.forEach(({ color: name }, i) => this.#line(ctx, [bbox.left, heights[i], bbox.left + bbox.width, heights[i]], name, [5, 4]));
        this.labels = labelsOfLines(heights, { size: 12 * pixels, gap: 5 * pixels, top: bbox.top, bottom: bbox.top + bbox.height });
        horizontal.forEach(({ label, color: name, right }, i) => {
            ctx.fillStyle = color(this.element, name);
            this.#write(ctx, label, right ? bbox.left + bbox.width - 6 * pixels : bbox.left + 6 * pixels, this.labels[i].bottom, right);
        });
        for (const { value, label, color: name, handle } of vertical) {
            const at = u.valToPos(value, "x", true);
            this.#line(ctx, [at, bbox.top, at, bbox.top + bbox.height], name, handle ? [] : [2, 3]);
            const right = at > bbox.left + 0.7 * bbox.width;
            this.#write(ctx, label, at + (right ? -8 : 8) * pixels, bbox.top + (handle ? 14 : 30) * pixels, right);
            if (handle) {
                ctx.beginPath();
                ctx.arc(at, bbox.top + bbox.height / 2, 6 * pixels, 0, 7);
                ctx.fill();
            }
        }
        ctx.restore();
    }

    /** Write a text on a ground in the color of the page, so that no curve crosses it. */
    #write(ctx, text, x, y, right) {
        ctx.textAlign = right ? "right" : "left";
        Object.assign(ctx, { strokeStyle: color(this.element, "--paper"), lineWidth: 4 * devicePixelRatio, lineJoin: "round" });
        ctx.strokeText(text, x, y);
        ctx.fillText(text, x, y);
        ctx.textAlign = "left";
    }

    #line(ctx, [x0, y0, x1, y1], name, dash) {
        ctx.strokeStyle = ctx.fillStyle = color(this.element, name);
        ctx.lineWidth = 1.5 * devicePixelRatio;
        ctx.setLineDash(dash.map((d) => d * devicePixelRatio));
        ctx.beginPath();
        ctx.moveTo(x0, y0);
        ctx.lineTo(x1, y1);
        ctx.stroke();
        ctx.setLineDash([]);
    }

    #listen(over) {
        over.style.cursor = "ew-resize";
        over.style.touchAction = "pan-y";
        const at = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
        over.addEventListener("pointerdown", (event) => {
            over.setPointerCapture(event.pointerId);
            this.dragged = true;
            this.onDrag(at(event), event);
        });
        over.addEventListener("pointermove", (event) => this.dragged && this.onDrag(at(event), event));
        for (const name of ["pointerup", "pointercancel"]) {
            over.addEventListener(name, () => {
                if (this.dragged) this.onDragEnd?.();
                this.dragged = false;
            });
        }
    }
}

/** Return where the labels of horizontal lines are: above their line, or below it if another line or the edge is there.
 *
 * Each label has a top and a bottom; all heights are pixels that grow downward. */
export function labelsOfLines(heights, { size, gap, top, bottom }) {
    return heights.map((at, i) => {
        const above = { top: at - gap - size, bottom: at - gap }, below = { top: at + gap, bottom: at + gap + size };
        const isFree = (place) => place.top >= top && place.bottom <= bottom && heights.every((other, k) => k === i || other < place.top - 1 || other > place.bottom + 1);
        return [above, below].find(isFree) ?? above;
    });
}

/** Return ticks 1, 2, 5 of gains between two coordinates of a gainAxis, so that at most a number of them are drawn. */
export function gainTicks(axis, low, high, most) {
    const ticks = [];
    for (let power = -6; power <= 4; power++) for (const step of [1, 2, 5]) ticks.push(-step * 10 ** power, step * 10 ** power);
    const inside = [...new Set([0, ...ticks])].map((gain) => [gain, axis.coordinate(gain)]).filter(([, u]) => u >= low && u <= high);
    const sorted = inside.sort((a, b) => a[1] - b[1]), space = (high - low) / Math.max(most, 2), kept = [];
    for (const [gain, u] of sorted) if (!kept.length || u - kept[kept.length - 1][1] >= space) kept.push([gain, u]);
    return kept.map(([, u]) => u);
}
