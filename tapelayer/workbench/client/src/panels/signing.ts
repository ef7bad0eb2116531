import { onUnauthorized, Refused, signIn, signOut, type Session } from "../data/api";
import { h, modal } from "../elements";
import { problemTitle } from "../i18n";

/** Asks for the token when the server requires one; the promise settles once the page may use the API. */
export async function startSession(asked: Promise<Session>, header: HTMLElement): Promise<void> {
  const token = h("input", { type: "password", id: "token", testid: "token", autocomplete: "current-password", required: true, autofocus: true });
  const wrong = h("p", { class: "fault", role: "alert" });
  const send = h("button", { type: "submit", class: "primary", testid: "sign-in-send", t: "sign-in" });
  const form = h("form", {}, h("label", { for: "token", t: "sign-in.token" }), token, wrong, send);
  const box = modal("sign-in", "sign-in", h("p", { t: "sign-in.about" }), form);
  let entered: Promise<void> | null = null;
  let enter = (): void => {};

  const ask = (): Promise<void> => {
    entered ??= new Promise((resolve) => {
      enter = resolve;
      box.showModal();
    });
    return entered;
  };
  box.addEventListener("close", () => {
    // Without the token the page is of no use, so the dialog stays.
    if (entered) box.showModal();
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    signIn(token.value).then(
      () => {
        entered = null;
        token.value = wrong.textContent = "";
        box.close();
        enter();
      },
      (error: unknown) => {
        if (!(error instanceof Refused)) throw error;
        wrong.textContent = `${problemTitle(error.problem)}: ${error.problem.detail}`;
      },
    );
  });
  onUnauthorized(ask);
  const { token_required, signed_in } = await asked;
  if (!token_required) return;
  const leave = (): void => void signOut().then(() => location.reload());
  header.append(h("button", { type: "button", testid: "sign-out", t: "sign-out", onclick: leave }));
  if (!signed_in) await ask();
}
