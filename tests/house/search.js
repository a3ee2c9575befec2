// SPDX-License-Identifier: Apache-2.0
// node search.js SITE QUERY...: what the site's own search lists for each query, first the best, as JSON: [page, title, anchor].
const fs = require("fs");
const path = require("path");
const vm = require("vm");

const [site, ...queries] = process.argv.slice(2);
const read = (name) => fs.readFileSync(path.join(site, name), "utf8");
// The scripts of the search page, in its order: a script may replace what one before it defines.
const scripts = [...read("search.html").matchAll(/<script src="([^"?]*(?:searchtools|language_data|searchindex)\.js)/g)];
const context = vm.createContext({
  document: { getElementById: () => ({}) },
  SPHINX_HIGHLIGHT_ENABLED: false,
  _: (text) => text,
  _ready: () => {},
});
context.window = context;
vm.runInContext(`${scripts.map((found) => read(found[1])).join("\n;\n")}\n;window.Search = Search;`, context);

const search = (query) => context.Search._performSearch(...context.Search._parseQuery(query)).reverse();
const listed = queries.map((query) => search(query).map(([page, title, anchor]) => [page, title, anchor]));
console.log(JSON.stringify(listed));
