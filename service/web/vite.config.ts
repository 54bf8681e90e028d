import process from 'node:process';
import { defineConfig } from 'vitest/config';

// For `npm run dev`: the service that is asked.
const service = process.env['SPHERIFY_URL'] ?? 'http://localhost:8000';

// The page and the page for frames. Everything is loaded from the service itself, as its content policy demands.
export default defineConfig({
  base: '/',
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 900,
    rollupOptions: { input: { index: 'index.html', embed: 'embed.html' } },
  },
  worker: { format: 'es' },
  server: { proxy: { '/v1': service, '/problems': service, '/healthz': service, '/docs': service } },
  test: { include: ['src/**/*.test.ts'], environment: 'node' },
});
