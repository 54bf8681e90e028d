import { html, type TemplateResult } from 'lit-html';

/** A file's name that may break where its words end, rather than anywhere. */
export function broken(name: string): TemplateResult {
  return html`${name.split(/(?<=[_.-])(?=[^_.-])/).map((part) => html`${part}<wbr />`)}`;
}
