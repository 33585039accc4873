//! Style of this page.

/// Headline, tags, map and bars. The colours are the variables of the page, so that dark mode and printing
/// work.
pub(super) const STYLE: &str = "
header h1{font-size:1rem;font-weight:600;color:var(--dim);letter-spacing:.02em}
header .summary{font-size:1.55rem;line-height:1.32;font-weight:600;margin:.2rem 0 .7rem;max-width:none;text-wrap:pretty}
.tag{display:inline-block;padding:.1rem .7rem;border-radius:1rem;font-size:.9rem;font-weight:600;border:1.5px solid currentColor}
.tag.consistent{color:var(--c)}.tag.left-out{color:var(--b)}.tag.unknown{color:var(--d)}.tag.chain{color:var(--a)}
.verdict{margin:0 0 .8rem}.verdict span+span{margin-left:.7rem;color:var(--dim);font-size:.95rem}
.facts{display:flex;flex-wrap:wrap;gap:.6rem 2.4rem;margin:0 0 .6rem}.facts div{max-width:17rem}
.facts dd{font-size:1.3rem;font-weight:600;order:-1}.facts dt{font-size:.82rem;line-height:1.3}.facts div{display:flex;flex-direction:column}dl.facts{grid-template-columns:none}
ul.notes{margin:.4rem 0;padding-left:1.1rem;color:var(--dim);font-size:.95rem;max-width:60rem}
main p{max-width:60rem}
.cell.more{fill:var(--b)}.cell.less{fill:var(--a)}
.s1{opacity:.13}.s2{opacity:.28}.s3{opacity:.44}.s4{opacity:.62}.s5{opacity:.81}.s6{opacity:1}
.line.box{stroke:var(--ink);stroke-width:1.6;stroke-linejoin:miter}.line.box.then{stroke-width:1;stroke-dasharray:3 2}.line.rule{stroke:var(--faint);stroke-width:1}.dot.ink{fill:var(--ink)}
.scale{display:flex;align-items:center;gap:.6rem;font-size:.85rem;color:var(--dim);margin:.5rem 0 .2rem;flex-wrap:wrap}
.scale .steps{display:flex;border:1px solid var(--dim)}.scale i{display:block;width:1.5rem;height:.9rem}.scale i.more{background:var(--b)}.scale i.less{background:var(--a)}
.keys{display:flex;flex-wrap:wrap;gap:.2rem 1.4rem;font-size:.85rem;color:var(--dim);margin:.4rem 0 .2rem}.keys svg{vertical-align:middle;margin-right:.35rem}
.hypothesis{display:grid;grid-template-columns:13rem 1fr;gap:.1rem 1rem;padding:.55rem 0;border-bottom:1px solid var(--faint);max-width:66rem}
.hypothesis .name{font-weight:600}.hypothesis .name small{display:block;font-weight:400;color:var(--dim);font-size:.82rem}
.share{display:flex;align-items:center;gap:.6rem}.share .track{flex:0 1 24rem;height:.9rem;background:var(--faint)}.share .track i{display:block;height:100%;background:var(--dim)}
.hypothesis.accepted .track i{background:var(--b)}.hypothesis.accepted.chain .track i{background:var(--a)}.hypothesis.accepted.unknown .track i{background:var(--d)}
.share b{font-variant-numeric:tabular-nums;min-width:3.6rem}.accepted-mark{font-size:.82rem;font-weight:600}
.hypothesis p{margin:.2rem 0 0;font-size:.88rem;color:var(--dim)}
td.words{white-space:normal;max-width:30rem}td small{color:var(--dim)}tr.better td{font-weight:600}
ol.places{font-size:.92rem;padding-left:1.3rem;max-width:60rem}ol.places li{margin:.15rem 0}
@media (max-width:40rem){.hypothesis{grid-template-columns:1fr}header .summary{font-size:1.25rem}}
@media print{.tag,.cell,.scale i,.share i,.share .track{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
";
