// The panels that show results: most of the code, loaded after the first view.
export { createLedger } from "./ledger";
export { createPlayer } from "./player";
export { createPlots } from "./plots";
export { createProgram } from "./program";
export { createScene } from "../views/scene";
export { createBadge, createVerdict } from "./verdict";
