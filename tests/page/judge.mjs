// Judge scenarios as the page does: node judge.mjs CORE FOLDER < { units, requests } > results
import fs from "node:fs";
import { pathToFileURL } from "node:url";

const [, , bytes, folder] = process.argv;
const { loadCore } = await import(pathToFileURL(`${folder}/core.js`).href);
const { conclusionOf, problemOf, setUnits, solveProblem, tomlOf } = await import(pathToFileURL(`${folder}/model.js`).href);
const core = await loadCore(fs.readFileSync(bytes));
const { units, requests } = JSON.parse(fs.readFileSync(0, "utf-8"));
setUnits(units);
const results = requests.map((fields) => {
    const problem = problemOf(fields), toml = tomlOf(fields);
    if (!problem.encounter) return { toml, mistakes: problem.mistakes };
    const solved = solveProblem(core, problem);
    return { toml, mistakes: {}, conclusion: conclusionOf(core, problem, solved), contact: solved.contact.status, gain: solved.gain };
});
process.stdout.write(JSON.stringify(results));
