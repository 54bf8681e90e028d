import { html, nothing, type TemplateResult } from 'lit-html';
import { asProblem, type Problem } from '../api/problem';
import type { Job, Mesh } from '../api/types';
import { bytes, count } from '../core/format';
import { PLAIN, type Up } from '../core/route';
import type { Drawable } from '../mesh/tasks';
import { dropZone } from '../ui/dropzone';
import { icon } from '../ui/icons';
import { problemCard, wayHome } from '../ui/problem';
import { refusal, reportCard } from '../ui/report';
import { Viewer } from '../viewer/viewer';
import type { Context, View } from './context';
import { JobForm } from './jobform';
import { over, PREPARING } from './notes';
import { upOfFile } from './up';

/** A mesh before its run: what it looks like, what was found out about it, and what shall be done with it. */
export class MeshView implements View {
  private readonly viewer = new Viewer('The mesh');
  private mesh: Mesh | null = null;
  private problem: Problem | null = null;
  /** How many triangles there are, and how many of them are drawn; null without a preview. */
  private shown: { readonly drawn: number; readonly all: number } | null = null;
  private noPreview = false;
  private sent: number | null = null;
  private up: Up = 'y';
  private form: JobForm | null = null;
  private closed = false;

  /**
   * @param source a file that is not sent yet, or the id of a mesh that the service has.
   * @param given the axis that stands upright, if that is known.
   * @param called the name of the file as it was dropped; the service keeps the first name of the same bytes.
   */
  constructor(
    private readonly context: Context,
    private source: File | string,
    private readonly given: Up | null = null,
    private called: string | null = null,
  ) {
    context.thumbnails.hold = true; // until what one looks at is drawn
    this.viewer.onState = () => {
      if (this.viewer.shown || this.viewer.state === 'unsupported') context.thumbnails.hold = false;
      this.context.refresh();
    };
    if (source instanceof File) {
      this.setUp(upOfFile(source.name));
      void this.look(source);
      void this.send(source, []);
    } else void this.load(source);
  }

  get title(): string {
    return this.name || (this.problem?.title ?? '');
  }

  render(): TemplateResult {
    if (this.problem && typeof this.source === 'string' && !this.mesh)
      return html`<div class="middle">${this.failure(this.problem)}</div>`; // there is nothing to see beside it
    return html`<div class="work">
      <div class="stage">
        ${this.viewer.element} ${over(this.notes())}
        ${this.noPreview && !this.shown ? nothing : this.corner()}
      </div>
      <aside class="panel" aria-label="Mesh">${this.panel()}</aside>
    </div>`;
  }

  key(event: KeyboardEvent): boolean {
    if (event.key !== 'u') return false;
    this.setUp(this.up === 'y' ? 'z' : 'y');
    return true;
  }

  close(): void {
    this.closed = true;
    this.context.thumbnails.hold = false;
    this.viewer.dispose();
  }

  private get name(): string {
    return this.called ?? this.mesh?.name ?? (this.source instanceof File ? this.source.name : '');
  }

  private corner(): TemplateResult {
    return html`<div class="corner">
      <button
        class="tool"
        title="Turn upright (U)"
        aria-label="Turn upright"
        @click=${() => {
          this.setUp(this.up === 'y' ? 'z' : 'y');
        }}
      >
        ${icon('upright')}
      </button>
    </div>`;
  }

  private panel(): TemplateResult {
    if (this.problem) {
      if (this.problem.report || this.problem.defects.length > 0)
        return html`${refusal(this.problem, this.shown !== null, (allow) => {
          if (this.source instanceof File) void this.send(this.source, allow);
        })}
        ${this.problem.report ? reportCard(this.name, this.problem.report) : nothing}`;
      return this.failure(this.problem);
    }
    if (!this.mesh) return this.waiting();
    return html`${reportCard(this.name, this.mesh.report)}${this.form?.render() ?? nothing}`;
  }

  private failure(problem: Problem): TemplateResult {
    const again = (): void => {
      if (this.source instanceof File) void this.send(this.source, []);
      else void this.load(this.source);
    };
    // the same file is as bad again, but there may be another one
    return html`${problemCard(problem, problem.passing ? again : null, wayHome(), this.name)}
    ${this.source instanceof File ? dropZone(this.context) : nothing}`;
  }

  private waiting(): TemplateResult {
    const { source, sent } = this;
    const all = sent !== null && sent >= 1;
    const words =
      source instanceof File
        ? all
          ? 'The service reads it …'
          : `Sending ${bytes(source.size)} …`
        : 'Loading …';
    return html`<section class="card" aria-busy="true">
      <h2>${this.name || html`<span class="ghost line"></span>`}</h2>
      <p role="status">${words}</p>
      ${sent !== null && !all ? html`<progress max="1" .value=${sent} aria-label="Sent"></progress>` : html`<progress aria-label="Reading"></progress>`}
    </section>`;
  }

