// SPDX-License-Identifier: Apache-2.0
// Bundles the page into ../page.js.gz, or the file that is given: npm ci && node build.js [FILE]
import { build } from 'esbuild';
import { writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const folder = dirname(fileURLToPath(import.meta.url));
const made = await build({
  absWorkingDir: folder,
  entryPoints: ['main.js'],
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  legalComments: 'eof',
  charset: 'utf8',
  loader: { '.css': 'text' },
  write: false,
});
const packed = gzipSync(made.outputFiles[0].contents, { level: 9 });
writeFileSync(process.argv[2] ?? join(folder, '..', 'page.js.gz'), packed);
console.log(`${made.outputFiles[0].contents.length} bytes, packed ${packed.length}`);
