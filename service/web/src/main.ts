import { App } from './app';
import './styles/tokens.css';
import './styles/base.css';
import './styles/layout.css';
import './styles/parts.css';
import './styles/lists.css';
import './styles/rail.css';
import './styles/stage.css';
import './styles/print.css';
import { applyTheme } from './ui/theme';

applyTheme();
const root = document.getElementById('app');
if (!root) throw new Error('index.html has no #app');
root.replaceChildren();
new App(root).start();
