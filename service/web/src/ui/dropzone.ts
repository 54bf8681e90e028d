import { html, nothing, type TemplateResult } from 'lit-html';
import { bytes, count } from '../core/format';
import type { Context } from '../views/context';
import { icon } from './icons';

/** A place to drop meshes on, and a button for those who do not drag. */
export function dropZone(context: Context): TemplateResult {
  const { info } = context.catalogue;
  const formats =
    info?.formats.read.map((format) => format.name.toUpperCase()).join(', ') ??
    'OBJ, PLY, STL, OFF, GLB, 3MF';
  const limits = info
    ? html`, up to <span class="keep">${bytes(info.limits.max_upload_bytes)}</span> and
        <span class="keep">${count(info.limits.max_vertices)} vertices</span>`
    : nothing;
  return html`<label class="drop">
    <input
      type="file"
      class="hidden"
      multiple
      accept=".obj,.ply,.stl,.off,.glb,.3mf"
      @click=${() => {
        context.choosing(true);
      }}
      @cancel=${() => {
        context.choosing(false);
      }}
      @change=${(event: Event) => {
        const chosen = event.target as HTMLInputElement;
        context.files([...(chosen.files ?? [])]);
        chosen.value = ''; // the same file may be chosen again
      }}
    />
    ${icon('upload')}
    <span><b>Drop a mesh here</b> or <span class="link keep">choose files</span></span>
    <span class="hint">${formats}${limits}</span>
  </label>`;
}

/** Take files that are dropped anywhere on the page. */
export function takeDrops(context: Context): void {
  const over = (on: boolean): void => {
    document.documentElement.classList.toggle('dragging', on);
    if (on !== was) context.choosing(on);
    was = on;
  };
  let was = false;
  let depth = 0; // enter and leave come for every element below the pointer
  addEventListener('dragenter', (event) => {
    if (!event.dataTransfer?.types.includes('Files')) return;
    depth += 1;
    over(true);
  });
  addEventListener('dragleave', () => {
    depth = Math.max(0, depth - 1);
    over(depth > 0);
  });
  addEventListener('dragover', (event) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault();
  });
  addEventListener('drop', (event) => {
    event.preventDefault();
    depth = 0;
    context.files([...(event.dataTransfer?.files ?? [])]);
    over(false);
  });
}
