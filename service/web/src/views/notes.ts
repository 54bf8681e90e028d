import { html, nothing, type TemplateResult } from 'lit-html';
import { count } from '../core/format';
import type { Stage } from './stage';

/** For the eye alone: whoever hears the page has heard that it loads. */
export const PREPARING = html`<p class="note" aria-hidden="true">Preparing the picture …</p>`;

/** The place over a picture for what has to be said about it: always there, as what comes into it is to be heard. */
export function over(note: TemplateResult | typeof nothing): TemplateResult {
  return html`<div class="over" role="status">${note}</div>`;
}

/** What has to be said about the picture of a run. */
export function stageNotes(stage: Stage): TemplateResult | typeof nothing {
  const { viewer, run, triangles, drawn, problem, wire } = stage;
  if (viewer.state === 'unsupported')
    return html`<p class="note">This browser draws no WebGL: everything works but the picture.</p>`;
  if (viewer.state === 'lost')
    return html`<p class="note">The graphics card took the picture away; waiting to get it back …</p>`;
  if (run.connection === 'lost')
    return html`<p class="note">The service does not answer; the run goes on there. Trying again …</p>`;
  if (problem?.passing) return html`<p class="note">${problem.detail} Trying again …</p>`;
  if (run.state?.states.length === 0 && !run.state.job.done)
    return html`<p class="note">
      ${run.state.job.queue.position === null ? 'Waiting for the first state …' : 'Waiting for a worker …'}
    </p>`;
  if (triangles === 0 && run.state && run.state.states.length > 0)
    return html`<p class="note">Loading the mesh …</p>`;
  if (triangles > 0 && !viewer.shown) return PREPARING;
  if (drawn < triangles)
    return html`<p class="note">
      Drawn${wire ? ', lines too,' : ''} with ${count(drawn)} of ${count(triangles)} triangles; downloads have
      all of them.
    </p>`;
  return nothing;
}
