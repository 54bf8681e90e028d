import { html, nothing, type TemplateResult } from 'lit-html';
import { columnsOf, valuesOf, type Column } from '../core/matrix';
import { fieldsOf, type FormField } from '../core/schema';
import type { Context } from './context';

export const MOST_RUNS = 200;

/** In which ways several meshes are run: one preset or several, and values of one parameter if one is to be varied. */
export class BatchForm {
  private readonly chosen = new Set<string>();
  private begun = false; // with the service's own preset, which may be taken away
  private varied: FormField | null = null;
  private values = '';

  constructor(private readonly context: Context) {}

  /** What every mesh is run with, a column of the matrix each. */
  get columns(): readonly Column[] {
    const { presets, parameters } = this.context.catalogue;
    const offered = presets
      .filter(({ name }) => this.chosen.has(name))
      .map(({ name, title }) => ({ name, title, defaults: parameters?.defaults[name] ?? {} }));
    return columnsOf(offered, this.varied, valuesOf(this.values));
  }

  /** @param meshes how many there are to be run; with `judging`, there may be more of them. */
  render(meshes: number, judging: boolean, submit: () => void): TemplateResult {
    const { info } = this.context.catalogue;
    if (!this.begun && info) this.chosen.add(info.default_preset);
    this.begun ||= info !== null;
    const runs = meshes * this.columns.length;
    return html`<form
      class="card ways"
      aria-label="Run"
      @submit=${(event: Event) => {
        event.preventDefault();
        submit();
      }}
    >
      ${this.presets()} ${this.variation()}
      <div class="actions">
        <button class="primary" type="submit" ?disabled=${runs === 0 || runs > MOST_RUNS || judging}>
          ${runs === 1 ? 'Run it' : `Run all ${runs}`}
        </button>
        <p class="hint">
          ${this.columns.length > 1 ? `${meshes} × ${this.columns.length} runs, each mesh in each way.` : nothing}
          ${runs > MOST_RUNS ? `At most ${MOST_RUNS} at once.` : nothing}
        </p>
      </div>
    </form>`;
  }

  private presets(): TemplateResult {
    return html`<fieldset class="choices">
      <legend class="label">Presets</legend>
      ${this.context.catalogue.presets.map(
        ({ name, title }) =>
          html`<label>
            <input
              type="checkbox"
              .checked=${this.chosen.has(name)}
              @change=${(event: Event) => {
                if ((event.target as HTMLInputElement).checked) this.chosen.add(name);
                else this.chosen.delete(name);
                this.context.refresh();
              }}
            />
            ${title}
          </label>`,
      )}
    </fieldset>`;
  }

  /** A parameter with several values, for those who want to know what it does. */
  private variation(): TemplateResult {
    const { parameters } = this.context.catalogue;
    const several = fieldsOf(parameters?.schema ?? {}).filter(
      ({ kind, name }) => (kind === 'number' || kind === 'choice') && name !== 'method',
    );
    const { varied } = this;
    return html`<div class="varied">
      <label class="label" for="varied">Vary</label>
      <select
        id="varied"
        @change=${(event: Event) => {
          const { value } = event.target as HTMLSelectElement;
          this.varied = several.find(({ name }) => name === value) ?? null;
          this.values = '';
          this.context.refresh();
        }}
      >
        <option value="" ?selected=${varied === null}>Nothing</option>
        ${several.map(({ name, title }) => html`<option value=${name} ?selected=${name === varied?.name}>${title}</option>`)}
      </select>
      ${
        varied === null
          ? nothing
          : html`<input
              aria-label="Values, separated by commas"
              placeholder=${varied.kind === 'choice' ? varied.choices.join(', ') : '0.02, 0.05, 0.1'}
              .value=${this.values}
              @input=${(event: Event) => {
                this.values = (event.target as HTMLInputElement).value;
                this.context.refresh();
              }}
            />`
      }
    </div>`;
  }
}
