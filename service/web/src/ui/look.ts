import { html, nothing, type TemplateResult } from 'lit-html';
import { FIELDS, FIELD_INFO, gradient, type Field } from '../core/colormap';
import { figure } from '../core/format';
import { icon } from './icons';
import { background } from './place';

/** What can be changed about the look of a stage. */
export interface Looks {
  readonly color: Field | null;
  readonly wire: boolean;
  readonly facets: boolean;
  readonly range: { readonly low: number; readonly high: number } | null;
  readonly viewer: { readonly camera: { readonly up: 'y' | 'z' } };
  setColor(color: Field | null): void;
  setWire(wire: boolean): void;
  setFacets(facets: boolean): void;
  setUp(up: 'y' | 'z'): void;
}

/** Buttons for colour, lines, facets and the upright axis. */
export function lookBar(stage: Looks): TemplateResult {
  return html`<select
      class="tool-select"
      aria-label="Colour by"
      title="Colour by (C)"
      @change=${(event: Event) => {
        const { value } = event.target as HTMLSelectElement;
        stage.setColor(FIELDS.find((field) => field === value) ?? null);
      }}
    >
      <option value="" ?selected=${stage.color === null}>Clay</option>
      ${FIELDS.map((field) => html`<option value=${field} ?selected=${field === stage.color}>${FIELD_INFO[field].title}</option>`)}
    </select>
    <button
      class="tool"
      aria-pressed=${stage.wire ? 'true' : 'false'}
      title="Triangles (W)"
      aria-label="Show triangles"
      @click=${() => {
        stage.setWire(!stage.wire);
      }}
    >
      ${icon('grid')}
    </button>
    <button
      class="tool"
      aria-pressed=${stage.facets ? 'true' : 'false'}
      title="Flat facets (F)"
      aria-label="Flat facets"
      @click=${() => {
        stage.setFacets(!stage.facets);
      }}
    >
      ${icon('facets')}
    </button>
    <button
      class="tool"
      title="Turn upright (U)"
      aria-label="Turn upright"
      @click=${() => {
        stage.setUp(stage.viewer.camera.up === 'y' ? 'z' : 'y');
      }}
    >
      ${icon('upright')}
    </button>`;
}

/** What the colours mean. */
export function legend({ color, range }: Looks): TemplateResult | typeof nothing {
  if (!color || !range) return nothing;
  const { title, unit, meaning, diverging } = FIELD_INFO[color];
  const middle = (range.low + range.high) / 2;
  return html`<figure class="legend" aria-label="Legend: ${title}">
    <figcaption title=${meaning}><b>${title}</b> <span class="hint">${unit}</span></figcaption>
    <div class="scale" ${background(gradient(diverging))}></div>
    <div class="ends">
      <span>${figure(range.low, 3)}</span><span>${figure(Math.abs(middle) < 1e-9 ? 0 : middle, 3)}</span
      ><span>${figure(range.high, 3)}</span>
    </div>
  </figure>`;
}
