import { html, nothing, render, type TemplateResult } from 'lit-html';
import { Catalogue } from './api/catalogue';
import { Api } from './api/client';
import { asProblem } from './api/problem';
import { withNextFrame } from './core/frame';
import { formatRoute, parseRoute, type Route } from './core/route';
import { MeshWorker } from './mesh/pool';
import { takeDrops } from './ui/dropzone';
import { icon } from './ui/icons';
import { nextTheme, theme } from './ui/theme';
import { Toasts } from './ui/toast';
import type { Context, View } from './views/context';
import { HomeView } from './views/home';
import { JobList } from './views/joblist';
import { LoadingView } from './views/loading';
import { rail } from './views/rail';
import { Thumbnails } from './views/thumbnails';

const THEME_ICONS = { auto: 'auto', light: 'sun', dark: 'moon' } as const;

/** The page: a rail with all runs, and one view. */
export class App {
  private readonly context: Context;
  private readonly toasts: Toasts;
  private route: Route = { view: 'home' };
  private view: View;
  private menu = false;

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
      go: (route, replace) => {
        this.go(route, replace ?? false);
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
    this.route = parseRoute(location.search);
    this.view = new LoadingView();
    this.open(this.route);
  }

  /** Draw, and listen to the browser. */
  start(): void {
    addEventListener('popstate', () => {
      this.arrive(parseRoute(location.search));
    });
    addEventListener('keydown', this.key);
    takeDrops((files) => {
      this.files(files);
    });
    this.refresh();
  }

  private go(route: Route, replace: boolean): void {
    const address = formatRoute(route);
    const here = location.pathname + location.search;
    const same = sameView(this.route, route);
    if (replace) {
      if (address !== formatRoute(parseRoute(location.search)) || address !== here)
        history.replaceState(null, '', address);
    } else if (address !== here) history.pushState(null, '', address);
    if (replace && same) this.route = route;
    else this.arrive(route);
  }

  private arrive(route: Route): void {
    this.route = route;
    this.menu = false;
    this.open(route);
  }

  private files(files: readonly File[]): void {
    const [file] = files;
    if (file === undefined) return;
    this.route = { view: 'home' };
    history.pushState(null, '', '/');
    this.menu = false;
    void this.show(async () => {
      if (files.length > 1) {
        const { BatchView } = await import('./views/batch');
        return new BatchView(this.context, files);
      }
      const { MeshView } = await import('./views/mesh');
      return new MeshView(this.context, file);
    });
  }

  /** The first page is here at once; what draws is fetched when it is wanted, or when there is time. */
  private open(route: Route): void {
    if (route.view === 'home') this.put(new HomeView(this.context));
    else void this.show(() => this.made(route));
  }

  private async made(route: Exclude<Route, { view: 'home' }>): Promise<View> {
    switch (route.view) {
      case 'mesh': {
        const { MeshView } = await import('./views/mesh');
        return new MeshView(this.context, route.mesh, route.up, route.name);
      }
      case 'job': {
        const { JobView } = await import('./views/job');
        return new JobView(this.context, route.shown, route.look);
      }
      case 'compare': {
        const { CompareView } = await import('./views/compare');
        return new CompareView(this.context, route.left, route.right, route.look);
      }
    }
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
    document.title = this.view.title === 'Spherify' ? 'Spherify' : `${this.view.title} · Spherify`;
    render(this.page(), this.root);
  });

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
        <a
          class="brand"
          href="/"
          @click=${(event: MouseEvent) => {
            if (event.ctrlKey || event.metaKey || event.shiftKey) return;
            event.preventDefault();
            this.go({ view: 'home' }, false);
          }}
          >${icon('sphere')}<span>Spherify</span></a
        >
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
          : nothing
      }
      <div class="body ${this.menu ? 'menu' : ''}">
        <nav class="rail" aria-label="Runs">${rail(this.context, this.route)}</nav>
        <main id="main" tabindex="-1">${this.view.render()}</main>
      </div>
      ${this.toasts.render()}`;
  }

  private readonly key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const target = event.target as HTMLElement;
    const typing = target.matches('input, select, textarea, summary');
    const pressing = event.key === ' ' && target.matches('button, a');
    if (typing || pressing) return;
    if (this.view.key?.(event)) event.preventDefault();
  };
}

/** Whether two addresses are of the same view, and differ in what it shows alone. */
function sameView(one: Route, other: Route): boolean {
  if (one.view === 'job' && other.view === 'job') return one.shown.job === other.shown.job;
  if (one.view === 'compare' && other.view === 'compare')
    return one.left.job === other.left.job && one.right.job === other.right.job;
  return false;
}
