import { html, nothing, render, type TemplateResult } from 'lit-html';
import { Catalogue } from './api/catalogue';
import { Api } from './api/client';
import { asProblem } from './api/problem';
import { withNextFrame } from './core/frame';
import { formatRoute, leftOut, parseRoute, type Route } from './core/route';
import { MeshWorker } from './mesh/pool';
import { takeDrops } from './ui/dropzone';
import { Focus } from './ui/focus';
import { icon } from './ui/icons';
import { nextTheme, theme } from './ui/theme';
import { Toasts } from './ui/toast';
import { AstrayView } from './views/astray';
import type { Context, View } from './views/context';
import { HomeView } from './views/home';
import { JobList } from './views/joblist';
import { LoadingView } from './views/loading';
import { Rail } from './views/rail';
import { Thumbnails } from './views/thumbnails';

const THEME_ICONS = { auto: 'auto', light: 'sun', dark: 'moon' } as const;

/** The page: a rail with all runs, and one view. */
export class App {
  private readonly context: Context;
  private readonly toasts: Toasts;
  private readonly rail: Rail;
  private readonly focus: Focus;
  private route: Route = { view: 'home' };
  private view: View;
  private visits = 0;
  private menu = false;
  /** What the address held that could not be followed. */
  private leftOut: readonly string[] = [];
  /** Whether the focus is yet to go to the view that one has come to, or waits in its place for its heading. */
  private arriving: 'no' | 'yes' | 'waiting' = 'no';
  /** The name of the view that one has come to, for those who hear the page; null before they have gone anywhere. */
  private announced: string | null = null;
  /** Whether that name is to be taken away once: the same words again would not be said again. */
  private silent = false;

  constructor(private readonly root: HTMLElement) {
    const api = new Api();
    const worker = new MeshWorker();
    this.toasts = new Toasts(() => {
      this.refresh();
    });
    this.context = {
      api,
      worker,
      catalogue: new Catalogue(api),
      jobs: new JobList(api),
      thumbnails: new Thumbnails(worker),
      go: (route, stays) => {
        this.go(route, stays ?? false);
      },
      choosing: (begun) => {
        this.view.choosing?.(begun);
      },
      files: (files) => {
        this.files(files);
      },
      toast: (text, kind) => {
        this.toasts.say(text, kind);
      },
      refresh: () => {
        this.refresh();
      },
    };
    for (const source of [this.context.catalogue, this.context.jobs, this.context.thumbnails])
      source.onChange(() => {
        this.refresh();
      });
    this.rail = new Rail(this.context);
    this.focus = new Focus(root);
    this.route = parseRoute(location.search);
    this.leftOut = leftOut(location.search);
    this.view = new LoadingView();
    this.open(this.route);
  }

  /** Draw, and listen to the browser. */
  start(): void {
    addEventListener('popstate', () => {
      this.arrive(parseRoute(location.search));
      this.leftOut = leftOut(location.search);
    });
    addEventListener('keydown', this.key);
    this.root.addEventListener('click', this.press);
    takeDrops(this.context);
    this.refresh();
  }

  private go(route: Route, stays: boolean): void {
    const address = formatRoute(route);
    const elsewhere = address !== location.pathname + location.search;
    if (stays) {
      this.route = route;
      if (elsewhere) history.replaceState(null, '', address);
    } else {
      if (elsewhere) history.pushState(null, '', address);
      this.arrive(route);
    }
  }

  /** Show what an address is of. */
  private arrive(route: Route): void {
    this.route = route;
    this.menu = false;
    this.leftOut = [];
    this.arriving = 'yes';
    this.announced ??= '';
    this.silent = true;
    this.open(route);
  }

  private files(files: readonly File[]): void {
    const [file] = files;
    if (file === undefined) return;
    this.route = { view: 'home' };
    history.pushState(null, '', '/');
    this.menu = false;
    this.leftOut = [];
    this.arriving = 'yes';
    this.announced ??= '';
    this.silent = true;
    const context = this.lent();
    void this.show(async () => {
      if (files.length > 1) {
        const { BatchView } = await import('./views/batch');
        return new BatchView(context, files);
      }
      const { MeshView } = await import('./views/mesh');
      return new MeshView(context, file);
    });
  }

  /** What the next view works with: once it is left, what it still waited for leads the visitor nowhere. */
  private lent(): Context {
    const visit = ++this.visits;
    return {
      ...this.context,
      go: (route, stays) => {
        if (visit === this.visits) this.context.go(route, stays);
      },
    };
  }

  /** The first page is here at once; what draws is fetched when it is wanted, or when there is time. */
  private open(route: Route): void {
    const context = this.lent();
    if (route.view === 'home') this.put(new HomeView(context));
    else if (route.view === 'astray') this.put(new AstrayView(route.why));
    else void this.show(() => made(route, context));
  }

