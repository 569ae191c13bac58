// How the search of these pages orders its results: Sphinx's own points, but pages for users come before records of decisions.
var Scorer = {
  score: ([docname, title, anchor, description, score]) => (docname.startsWith("decisions/") ? score - 20 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
