//! The page of a farm: campaigns, workers, newest results, and the covered part of the parameter space.

use super::status::{Farm, FarmCampaign, FarmWorker};
use maud::{Markup, PreEscaped, html};
use tracktwin_drawing::{Axis, Chart, Shown, figure, page_with, significant};
use tracktwin_parameters::{Parameter, ParameterSet};

const SPECTRUM: [f64; 2] = [520.0, 300.0];
const SCATTER: [f64; 2] = [290.0, 300.0];
const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// Pairs of parameters; the page has one chart for each pair.
const PLANES: [[Parameter; 2]; 2] = [
    [Parameter::RailpadStiffness, Parameter::BallastStiffness],
    [Parameter::RailpadDamping, Parameter::BallastDamping],
];

/// CSS of this page.
const STYLE: &str = "
.progress{display:flex;height:1rem;background:var(--faint);max-width:60rem;margin:.4rem 0}.progress i{display:block}
.progress .finished{background:var(--c)}.progress .leased{background:var(--f)}.progress .failed{background:var(--b)}
body.stale header,body.stale main{opacity:.4}#stale{position:sticky;bottom:0;margin:0;padding:.6rem 0;background:var(--paper)}
form{display:inline}button,input{font:inherit;font-size:.88rem;padding:.15rem .6rem}.state{font-weight:600}.bad{color:var(--b);font-weight:600}
";

/// Updates summary and main part of the page every two seconds, and dims them if that fails. Charts are kept until the
/// version of their campaign changes. Without the script the page is static.
const SCRIPT: &str = "
const load=async path=>{const answer=await fetch(path,{signal:AbortSignal.timeout(20000)});if(!answer.ok)throw answer;return answer.text()},
shown=next=>[...document.querySelectorAll('.charts')].find(it=>it.dataset.version===next.dataset.version),
update=async()=>{const page=new DOMParser().parseFromString(await load('view'),'text/html'),charts=[...page.querySelectorAll('.charts')];
for(const next of charts.filter(it=>!shown(it)))next.innerHTML=await load('charts/'+encodeURIComponent(next.dataset.campaign));
for(const next of charts){const kept=shown(next);if(kept)next.replaceWith(kept)}
for(const part of ['.summary','main'])document.querySelector(part).replaceWith(page.querySelector(part))},
mark=stale=>{document.body.classList.toggle('stale',stale);document.querySelector('#stale').hidden=!stale},
turn=()=>update().then(()=>mark(false),()=>mark(true)).then(()=>setTimeout(turn,2000));
setTimeout(turn,2000)
";

/// The whole page; without charts if those of the campaigns were not read.
pub(super) fn farm_page(farm: &Farm) -> String {
    let head = html! { style { (PreEscaped(STYLE)) } };
    // Outside of what changes, or typing would be lost.
    let end = html! {
        @if !farm.may_control { (login()) }
        p #stale.bad role="status" hidden {
            "This page is not up to date: the coordinator or its library does not respond."
        }
        script { (PreEscaped(SCRIPT)) }
    };
    page_with("The farm", &summary(farm), &head, &farm_view(farm), &end)
}

/// The main part of the page.
fn farm_view(farm: &Farm) -> Markup {
    html! {
        p.note { "library " code { (farm.library) } ", " (farm.at) }
        @if farm.campaigns.is_empty() {
            p { "No campaign yet: " code { "tracktwin campaign add FILE --library URL" } " adds one." }
        }
        @for campaign in &farm.campaigns { (campaign_part(campaign, farm.may_control)) }
        h2 { "Workers" }
        (workers(&farm.workers))
    }
}

/// Summary in one sentence.
fn summary(farm: &Farm) -> String {
    let at_work: Vec<_> = farm.campaigns.iter().filter(|it| it.is_at_work()).collect();
    let rate: f64 = at_work.iter().map(|campaign| campaign.per_second).sum();
    let present = farm.workers.iter().filter(|worker| worker.is_present()).count();
    format!(
        "Campaigns with work to do: {} of {}; workers: {present}; {} cases per second.",
        at_work.len(),
        farm.campaigns.len(),
        significant(rate)
    )
}

/// With fewer finished cases than this, each is drawn with a larger symbol.
const FEW: usize = 300;

/// Caption of the charts of a campaign.
const CAPTION: &str = "Local wavelet power spectra of the newest cases, by case index, at the highest \
     speed; finished cases in the parameter space; given-up cases in orange.";

