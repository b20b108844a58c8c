#include "oted/report/html_page.h"

namespace oted {

std::string_view PageStyle() {
  return R"css(
:root {
  --page: #fbfbfa; --surface: #f1f2f1; --text: #1d2124; --soft: #5b6368; --rule: #e0e2e1; --grid: #e6e8e7;
  --designed: #2563c9; --band: rgba(37, 99, 201, .10); --nominal: #2e8b57; --truth: #1d2124; --low: #c2572b;
  --muted: #858e94; --edge: #858e94;
  --heat: #a5c3f3; --cold: #efb99d; --good: #21744a; --good-bg: #e3f2ea; --fair: #8a5a00; --fair-bg: #fbf0d9; --poor: #a8321f;
  --poor-bg: #fae5e1;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #15181a; --surface: #1f2427; --text: #e6e8e9; --soft: #9aa3a8; --rule: #2d3337; --grid: #272d30;
    --designed: #6ea3f5; --band: rgba(110, 163, 245, .14); --nominal: #5cc48a; --truth: #e6e8e9; --low: #e88a5e;
    --muted: #7d878d; --edge: #7d878d;
    --heat: #2c5490; --cold: #7c4127; --good: #7fd3a6; --good-bg: #173326; --fair: #e6bd6a; --fair-bg: #362b12; --poor: #f29a89;
    --poor-bg: #3d1e19;
  }
}
* { box-sizing: border-box; }
html { scroll-behavior: smooth; scroll-padding-top: 4rem; -webkit-text-size-adjust: 100%; }
@media (prefers-reduced-motion: reduce) { html { scroll-behavior: auto; } }
body { margin: 0; background: var(--page); color: var(--text);
  font: 16px/1.6 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main, nav div { max-width: 68rem; margin: 0 auto; padding: 0 1.5rem; }
nav { position: sticky; top: 0; z-index: 10; background: var(--page); border-bottom: 1px solid var(--rule); }
nav div { display: flex; gap: 1.4rem; overflow-x: auto; white-space: nowrap; scrollbar-width: none;
  font-size: .8125rem; }
nav a { color: var(--soft); text-decoration: none; padding: .8rem 0 .7rem; border-bottom: 2px solid transparent; }
nav a:hover { color: var(--text); }
nav a.here { color: var(--text); border-color: var(--designed); }
nav a.home { flex: none; max-width: 16rem; overflow: hidden; text-overflow: ellipsis; color: var(--text);
  font-weight: 600; }
a:focus-visible, summary:focus-visible, .table:focus-visible { outline: 2px solid var(--designed);
  outline-offset: 2px; }
header { padding: 4rem 0 1rem; }
.eyebrow { margin: 0 0 .6rem; color: var(--soft); font-size: .9375rem; }
h1 { margin: 0; max-width: 22em; font-size: clamp(1.7rem, 4.2vw, 2.5rem); line-height: 1.18; font-weight: 600;
  letter-spacing: -.018em; text-wrap: balance; }
header.good h1::before, header.poor h1::before, header.open h1::before { content: ""; display: block; width: 3rem;
  height: 4px; margin-bottom: 1.2rem; border-radius: 2px; background: var(--nominal); }
header.poor h1::before { background: var(--low); }
header.open h1::before { background: var(--muted); }
.asked { margin: 1.1rem 0 0; max-width: 44rem; font-size: 1.125rem; line-height: 1.5; color: var(--soft);
  overflow-wrap: anywhere; }
.answer { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 17rem), 1fr)); gap: 1.5rem 2.8rem;
  margin-top: 2.2rem; }
.answer h2 { margin: 0 0 .5rem; font-size: .8125rem; font-weight: 600; color: var(--soft); letter-spacing: 0; }
.answer p { margin: 0 0 .7rem; font-size: .9375rem; line-height: 1.55; overflow-wrap: anywhere; }
section { padding: 2.6rem 0 1rem; border-top: 1px solid var(--rule); margin-top: 2rem; }
section h2 { margin: 0 0 .5rem; font-size: 1.3125rem; line-height: 1.3; font-weight: 600; letter-spacing: -.01em; }
section p { max-width: 44rem; margin: 0 0 1.3rem; }
section > p { overflow-wrap: anywhere; }
.note, small { color: var(--soft); font-size: .8125rem; }
small { white-space: nowrap; }
.table { overflow-x: auto; margin: 0 0 1.4rem; }
table { border-collapse: collapse; font-size: .9375rem; font-variant-numeric: tabular-nums; min-width: 20rem; }
th, td { padding: .55rem 1.8rem .55rem 0; text-align: left; white-space: nowrap; border-bottom: 1px solid var(--rule); }
th { font-size: .8125rem; font-weight: 500; color: var(--soft); vertical-align: bottom; }
th:last-child, td:last-child { padding-right: .5rem; }
th.num, td.num { text-align: right; }
td b { font-weight: 600; }
tr.chosen td { font-weight: 600; }
#run td:last-child { white-space: normal; overflow-wrap: anywhere; min-width: 14rem; }
.stacked table, .stacked tbody, .stacked tr, .stacked td { display: block; }
.stacked thead { display: none; }
.stacked table { min-width: 0; max-width: 32rem; }
.stacked tr { padding: .7rem 0; border-bottom: 1px solid var(--rule); }
.stacked td { display: flex; justify-content: space-between; gap: 1rem; padding: .12rem 0; border: 0;
  text-align: right; white-space: normal; overflow-wrap: anywhere; }
