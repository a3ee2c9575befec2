// How pages are ranked by the search: a page by its title and what it explains before lists, the changelog last.
var Scorer = {
  score: ([docName, title, anchor, descr, score, filename, kind]) => {
    if (docName.includes("changelog")) return score - 40;
    if (docName.startsWith("reference/built/") && kind !== "object") return score - 15;
    if (docName.startsWith("guide/") || docName.startsWith("theory/") || docName.startsWith("controllers/")) return score + 5;
    return score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 25,
  partialTitle: 10,
  term: 5,
  partialTerm: 2,
};