fn campaign_part(campaign: &FarmCampaign, may_control: bool) -> Markup {
    let FarmCampaign { id, waiting, leased, finished, failed, .. } = campaign;
    // What is drawn changes with these numbers only.
    let version = format!("{id} {finished} {failed}");
    html! {
        section {
            h2 { (id) " " span.state { (campaign.state_text()) } }
            (progress(campaign))
            p {
                (finished) " of " (campaign.cases()) " cases finished, " (leased) " in work, "
                (waiting) " waiting, "
                span.bad[*failed > 0] { (failed) " given up" } "; "
                @if campaign.is_at_work() { (significant(campaign.per_second)) " a second, " }
                (campaign.left())
                @if campaign.priority != 0 { ", priority " (campaign.priority) }
            }
            @if may_control { (buttons(campaign)) }
            @if !campaign.causes.is_empty() { (causes(&campaign.causes)) }
            div.charts data-campaign=(id) data-version=(version) { (charts(campaign)) }
        }
    }
}

/// The charts of a campaign; empty without cases to draw.
pub(super) fn charts(campaign: &FarmCampaign) -> Markup {
    let pictures = pictures(campaign);
    html! { @if !pictures.is_empty() { (figure(&pictures, CAPTION)) } }
}

fn progress(campaign: &FarmCampaign) -> Markup {
    let share = |count: u32| 100.0 * f64::from(count) / f64::from(campaign.cases().max(1));
    html! {
        div.progress role="progressbar" aria-valuenow=(campaign.finished) aria-valuemax=(campaign.cases()) {
            @for (class, count) in [("finished", campaign.finished), ("failed", campaign.failed), ("leased", campaign.leased)] {
                i class=(class) style=(format!("width:{:.3}%", share(count))) {}
            }
        }
    }
}

fn buttons(campaign: &FarmCampaign) -> Markup {
    let button = |action: &str| {
        html! {
            form method="post" action=(format!("campaign/{action}")) {
                input type="hidden" name="campaign" value=(campaign.id);
                button { (action) }
            }
            " "
        }
    };
    html! {
        p {
            @match (campaign.is_done(), campaign.state.as_str()) {
                (true, _) => {}
                (_, "running") => { (button("pause")) }
                _ => { (button("resume")) }
            }
            @if campaign.failed > 0 { (button("retry")) }
        }
    }
}

fn causes(causes: &[(String, u32)]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th.words { "reason of giving up" } th { "cases" } } }
            tbody { @for (cause, count) in causes { tr { td.words { (cause) } td { (count) } } } }
        } }
    }
}

fn workers(workers: &[FarmWorker]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr {
                th { "worker" } th { "version" } th { "cores" } th { "finished" } th { "failed" }
                th { "computing time" small { "s a case" } } th { "heard of" small { "s ago" } }
                th.words { "" }
            } }
            tbody {
                @for worker in workers { tr {
                    td { (worker.id) } td { (worker.code_version) } td { (worker.cores) }
                    td { (worker.finished) } td { (worker.failed) }
                    td { (worker.case_s.map(significant).unwrap_or_default()) }
                    td { (format!("{:.0}", worker.silent_s)) }
                    td.words.bad { (worker.aside.as_deref().unwrap_or_default()) }
                } }
            }
        } }
    }
}

fn login() -> Markup {
    html! {
        form method="post" action="login" {
            label { "Token, to pause, resume and retry: " input type="password" name="token"; }
            " " button { "unlock" }
        }
    }
}

fn pictures(campaign: &FarmCampaign) -> Vec<String> {
    let mut pictures = Vec::new();
    if !campaign.newest.is_empty() {
        pictures.push(spectra(campaign));
    }
    if !campaign.covered.is_empty() || !campaign.given_up.is_empty() {
        pictures.extend(PLANES.map(|plane| scatter(campaign, plane)));
    }
    pictures
}

fn spectra(campaign: &FarmCampaign) -> String {
    // ln of a power to dB.
    let decibel = 10.0 / std::f64::consts::LN_10;
    let frequencies = &campaign.frequencies_hz;
    let (Some(&low), Some(&high)) = (frequencies.first(), frequencies.last()) else {
        return String::new();
    };
    let levels = campaign.newest.iter().flat_map(|(_, values)| values);
    let y = Axis::around("LWPS in dB re 1 (m/s²)²", levels.map(|value| decibel * value));
    let x = Axis::logarithmic("frequency in Hz", low, high);
    let mut chart = Chart::new("Newest cases", SPECTRUM, x, y);
    for ((name, values), class) in campaign.newest.iter().zip(CLASSES) {
        let points = frequencies.iter().zip(values);
        chart.line(&format!("{class} thin"), points.map(|(&f, value)| (f, decibel * value)));
        chart.explain(class, name);
    }
    chart.into_svg()
}

