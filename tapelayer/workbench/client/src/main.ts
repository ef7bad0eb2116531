import "./tokens.css";
import "./style.css";
import { setLanguage, currentLanguage, t } from "./i18n";

setLanguage(currentLanguage());
document.title = t("page.title");
