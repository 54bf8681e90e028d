import { html, nothing, type TemplateResult } from 'lit-html';
import type { FormField, Json, NumberField, Values } from '../core/schema';
import { wrong } from '../core/schema';
import { icon } from './icons';

/** Draws the fields of a schema; each change is told alone, as what was drawn may be older than what was typed since. */
export function fields(
  list: readonly FormField[],
  values: Values,
  original: Values,
  changed: (values: Values) => void,
  path = 'p',
): TemplateResult[] {
  return list.map((field) => {
    const value = values[field.name] ?? null;
    const put = (next: Json): void => {
      changed({ [field.name]: next });
    };
    const differs = JSON.stringify(value) !== JSON.stringify(original[field.name] ?? null);
    return row(field, value, original[field.name] ?? null, put, `${path}-${field.name}`, differs);
  });
}

function row(
  field: FormField,
  value: Json,
  original: Json,
  put: (value: Json) => void,
  id: string,
  differs: boolean,
): TemplateResult {
  const compound = field.kind === 'rows' || field.kind === 'group' || field.kind === 'tuple';
  const back = differs
    ? html`<button
        type="button"
        class="tool mini"
        title="Back to the preset's value"
        aria-label="${field.title}: back to the preset's value"
        @click=${() => {
          put(original);
        }}
      >
        ${icon('reset')}
      </button>`
    : nothing;
  const title = compound
    ? html`<span class="label" id="${id}-label">${field.title}</span>`
    : html`<label class="label" for=${id}>${field.title}</label>`;
  return html`<div
    class="field ${differs ? 'changed' : ''}"
    role=${compound ? 'group' : nothing}
    aria-labelledby=${compound ? `${id}-label` : nothing}
  >
    <div class="head">${title}${back}</div>
    ${control(field, value, original, put, id)}
    ${field.description ? html`<p class="hint" id="${id}-hint">${prose(field.description)}</p>` : nothing}
  </div>`;
}

function control(
  field: FormField,
  value: Json,
  original: Json,
  put: (value: Json) => void,
  id: string,
): TemplateResult | TemplateResult[] {
  switch (field.kind) {
    case 'number':
      return numeric(field, value, put, id);
    case 'choice':
      return html`<select
        id=${id}
        @change=${(event: Event) => {
          put((event.target as HTMLSelectElement).value);
        }}
      >
        ${field.choices.map((choice) => html`<option value=${choice} ?selected=${choice === value}>${choice}</option>`)}
      </select>`;
    case 'switch':
      return html`<input
        id=${id}
        type="checkbox"
        .checked=${value === true}
        @change=${(event: Event) => {
          put((event.target as HTMLInputElement).checked);
        }}
      />`;
    case 'text':
      return html`<input
        id=${id}
        .value=${words(value)}
        @change=${(event: Event) => {
          put((event.target as HTMLInputElement).value);
        }}
      />`;
    case 'tuple': {
      const items = Array.isArray(value) ? (value as readonly Json[]) : [];
      return html`<div class="side">
        ${field.items.map((item, i) =>
          item.kind === 'number'
            ? numeric(
                item,
                items[i] ?? null,
                (next) => {
                  put(items.map((old, j) => (i === j ? next : old)));
                },
                `${id}-${i}`,
                `${field.title}, ${i + 1}`,
              )
            : nothing,
        )}
      </div>`;
    }
    case 'group':
      return group(field, value, original, put, id);
    case 'rows':
      return rows(field, value, put, id);
  }
}

function numeric(
  field: NumberField,
  value: Json,
  put: (value: Json) => void,
  id: string,
  name: string | null = null,
): TemplateResult {
  const fault = typeof value === 'number' ? wrong(field, value) : value === null ? '' : wrong(field, NaN);
  return html`<input
      id=${id}
      type="number"
      inputmode="decimal"
      step=${field.whole ? 1 : 'any'}
      aria-label=${name ?? nothing}
      aria-invalid=${fault ? 'true' : 'false'}
      aria-describedby=${fault ? `${id}-fault` : nothing}
      .value=${value === null ? '' : words(value)}
      @change=${(event: Event) => {
        const { valueAsNumber } = event.target as HTMLInputElement;
        put(Number.isNaN(valueAsNumber) ? 'nothing' : valueAsNumber);
      }}
    />${fault ? html`<p class="fault" id="${id}-fault" role="alert">${fault}</p>` : nothing}`;
}

