import { defineConfig } from 'vite';

// <spherify-viewer> for other people's pages: one small file under a name that stays.
export default defineConfig({
  publicDir: false,
  build: {
    target: 'es2022',
    emptyOutDir: false,
    lib: { entry: 'src/element.ts', formats: ['es'], fileName: () => 'spherify-viewer.js' },
  },
});
