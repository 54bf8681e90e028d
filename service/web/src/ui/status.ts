import { html, nothing, type TemplateResult } from 'lit-html';
import type { Connection } from '../api/follow';
import type { Job, Row } from '../api/types';
import { capital, count, duration, figure, rate, share } from '../core/format';
import { STATUS_WORDS, figuresAt, reason } from '../core/job';
import { MEANING } from '../core/meaning';
import { broken } from './broken';

/** A job's state in a word. */
export function pill(job: Job): TemplateResult {
  return html`<span class="pill ${job.status}">${STATUS_WORDS[job.status]}</span>`;
}

/** How far the job is, how it ended, and its figures where one stands. */
export function statusCard(
  job: Job,
  rows: readonly Row[],
  at: number,
  connection: Connection,
): TemplateResult {
  const row = figuresAt(rows, Math.round(at));
  return html`<section class="card status" aria-label="Status">
    <header>
      <h2>${broken(job.name)}</h2>
      ${pill(job)}
    </header>
    <p class="hint">
      ${job.preset}${job.attempt > 1 ? ` · taken up again, attempt ${job.attempt}` : ''}${connection === 'polling' ? ' · asking every second' : ''}
    </p>
    ${job.done ? ended(job) : going(job)}
    <p class="hidden" role="status">${STATUS_WORDS[job.status]}${job.done ? `, ${reason(job)}` : ''}</p>
    ${
      row
        ? html`<p class="at">At iteration ${count(row.iteration)}</p>
            <dl class="figures">
              ${pair('Sphericity Ψ', share(row.sphericity), true, MEANING.sphericity)}
              ${pair('Radius variation', figure(row.radius_variation, 3), true, MEANING.variation)}
              ${pair('Volume', figure(row.volume))} ${pair('Area', figure(row.area))}
              ${pair('Worst triangle', figure(row.least_quality, 2), false, MEANING.quality)}
              ${pair('Inward faces', typeof row.inward_faces === 'number' ? count(row.inward_faces) : '–', false, MEANING.inward)}
            </dl>`
        : nothing
    }
  </section>`;
}

function pair(term: string, value: string, large = false, meaning = ''): TemplateResult {
  return html`<div class=${large ? 'large' : ''} title=${meaning || nothing}>
    <dt>${term}</dt>
    <dd>${value}</dd>
  </div>`;
}

function going(job: Job): TemplateResult {
  const { progress, queue } = job;
  if (job.status === 'accepted')
    return html`<progress aria-label="Waiting"></progress>
      <p>
        ${queue.position === null ? 'Waiting for a worker' : queue.position === 0 ? 'Next in the queue' : `${queue.position} before it in the queue`}
      </p>`;
  return html`<progress max="100" .value=${progress.percent} aria-label="Progress"></progress>
    <p class="going">
      <span>${count(progress.iteration)} of at most ${count(progress.iterations_total)}</span>
      <span>${rate(progress.iterations_per_s)}</span>
      <span title="if no stopping rule ends the run before"
        >${progress.eta_s === null ? '' : `at most ${duration(progress.eta_s)} left`}</span
      >
    </p>`;
}

function ended(job: Job): TemplateResult {
  const { progress } = job;
  return html`<p>
      ${reason(job) ? html`<b>${capital(reason(job))}</b> · ` : nothing}${count(progress.iteration)}
      iterations in <span class="keep">${duration(progress.elapsed_s)}</span>
    </p>
    ${job.error ? html`<p class="fault">${capital(job.error.detail)}</p>` : nothing}
    ${job.stop_detail && !job.error && job.stop_reason !== 'iterations' ? html`<p class="hint">${capital(job.stop_detail)}</p>` : nothing}`;
}