fn scatter(campaign: &FarmCampaign, [x, y]: [Parameter; 2]) -> String {
    let axis = |parameter: Parameter| {
        let shown = Shown::of(parameter);
        let label = format!("{} in {}", parameter.label(), shown.unit);
        let cases = campaign.covered.iter().chain(&campaign.given_up);
        Axis::around(&label, cases.map(|set| set[parameter] / shown.divisor))
    };
    let [x_divisor, y_divisor] = [x, y].map(|parameter| Shown::of(parameter).divisor);
    let points = |sets: &[ParameterSet]| -> Vec<(f64, f64)> {
        sets.iter().map(|set| (set[x] / x_divisor, set[y] / y_divisor)).collect()
    };
    let mut chart = Chart::new("Parameter space", SCATTER, axis(x), axis(y));
    let few = campaign.covered.len() < FEW;
    let (class, radius) = if few { ("c", 2.2) } else { ("c pale", 1.6) };
    chart.dots(class, radius, &points(&campaign.covered));
    chart.dots("b", 3.0, &points(&campaign.given_up));
    chart.into_svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn farm() -> Farm {
        let campaign = FarmCampaign {
            id: "a<b>-1234".to_owned(),
            state: "running".to_owned(),
            waiting: 60,
            leased: 10,
            finished: 29,
            failed: 1,
            per_second: 2.0,
            causes: vec![("the sleeper floats".to_owned(), 1)],
            frequencies_hz: vec![50.0, 500.0, 4000.0],
            newest: vec![("case 7".to_owned(), vec![-1.0, 0.0, 1.0])],
            covered: vec![ParameterSet::nominal()],
            ..FarmCampaign::default()
        };
        let worker = FarmWorker {
            id: "node-1".to_owned(),
            aside: Some("in quarantine".to_owned()),
            ..FarmWorker::default()
        };
        let (campaigns, workers) = (vec![campaign], vec![worker]);
        Farm { campaigns, workers, may_control: true, ..Farm::default() }
    }

    #[test]
    fn the_page_tells_progress_causes_and_workers_and_escapes_names() {
        let page = farm_page(&farm());
        for part in [
            "29 of 100 cases finished",
            "35 s left",
            "the sleeper floats",
            "in quarantine",
            "case 7",
            "Parameter space",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(page.contains("a&lt;b&gt;-1234") && !page.contains("a<b>"));
    }

    #[test]
    fn the_parameter_space_shows_the_cases_of_any_track() {
        let mut line = farm().campaigns.remove(0);
        let mut stiffer = ParameterSet::nominal();
        stiffer[Parameter::RailpadStiffness] *= 5.0;
        stiffer[Parameter::BallastStiffness] *= 9.0;
        line.given_up = vec![stiffer];
        let picture = scatter(&line, [Parameter::RailpadStiffness, Parameter::BallastStiffness]);
        let places = |name: &str, most: f64| {
            let before = format!(" {name}=\"");
            let values = picture.split(&before).skip(1);
            let values = values.map(|it| it.split('"').next().unwrap().parse::<f64>().unwrap());
            values.filter(|value| (0.0..most).contains(value)).count()
        };
        assert_eq!([places("cx", SCATTER[0]), places("cy", SCATTER[1])], [2, 2], "{picture}");
    }

    #[test]
    fn buttons_stand_only_where_they_may_be_pressed() {
        assert!(farm_page(&farm()).contains("campaign/pause"));
        let locked = Farm { may_control: false, ..farm() };
        let page = farm_page(&locked);
        assert!(!page.contains("campaign/pause") && page.contains("action=\"login\""));
    }

    #[test]
    fn a_campaign_without_cases_left_is_done() {
        let mut done = farm();
        let campaign = &mut done.campaigns[0];
        (campaign.waiting, campaign.leased, campaign.finished) = (0, 0, 99);
        let page = farm_page(&done);
        assert!(page.contains(">done<") && !page.contains("campaign/pause"));
        // What was given up can be tried again.
        assert!(page.contains("campaign/retry"));
    }
}