function group(
  field: Extract<FormField, { kind: 'group' }>,
  value: Json,
  original: Json,
  put: (value: Json) => void,
  id: string,
): TemplateResult {
  const on = value !== null;
  const inner = (on ? value : {}) as Values;
  const switched = (event: Event): void => {
    const start = original ?? Object.fromEntries(field.fields.map((one) => [one.name, suggestion(one)]));
    put((event.target as HTMLInputElement).checked ? start : null);
  };
  return html`${
    field.optional
      ? html`<label class="check"><input type="checkbox" .checked=${on} @change=${switched} /> on</label>`
      : nothing
  }
  ${
    on
      ? html`<div class="nested">
          ${fields(
            field.fields,
            inner,
            (original ?? {}) as Values,
            (patch) => {
              put({ ...inner, ...patch });
            },
            id,
          )}
        </div>`
      : nothing
  }`;
}

function rows(
  field: Extract<FormField, { kind: 'rows' }>,
  value: Json,
  put: (value: Json) => void,
  id: string,
): TemplateResult {
  const list = (Array.isArray(value) ? value : []) as readonly Values[];
  return html`<table class="rows">
      <thead>
        <tr>
          ${field.row.map((cell) => html`<th scope="col">${cell.title}</th>`)}
          <th><span class="hidden">Remove</span></th>
        </tr>
      </thead>
      <tbody>
        ${list.map(
          (entry, i) =>
            html`<tr>
              ${field.row.map((cell) =>
                cell.kind === 'number'
                  ? html`<td>
                      ${numeric(
                        cell,
                        entry[cell.name] ?? null,
                        (next) => {
                          put(list.map((old, j) => (i === j ? { ...old, [cell.name]: next } : old)));
                        },
                        `${id}-${i}-${cell.name}`,
                        `${cell.title}, row ${i + 1}`,
                      )}
                    </td>`
                  : nothing,
              )}
              <td>
                <button
                  type="button"
                  class="tool mini"
                  aria-label="Remove row ${i + 1}"
                  ?disabled=${list.length < 2}
                  @click=${() => {
                    put(list.filter((_, j) => j !== i));
                  }}
                >
                  ${icon('cross')}
                </button>
              </td>
            </tr>`,
        )}
      </tbody>
    </table>
    <button
      type="button"
      class="plain small"
      ?disabled=${list.length >= field.most}
      @click=${() => {
        put([
          ...list,
          list.at(-1) ?? Object.fromEntries(field.row.map((one) => [one.name, suggestion(one)])),
        ]);
      }}
    >
      ${icon('more')} Add a stage
    </button>`;
}

function suggestion(field: FormField): Json {
  if (field.kind === 'number') {
    const [least, most] = [field.least ?? 0, field.most];
    if (most !== null && field.open.most) return (least + most) / 2;
    return field.open.least ? least + 0.001 : Math.max(least, 1);
  }
  return field.kind === 'choice' ? (field.choices[0] ?? '') : field.kind === 'switch' ? false : null;
}

/** Whether every number that is filled in may be sent. */
export function sound(list: readonly FormField[], values: Values): boolean {
  return list.every((field) => soundValue(field, values[field.name] ?? null));
}

function soundValue(field: FormField, value: Json): boolean {
  if (value === null) return field.kind === 'group' ? field.optional : true;
  if (field.kind === 'number') return typeof value === 'number' && wrong(field, value) === '';
  if (field.kind === 'group') return sound(field.fields, value as Values);
  if (field.kind === 'rows') return (value as readonly Values[]).every((entry) => sound(field.row, entry));
  if (field.kind === 'tuple')
    return field.items.every((item, i) => soundValue(item, (value as readonly Json[])[i] ?? null));
  return true;
}

function words(value: Json): string {
  return typeof value === 'string' ? value : JSON.stringify(value);
}

/** Set what stands in backticks as code. */
export function prose(text: string): (TemplateResult | string)[] {
  return text.split('`').map((part, i) => (i % 2 === 1 ? html`<code>${part}</code>` : part));
}
