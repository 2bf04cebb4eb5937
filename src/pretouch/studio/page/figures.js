// Mount all live figures of a document: elements with the attribute data-pretouch-figure.

import { unpackCore } from "./core.js";
import { mountFigure } from "./live.js";
import { setUnits } from "./model.js";

/** Mount the figures of a document, with the compiled core and the units. */
export async function start(data) {
    setUnits(data.units);
    const elements = document.querySelectorAll("[data-pretouch-figure]");
    if (!elements.length) return;
    const core = await unpackCore(data.core);
    for (const element of elements) mountFigure(core, element);
}
