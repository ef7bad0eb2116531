// What shows results: most of the code, and nothing that a first view waits for.
export { createLedger } from "./ledger";
export { createPlayer } from "./player";
export { createPlots } from "./plots";
export { createProgram } from "./program";
export { createScene } from "../views/scene";
export { createBadge, createVerdict } from "./verdict";
