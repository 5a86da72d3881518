// Serves this folder to browsers: `node tests/serve.js [PORT]`, then http://localhost:PORT/page/

import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const TYPES = {
  ".html": "text/html",
  ".css": "text/css",
  ".js": "text/javascript",
  ".wasm": "application/wasm",
};

/**
 * Starts a server of the page and the package. Port 0 is any free one; the address of the page is returned. `files` are
 * contents by path that it has besides.
 */
export async function serve(port = 0, files = new Map()) {
  const folder = fileURLToPath(new URL("..", import.meta.url));
  const server = createServer(async ({ url }, response) => {
    const path = normalize(new URL(url, "http://localhost").pathname.replace(/\/$/, "/index.html"));
    try {
      if (!files.has(path) && !/^\/(page|package|three|tests\/peers)\//.test(path))
        throw new Error("not a part of the page");
      const content = files.get(path) ?? (await readFile(folder + path));
      response.writeHead(200, { "content-type": TYPES[extname(path)] ?? "text/plain" }).end(content);
    } catch {
      response.writeHead(404).end(`there is no ${path}`);
    }
  });
  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  return { address: `http://localhost:${server.address().port}/page/`, close: () => server.close() };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  console.log((await serve(Number(process.argv[2] ?? 8000))).address);
}
