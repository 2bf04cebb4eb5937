// Start the page with the data that the document contains: the compiled core, the units, and the server, if any.

import { Page } from "./app.js";
import { unpackCore } from "./core.js";
import { setUnits } from "./model.js";
import { connect } from "./server.js";

/** Start the page. */
export async function start(data) {
    setUnits(data.units);
    const core = await unpackCore(data.core), { server } = data;
    const page = server ? new Page(core, { key: `pretouch:${server.name}`, name: server.title }) : new Page(core, { name: "Try it" });
    if (server) await connect(page, server);
    document.documentElement.dataset.ready = "true";
    return page;
}
