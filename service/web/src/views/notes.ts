import { html, nothing, type TemplateResult } from 'lit-html';
import { count } from '../core/format';
import type { Stage } from './stage';

/** What has to be said about the picture, over the picture. */
export function stageNotes(stage: Stage): TemplateResult | typeof nothing {
  const { viewer, run, triangles, drawn, problem, wire } = stage;
  if (viewer.state === 'unsupported')
    return html`<p class="note">This browser draws no WebGL: everything works but the picture.</p>`;
  if (viewer.state === 'lost')
    return html`<p class="note" role="status">
      The graphics card took the picture away; waiting to get it back …
    </p>`;
  if (run.connection === 'lost')
    return html`<p class="note" role="status">
      The service does not answer; the run goes on there. Trying again …
    </p>`;
  if (problem?.passing) return html`<p class="note" role="status">${problem.detail} Trying again …</p>`;
  if (run.state?.states.length === 0 && !run.state.job.done)
    return html`<p class="note" role="status">
      ${run.state.job.queue.position === null ? 'Waiting for the first state …' : 'Waiting for a worker …'}
    </p>`;
  if (triangles === 0 && run.state && run.state.states.length > 0)
    return html`<p class="note" role="status">Loading the mesh …</p>`;
  if (triangles > 0 && !viewer.shown) return html`<p class="note" role="status">Preparing the picture …</p>`;
  if (drawn < triangles)
    return html`<p class="note">
      Drawn${wire ? ', lines too,' : ''} with ${count(drawn)} of ${count(triangles)} triangles; downloads have
      all of them.
    </p>`;
  return nothing;
}
