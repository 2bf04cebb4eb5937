// Start the page with the data that the document contains: the compiled core, the units, and the server, if any.

import { Page } from "./app.js";
import { unpackCore } from "./core.js";
import { parseQuantity, setUnits } from "./model.js";

/** Start the page; `connect` of server.js connects it with its server, which a page from a file does not have. */
export async function start(data, connect = null) {
    setUnits(data.units);
    const core = await unpackCore(data.core), { server, scenario } = data;
    const page = server ? new Page(core, { key: `pretouch:${server.name}`, name: server.title })
        : scenario ? new Page(core, { key: `pretouch:${scenario.key}`, name: scenario.title, fields: scenario.fields })
        : new Page(core, { name: "Try it" });
    if (scenario) document.getElementById("static-note").prepend(`${scenario.note} `);
    if (connect) await connect(page, server);
    globalThis.pretouch = Object.assign(page, { parse: parseQuantity }); // for the console of the browser
    document.documentElement.dataset.ready = "true";
}
