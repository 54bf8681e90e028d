import { html, nothing, render } from 'lit-html';
import { Api } from './api/client';
import { withNextFrame } from './core/frame';
import { packed, readCommand } from './core/message';
import { formatRoute, parseRoute, type Look, type Shown } from './core/route';
import { MeshWorker } from './mesh/pool';
import './styles/tokens.css';
import './styles/base.css';
import './styles/parts.css';
import './styles/lists.css';
import './styles/stage.css';
import './styles/embed.css';
import { legend } from './ui/look';
import { problemCard } from './ui/problem';
import { applyTheme } from './ui/theme';
import { over, stageNotes } from './views/notes';
import { Stage } from './views/stage';

/** One run in a frame on somebody else's page: the picture, its timeline, and a way to all the rest. */

function open(root: HTMLElement, shown: Shown, look: Look): void {
  const context = { api: new Api(), worker: new MeshWorker(), toast: () => undefined };
  const stage = new Stage(context, shown.job, shown.iteration, look, true);
  const draw = (): void => {
    const { run } = stage;
    const iteration = stage.following ? null : Math.round(stage.at);
    const whole = formatRoute({ view: 'job', shown: { job: stage.job, iteration }, look: stage.look });
    render(
      run.state === null && run.problem
        ? problemCard(run.problem, null)
        : html`<div class="stage">${stage.viewer.element} ${over(stageNotes(stage))} ${legend(stage)}</div>
            ${stage.timeline.element}
            <a class="brand" href=${whole} target="_blank" rel="noreferrer"
              >${run.state?.job.name ?? nothing} · Spherify</a
            >`,
      root,
    );
    const status = run.state?.job.status ?? 'unknown';
    const report = { job: stage.job, iteration: Math.round(stage.at), status, playing: stage.player.playing };
    if (parent !== window) parent.postMessage(packed(report), '*'); // any page may embed, and nothing here is secret
  };
  stage.onChange(withNextFrame(draw));
  addEventListener('message', (event: MessageEvent<unknown>) => {
    const command = event.source === parent ? readCommand(event.data) : null;
    if (!command) return;
    if (command.color !== undefined) stage.setColor(command.color);
    if (command.wire !== undefined) stage.setWire(command.wire);
    if (command.iteration === null) stage.follow();
    else if (command.iteration !== undefined) stage.seek(command.iteration);
    if (command.playing !== undefined && command.playing !== stage.player.playing) stage.toggle();
  });
  draw();
}

applyTheme();
const root = document.getElementById('app');
if (!root) throw new Error('embed.html has no #app');
root.replaceChildren();
const route = parseRoute(location.search);
if (route.view === 'job') open(root, route.shown, route.look);
else
  render(
    html`<p class="card" role="alert">
      ${route.view === 'astray' ? route.why : ''} The address of a frame is <code>/embed?job=job_…</code>
    </p>`,
    root,
  );
