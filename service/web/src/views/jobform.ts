import { html, nothing, type TemplateResult } from 'lit-html';
import type { JobRequest } from '../api/client';
import { asProblem, type Problem } from '../api/problem';
import type { DryRun, Job, Mesh } from '../api/types';
import { bytes, duration } from '../core/format';
import type { Up } from '../core/route';
import { carried, changes, fieldsOf, type FormField, type Json, type Values } from '../core/schema';
import { curl, python } from '../core/snippets';
import { copy } from '../ui/clipboard';
import { fields, prose, sound } from '../ui/form';
import { icon } from '../ui/icons';
import { problemCard } from '../ui/problem';
import type { Context } from './context';
import { tagsOf } from './up';

const PLANS = [
  ['log:40', 'Forty, more of them early'],
  ['log:12', 'Twelve, more of them early'],
  ['every:10', 'Every 10th'],
  ['every:100', 'Every 100th'],
] as const;

const PAUSE_MS = 400;

/** What shall be done with a mesh: preset, iterations, states to keep, and every parameter, from the schema. */
export class JobForm {
  private preset = '';
  private values: Values = {};
  private plan: string = PLANS[0][0];
  private name: string;
  private problem: Problem | null = null;
  private sending = false;
  private asked = ''; // the request that the estimate is of, or will be
  private estimate: DryRun['estimate'] | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly context: Context,
    private readonly mesh: Mesh,
    file: string,
    private readonly upright: () => Up,
    private readonly started: (job: Job) => void,
  ) {
    this.name = file.replace(/\.\w+$/, '');
  }

  render(): TemplateResult {
    const { catalogue } = this.context;
    if (catalogue.problem) return problemCard(catalogue.problem, () => void catalogue.load());
    if (!catalogue.parameters)
      return html`<section class="card" aria-busy="true">
        <progress aria-label="Loading"></progress>
      </section>`;
    if (this.preset === '') this.choose(catalogue.info?.default_preset ?? '');
    const original = this.original;
    // the preset decides on the method, and the method on what there is to choose
    const all = fieldsOf(catalogue.parameters.schema).filter(
      ({ name }) => name in original && name !== 'method',
    );
    const main = all.filter((field) => field.name === 'iterations');
    const rest = all.filter((field) => field.name !== 'iterations');
    const changed = rest.filter(
      (field) => JSON.stringify(this.values[field.name]) !== JSON.stringify(original[field.name]),
    );
    const draw = (list: readonly FormField[]): TemplateResult[] =>
      fields(list, this.values, original, (values) => {
        this.values = { ...this.values, ...values };
        this.context.refresh();
      });
    if (sound(all, this.values)) this.rehearse();
    return html`<form
      class="card job-form"
      aria-label="Run"
      @submit=${(event: Event) => {
        event.preventDefault();
        void this.submit();
      }}
    >
      ${this.presets()} ${draw(main)} ${this.kept()}
      <details>
        <summary>
          All parameters
          ${changed.length > 0 ? html`<span class="badge">${changed.length} changed</span>` : nothing}
        </summary>
        ${draw(rest)}
      </details>
      ${this.problem ? problemCard(this.problem, null) : nothing}
      <footer>
        ${this.cost()}
        <div class="actions">
          <button class="primary" type="submit" ?disabled=${this.sending || !sound(all, this.values)}>
            ${icon('play')} ${this.sending ? 'Starting …' : 'Run'}
          </button>
          <button class="plain" type="button" @click=${() => void this.copied('curl')}>
            ${icon('copy')} curl
          </button>
          <button class="plain" type="button" @click=${() => void this.copied('Python')}>
            ${icon('copy')} Python
          </button>
        </div>
      </footer>
    </form>`;
  }

  /** What the run takes if it does all its iterations. */
  private cost(): TemplateResult {
    const { estimate } = this;
    return html`<p class="hint cost" aria-live="polite">
      ${
        estimate
          ? `At most about ${duration(estimate.seconds)} of computing and ${bytes(estimate.storage_bytes)} of states; most runs end before.`
          : '\u00a0'
      }
    </p>`;
  }

  /** Ask the service, once one has stopped changing things for a moment. */
  private rehearse(): void {
    const { request } = this;
    const asked = JSON.stringify(request);
    if (asked === this.asked) return;
    this.asked = asked;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      void this.weigh(request, asked);
    }, PAUSE_MS);
  }

  private async weigh(request: JobRequest, asked: string): Promise<void> {
    let estimate: DryRun['estimate'] | null = null;
    try {
      ({ estimate } = await this.context.api.rehearse(request));
    } catch {
      // what is wrong is said when the run is asked for
    }
    if (asked !== this.asked) return;
    this.estimate = estimate;
    this.context.refresh();
  }

  private get original(): Values {
    return this.context.catalogue.parameters?.defaults[this.preset] ?? {};
  }

  private choose(preset: string): void {
    const before = this.original;
    this.preset = preset;
    this.values = carried(this.values, before, this.original); // what was changed by hand stays
  }

  private presets(): TemplateResult {
    return html`<fieldset class="presets">
      <legend class="label">Preset</legend>
      ${this.context.catalogue.presets.map(
        (preset) =>
          html`<label class="preset">
            <input
              type="radio"
              name="preset"
              value=${preset.name}
              .checked=${preset.name === this.preset}
              @change=${() => {
                this.choose(preset.name);
                this.context.refresh();
              }}
            />
            <span
              ><b>${preset.title}</b>
              ${preset.name === this.preset ? html`<span class="hint">${prose(preset.description)}</span>` : nothing}</span
            >
          </label>`,
      )}
    </fieldset>`;
  }

  private kept(): TemplateResult {
    const custom = !PLANS.some(([plan]) => plan === this.plan);
    return html`<div class="field">
        <div class="head"><label class="label" for="plan">States to keep</label></div>
        <select
          id="plan"
          @change=${(event: Event) => {
            const { value } = event.target as HTMLSelectElement;
            this.plan = value === 'list' ? '10,50,100' : value;
            this.context.refresh();
          }}
        >
          ${PLANS.map(([plan, words]) => html`<option value=${plan} ?selected=${plan === this.plan}>${words}</option>`)}
          <option value="list" ?selected=${custom}>These …</option>
        </select>
        ${
          custom
            ? html`<input
                aria-label="Iterations to keep, separated by commas"
                .value=${this.plan}
                @change=${(event: Event) => {
                  this.plan = (event.target as HTMLInputElement).value;
                }}
              />`
            : nothing
        }
        <p class="hint">The first and the last are always kept.</p>
      </div>
      <div class="field">
        <div class="head"><label class="label" for="name">Name</label></div>
        <input
          id="name"
          maxlength="120"
          .value=${this.name}
          @change=${(event: Event) => {
            this.name = (event.target as HTMLInputElement).value;
          }}
        />
      </div>`;
  }

  private get request(): JobRequest {
    const { iterations, ...parameters }: Record<string, Json> = changes(this.values, this.original);
    const tags = tagsOf(this.upright());
    return {
      mesh_id: this.mesh.id,
      preset: this.preset,
      ...(Object.keys(parameters).length > 0 ? { parameters } : {}),
      ...(typeof iterations === 'number' ? { iterations } : {}),
      snapshots: this.plan.trim(),
      ...(this.name.trim() ? { name: this.name.trim() } : {}),
      ...(tags.length > 0 ? { tags } : {}),
    };
  }

  private async copied(kind: 'curl' | 'Python'): Promise<void> {
    const text = (kind === 'curl' ? curl : python)(location.origin, this.request);
    if (await copy(text)) this.context.toast(`Copied as ${kind}`);
    else this.context.toast('The browser does not let this page copy', 'bad');
  }

  private async submit(): Promise<void> {
    this.sending = true;
    this.problem = null;
    this.context.refresh();
    try {
      this.started(await this.context.api.submit(this.request));
    } catch (thrown) {
      this.problem = asProblem(thrown);
    }
    this.sending = false;
    this.context.refresh();
  }
}