  private notes(): TemplateResult | typeof nothing {
    const { shown, noPreview } = this;
    if (this.viewer.state === 'unsupported')
      return html`<p class="note">This browser draws no WebGL: everything works but the picture.</p>`;
    if (noPreview && !this.mesh)
      return html`<p class="note">
        ${this.problem ? 'No preview of this file.' : 'No preview of this file; the service reads it.'}
      </p>`;
    if (!shown && !this.problem) return html`<p class="note">Loading the mesh …</p>`;
    if (shown && !this.viewer.shown) return PREPARING;
    if (shown && shown.drawn < shown.all)
      return html`<p class="note">
        Drawn with ${count(shown.drawn)} of ${count(shown.all)} triangles; the run uses all of them.
      </p>`;
    return nothing;
  }

  private setUp(up: Up): void {
    this.up = this.viewer.up = up;
  }

  private async look(file: File): Promise<void> {
    try {
      const data = await file.arrayBuffer();
      if (this.isClosed()) return;
      const preview = await this.context.worker.ask('preview', { data, name: file.name }, [data]);
      if (this.isClosed() || this.shown) return; // what the service has may have been quicker
      this.show(preview);
      await this.mark();
    } catch {
      if (this.isClosed()) return;
      this.noPreview = true; // the service will say more
      if (!this.mesh) this.expectNothing();
    }
    this.context.refresh();
  }

  private async send(file: File, allow: readonly string[]): Promise<void> {
    this.problem = null;
    this.sent = 0;
    this.context.refresh();
    let mesh: Mesh;
    try {
      mesh = await this.context.api.upload(file, file.name, allow, (share) => {
        this.sent = share;
        this.context.refresh();
      });
    } catch (thrown) {
      if (this.isClosed()) return;
      this.problem = asProblem(thrown);
      this.context.refresh();
      await this.mark();
      return;
    }
    if (this.isClosed()) return;
    if (mesh.name !== file.name) this.called = file.name;
    this.accept(mesh);
    this.context.go({ view: 'mesh', mesh: mesh.id, up: this.up, name: this.called }, true); // it has an address now
    await this.load(mesh.id);
  }

  /** Go on with a mesh that the service has. */
  private accept(mesh: Mesh): void {
    this.source = mesh.id;
    this.mesh = mesh;
    this.form = new JobForm(
      this.context,
      mesh,
      this.name,
      () => this.up,
      (job) => {
        this.started(job);
      },
    );
  }

  /** Draw what the service has; a preview stays in sight until that can be drawn. */
  private async load(id: string): Promise<void> {
    this.problem = null;
    this.viewer.expect(true);
    this.context.refresh();
    try {
      if (!this.mesh) {
        const mesh = await this.context.api.mesh(id);
        if (this.isClosed()) return;
        this.setUp(this.given ?? upOfFile(mesh.name));
        this.accept(mesh);
        this.context.refresh();
      }
      const path = `/v1/meshes/${id}`;
      const drawable = await this.context.worker.ask('topology', {
        key: path,
        faces: `${path}/topology`,
        positions: `${path}/positions?dtype=f32`,
      });
      void this.context.worker.ask('forget', { key: path });
      if (!this.isClosed()) this.show(drawable);
    } catch (thrown) {
      if (this.isClosed()) return;
      this.problem = asProblem(thrown);
      this.expectNothing();
    }
    this.context.refresh();
  }

  private started(job: Job): void {
    void this.context.jobs.load();
    const camera = this.viewer.camera.view;
    this.context.go({
      view: 'job',
      shown: { job: job.id, iteration: null },
      look: { ...PLAIN, up: this.up, camera },
    });
  }

  private show(drawable: Drawable): void {
    this.shown = { drawn: drawable.index.length / 3, all: drawable.triangles };
    this.viewer.load(drawable);
    this.viewer.describe(`${this.name}, ${count(drawable.triangles)} triangles`);
  }

  /** Draw the faults once it is known that the mesh is refused. */
  private async mark(): Promise<void> {
    const { problem } = this;
    if (!problem || !this.shown) return;
    const places = problem.defects.flatMap((defect) => defect.locations ?? []);
    const faults = await this.context.worker.ask('faults', {});
    if (!this.isClosed() && this.problem === problem) this.viewer.mark(faults, places); // not if it is sent again
  }

  /** There will be no picture, for the time being. */
  private expectNothing(): void {
    this.viewer.expect(false);
    this.context.thumbnails.hold = false;
  }

  private isClosed(): boolean {
    return this.closed; // it may be closed while something is awaited
  }
}
