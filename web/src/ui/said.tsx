import { said } from "../state/messages";

/** A message of the service, in the language of the page. */
export function Said({ of }: { of: string }) {
  const { text, lang } = said(of);
  return <span lang={lang}>{text}</span>;
}