.stacked td::before { content: attr(data-label); flex: none; max-width: 55%; text-align: left; font-size: .8125rem;
  font-weight: 400; color: var(--soft); }
.stacked td:first-child, #run .stacked td { display: block; text-align: left; }
.stacked td:first-child { padding-bottom: .3rem; font-weight: 600; }
.stacked td:first-child::before, #run .stacked td::before, .stacked td:empty { display: none; }
.stacked small { white-space: normal; }
.badge { display: inline-block; padding: .05rem .5rem; border-radius: 1rem; font-size: .75rem; font-weight: 500;
  line-height: 1.5; }
.badge.good { color: var(--good); background: var(--good-bg); }
.badge.fair { color: var(--fair); background: var(--fair-bg); }
.badge.poor { color: var(--poor); background: var(--poor-bg); }
.key { display: flex; flex-wrap: wrap; gap: .3rem 1.5rem; margin: 0 0 1rem; padding: 0; list-style: none;
  font-size: .8125rem; color: var(--soft); }
.key li { display: flex; align-items: center; }
.key i { width: 1.5rem; margin-right: .5rem; border-top: 2px solid var(--c); }
.key i.dash { border-top-style: dashed; }
.key i.dots { border-top-style: dotted; }
.key i.band { height: .75rem; border: 0; background: var(--c); border-radius: 2px; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 19rem), 1fr)); gap: 1.2rem 1.8rem; }
figure { margin: 0 0 1.6rem; min-width: 0; }
figcaption { font-size: .875rem; margin-bottom: .2rem; overflow-wrap: anywhere; }
figcaption b { font-weight: 600; }
.plot { height: 16rem; }
.wide .plot { height: 19rem; }
.short .plot { height: 12rem; }
.matrix { max-width: 30rem; }
.matrix .plot { height: 17rem; }
.small .plot { height: 13rem; }
.motion { margin: 0 0 2rem; }
.panels { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: .8rem; }
.panel p { margin: 0 0 .3rem; padding-left: .6rem; border-left: 3px solid var(--truth); font-size: .875rem;
  line-height: 1.3; }
.panel.nominal p { border-color: var(--nominal); }
.panel.designed p { border-color: var(--designed); }
.panel canvas { display: block; width: 100%; height: auto; border-radius: 4px; background: var(--surface); }
.controls { display: flex; flex-wrap: wrap; align-items: center; gap: .6rem 1rem; margin-top: .8rem;
  font-size: .8125rem; color: var(--soft); font-variant-numeric: tabular-nums; }
.controls button { min-width: 4.6rem; padding: .35rem .8rem; border: 1px solid var(--edge); border-radius: 5px;
  background: var(--surface); color: var(--text); font: inherit; cursor: pointer; }
.controls input { flex: 1 1 10rem; min-width: 0; accent-color: var(--designed); }
dl { display: flex; flex-wrap: wrap; gap: .8rem 2.8rem; margin: 0 0 1.5rem; }
dt { font-size: .8125rem; color: var(--soft); }
dd { margin: 0; font-size: 1.125rem; font-variant-numeric: tabular-nums; }
.warnings { margin: 0 0 1rem; padding: 0; list-style: none; max-width: 44rem; }
.warnings li { padding: .6rem .9rem; margin-bottom: .6rem; border-left: 3px solid var(--fair);
  background: var(--fair-bg); overflow-wrap: anywhere; }
summary { cursor: pointer; font-size: .9375rem; }
code, pre { font: .8125rem/1.6 ui-monospace, SFMono-Regular, Menlo, Consolas, monospace; }
pre { overflow-x: auto; padding: 1rem 1.2rem; background: var(--surface); border-radius: 6px; }
footer { margin: 3rem 0; padding-top: 1.2rem; border-top: 1px solid var(--rule); color: var(--soft);
  font-size: .8125rem; }
@media (max-width: 40rem) {
  main, nav div { padding: 0 1.1rem; }
  header { padding-top: 2.4rem; }
  section { padding-top: 2rem; margin-top: 1.2rem; }
  th, td { padding-right: 1.2rem; }
  td:first-child { white-space: normal; }
  .panels { gap: .4rem; }
}
@media print {
  nav { display: none; }
  figure, tr { break-inside: avoid; }
}
)css";
}

}  // namespace oted
