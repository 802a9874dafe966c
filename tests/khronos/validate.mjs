// Runs the Khronos glTF validator. Exits with 1 on any error or warning, 2 on wrong usage or an unreadable file.
//
//   node validate.mjs FILE...                 every FILE must be free of errors and warnings
//   node validate.mjs --input INPUT FILE ...  FILE may have what INPUT has, not more of any kind
//
// `--input` holds for the one FILE after it. Infos and hints are not counted.

import { readFile } from 'node:fs/promises';
import { dirname, resolve } from 'node:path';
import validator from 'gltf-validator';

const SEVERITIES = ['error', 'warning'];

/** Errors and warnings of a file. */
async function issuesOf(file) {
  const folder = dirname(resolve(file));
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)), {
    uri: file,
    maxIssues: 0,
    writeTimestamp: false,
    externalResourceFunction: async (uri) => new Uint8Array(await readFile(resolve(folder, decodeURIComponent(uri)))),
  });
  return report.issues.messages.filter((issue) => issue.severity < SEVERITIES.length);
}

/** How often each kind of issue occurs. */
function countByCode(issues) {
  const counts = new Map();
  for (const { code } of issues) counts.set(code, (counts.get(code) ?? 0) + 1);
  return counts;
}

/** Pairs of a file and the input that excuses it. */
function parseArguments(words) {
  const tasks = [];
  for (let i = 0; i < words.length; i += 1) {
    const hasInput = words[i] === '--input';
    const [input, file] = hasInput ? [words[i + 1], words[i + 2]] : [undefined, words[i]];
    if (file === undefined || file.startsWith('--')) return [];
    tasks.push({ input, file });
    i += hasInput ? 2 : 0;
  }
  return tasks;
}

const tasks = parseArguments(process.argv.slice(2));
if (tasks.length === 0) {
  console.error('usage: node validate.mjs [--input INPUT] FILE ...');
  process.exit(2);
}
let failed = 0;
for (const { input, file } of tasks) {
  try {
    const excused = countByCode(input === undefined ? [] : await issuesOf(input));
    const issues = await issuesOf(file);
    const counts = countByCode(issues);
    const tooMany = issues.filter(({ code }) => counts.get(code) > (excused.get(code) ?? 0));
    for (const { severity, code, pointer, message } of tooMany) {
      console.error(`${file}: ${SEVERITIES[severity]}: ${code} at ${pointer ?? '/'}: ${message}`);
    }
    failed += tooMany.length > 0 ? 1 : 0;
  } catch (error) {
    console.error(`${file}: ${error}`);
    process.exit(2);
  }
}
console.log(`${tasks.length - failed} of ${tasks.length} files pass the Khronos validator ${validator.version()}`);
process.exit(failed > 0 ? 1 : 0);
