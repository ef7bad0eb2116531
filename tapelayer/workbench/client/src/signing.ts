import { onUnauthorized, Refused, signIn, signOut, type Session } from "./api";
import { dialog, h } from "./elements";
import { problemTitle } from "./i18n";

/** Asks for the token where the server wants one; gives whether the page may talk to it already. */
export async function startSession(asked: Promise<Session>, header: HTMLElement): Promise<boolean> {
  const token = h("input", { type: "password", id: "token", testid: "token", autocomplete: "current-password", required: true, autofocus: true });
  const wrong = h("p", { class: "fault", role: "alert" });
  const send = h("button", { type: "submit", class: "primary", testid: "sign-in-send", t: "sign-in" });
  const form = h("form", {}, h("label", { for: "token", t: "sign-in.token" }), token, wrong, send);
  const box = dialog("sign-in", "sign-in", h("p", { t: "sign-in.about" }), form);
  const open = (): void => {
    if (!box.open) box.showModal();
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    signIn(token.value).then(
      // Everything that was refused before is asked for again.
      () => location.reload(),
      (error: unknown) => {
        if (!(error instanceof Refused)) throw error;
        wrong.textContent = `${problemTitle(error.problem)}: ${error.problem.detail}`;
      },
    );
  });
  onUnauthorized(open);
  const { token_required, signed_in } = await asked;
  if (token_required && !signed_in) {
    open();
    return false;
  }
  if (token_required) {
    const leave = (): void => void signOut().then(() => location.reload());
    header.append(h("button", { type: "button", testid: "sign-out", t: "sign-out", onclick: leave }));
  }
  return true;
}
