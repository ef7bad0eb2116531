import { dialog, h } from "../elements";

/** Asks a question and waits for the button that is pressed; null if the question is closed. */
export function ask<Choice extends string>(heading: string, question: string, choices: Record<Choice, string>): Promise<Choice | null> {
  return new Promise((resolve) => {
    let chosen: Choice | null = null;
    const choose = (choice: Choice) => (): void => {
      chosen = choice;
      box.close();
      box.remove(); // The close event comes a moment later; until then another question may open.
    };
    const buttons = (Object.keys(choices) as Choice[]).map((choice) =>
      h("button", { type: "button", testid: `answer-${choice}`, onclick: choose(choice) }, choices[choice]),
    );
    const box = dialog("question", heading, h("p", {}, question), h("div", { class: "row" }, ...buttons));
    box.addEventListener("close", () => {
      box.remove();
      resolve(chosen);
    });
    box.showModal();
  });
}