  /** Show a view as soon as its code is here, unless another one was asked for meanwhile. */
  private async show(make: () => Promise<View>): Promise<void> {
    const waiting = new LoadingView();
    this.put(waiting);
    try {
      const view = await make();
      if (this.view === waiting) this.put(view);
      else view.close();
    } catch (thrown) {
      waiting.problem = asProblem(thrown);
      this.refresh();
    }
  }

  private put(view: View): void {
    this.view.close();
    this.view = view;
    this.refresh();
  }

  private readonly refresh = withNextFrame(() => {
    const { title } = this.view;
    document.title = title === '' || title === 'Spherify' ? 'Spherify' : `${title} · Spherify`;
    if (this.silent) this.announced = '';
    else if (this.announced !== null) this.announced = title || this.announced; // as soon as it is known
    const draw = (): void => {
      this.rail.keepingFocus(() => {
        render(this.page(), this.root);
      });
    };
    if (this.arriving === 'no') this.focus.keeping(draw);
    else {
      draw();
      this.takeFocus();
    }
    if (this.silent) this.refresh();
    this.silent = false;
  });

  /** Bring the focus to the view's heading, or to where it will be, without moving what is seen. */
  private takeFocus(): void {
    const main = this.root.querySelector<HTMLElement>('main');
    const heading = main?.querySelector<HTMLElement>('h1') ?? null;
    const waited = this.arriving === 'waiting';
    this.arriving = heading === null ? 'waiting' : 'no';
    const elsewhere = document.activeElement !== main && document.activeElement !== document.body;
    if (waited && elsewhere) return; // the visitor went on meanwhile
    main?.scrollTo(0, 0);
    (heading ?? main)?.focus({ preventScroll: true });
  }

  private page(): TemplateResult {
    const { jobs } = this.context;
    const lost = jobs.problem?.unreachable ?? false;
    return html`<a class="skip" href="#main">To the content</a>
      <header class="top">
        <button
          class="tool only-narrow"
          aria-label="Runs"
          aria-expanded=${this.menu ? 'true' : 'false'}
          @click=${() => {
            this.menu = !this.menu;
            this.refresh();
          }}
        >
          ${icon('list')}
        </button>
        <a class="brand" href="/">${icon('sphere')}<span>Spherify</span></a>
        <nav aria-label="Site">
          <a href="/docs">API</a>
          <a href="https://arxiv.org/abs/1608.03898" rel="noreferrer">Paper</a>
        </nav>
        <button
          class="tool"
          title="Colours: ${theme()}"
          aria-label="Colours: ${theme()}"
          @click=${() => {
            nextTheme();
            this.refresh();
          }}
        >
          ${icon(THEME_ICONS[theme()])}
        </button>
      </header>
      ${
        lost
          ? html`<div class="banner" role="alert">
              The service does not answer. What you see stays; trying again …
            </div>`
          : this.odd()
      }
      <div class="body ${this.menu ? 'menu' : ''}">
        <nav class="rail" aria-label="Runs">${this.rail.render(this.route)}</nav>
        <main id="main" tabindex="-1">
          ${this.view.headed === true || this.view.title === '' ? nothing : html`<h1 class="hidden" tabindex="-1">${this.view.title}</h1>`}
          ${this.view.render()}
        </main>
      </div>
      <p class="hidden" role="status">${this.announced}</p>
      ${this.toasts.render()}`;
  }

  /** Say what of the address was not followed. */
  private odd(): TemplateResult | typeof nothing {
    const [first, ...more] = this.leftOut.slice(0, 4);
    if (first === undefined) return nothing;
    return html`<div class="banner mild" role="status">
      <span
        >Left out, as this page does not understand that part of the address:
        <code>${first}</code>${more.map((one) => html`, <code>${one}</code>`)}</span
      >
      <button
        class="tool"
        aria-label="Close this note"
        @click=${() => {
          this.leftOut = [];
          this.refresh();
        }}
      >
        ${icon('cross')}
      </button>
    </div>`;
  }

  /** Follow links to the first page without loading it anew. */
  private readonly press = (event: MouseEvent): void => {
    const link = (event.target as HTMLElement).closest('a');
    if (link?.getAttribute('href') !== '/' || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    this.go({ view: 'home' }, false);
  };

  private readonly key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const target = event.target as HTMLElement;
    const typing = target.matches('input, select, textarea, summary');
    const pressing = event.key === ' ' && target.matches('button, a');
    if (typing || pressing) return;
    if (this.view.key?.(event)) event.preventDefault();
  };
}

/** Make what an address is of, as soon as its code is here. */
async function made(route: Exclude<Route, { view: 'home' | 'astray' }>, context: Context): Promise<View> {
  switch (route.view) {
    case 'mesh': {
      const { MeshView } = await import('./views/mesh');
      return new MeshView(context, route.mesh, route.up, route.name);
    }
    case 'job': {
      const { JobView } = await import('./views/job');
      return new JobView(context, route.shown, route.look);
    }
    case 'compare': {
      const { CompareView } = await import('./views/compare');
      return new CompareView(context, route.left, route.right, route.look);
    }
  }
}
