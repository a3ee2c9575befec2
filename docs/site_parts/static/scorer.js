// How pages are ranked by the search: what explains before what lists, a section on the words before its page, the changelog last.
var Scorer = {
  score: ([docName, title, anchor, descr, score, filename, kind]) => {
    if (docName.includes("changelog")) return score - 40;
    if (docName.startsWith("reference/built/") && kind !== "object") return score - 15;
    // A page that is named as its title is has that for its subject.
    const subject = docName.split("/").pop().replaceAll("_", " ");
    if (title.toLowerCase().includes(subject)) score += 2;
    if (kind === "title") score += 3;
    if (docName.startsWith("guide/terms/")) return score + 4;
    if (/^(start|guide|controllers)\//.test(docName)) return score + 5;
    if (docName.startsWith("theory/")) return score + 3;
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
