use std::time::Instant;
use tracktwin_diagnosis::{NullModel, Problem, Subject, first_calibration, search};
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::Recording;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let recording = Recording::open(&path).unwrap();
    let t = Instant::now();
    let subject = Subject::new(&recording, &TrackDesign::v_track()).unwrap();
    let start = first_calibration(&subject).unwrap();
    eprintln!(
        "first {:?} sleepers {} from {}",
        t.elapsed(),
        subject.forward.section.sleepers,
        recording.sleepers[subject.first_sleeper].id
    );
    let file = format!(
        "/tmp/diag/{}.null2.json",
        std::env::args().nth(2).unwrap_or(recording.name.clone())
    );
    let null: NullModel = match std::fs::read(&file) {
        Ok(b) => serde_json::from_slice(&b).unwrap(),
        Err(_) => {
            let n = NullModel::simulate(&subject.forward, &start, 32, 1000, |_| ()).unwrap();
            std::fs::write(&file, serde_json::to_vec(&n).unwrap()).unwrap();
            n
        }
    };
    eprintln!("null {:?}", t.elapsed());
    let s = search(&subject, &null, start, &[], &|_, _| ()).unwrap();
    let n = s.baseline.residual.len() as f64;
    println!(
        "{} baseline obj {:.0} chi2 {:.2} -> {:.0} chi2 {:.2}; held out per datum {:.3} -> {:.3}",
        recording.name,
        s.baseline.objective,
        s.baseline.residual.norm_squared() / n,
        s.last.objective,
        s.last.residual.norm_squared() / n,
        s.held_out[0],
        s.held_out[1]
    );
    let nb = subject.forward.unknowns.count();
    for r in &s.rounds {
        println!(
            " p={:.2e} accepted {} gains {:?}",
            r.p_value,
            r.accepted,
            r.held_out_gain.iter().map(|g| g.round()).collect::<Vec<_>>()
        );
        for f in &r.fitted {
            let p: Vec<_> = f
                .calibration
                .values
                .rows(f.calibration.values.len() - f.candidate.free.len(), f.candidate.free.len())
                .iter()
                .map(|v| v.exp())
                .collect();
            println!(
                "   {:8.1} d'={:5.1} {} {:?} {:?} {:?}",
                f.log_evidence,
                f.detectability,
                f.candidate.kind.physics,
                f.candidate.extension.sleepers.as_ref().map(|s| s
                    .iter()
                    .map(|i| recording.sleepers[i + subject.first_sleeper].id.clone())
                    .collect::<Vec<_>>()
                    .join(",")),
                f.candidate.extension.x_m.map(|x| x[0]),
                p
            );
        }
    }
    let u = &subject.forward.unknowns;
    for (name, c) in [("before", &s.baseline), ("after", &s.last)] {
        let g = u.global();
        println!(
            "  {name}: EI {:.0} cp {:.0} cb {:.0} kb {:.3e} kp {:.3e}",
            c.values[g.start].exp(),
            c.values[g.start + 1].exp(),
            c.values[g.start + 2].exp(),
            c.values.rows(0, u.ballast().len()).mean().exp(),
            c.values.rows(u.railpad().start, u.ballast().len()).mean().exp()
        );
    }
    let _ = nb;
    if let Some(w) = std::env::args().nth(3) {
        let j: usize = w.parse().unwrap();
        let cs = &s.accepted;
        let obs = &s.observation;
        for (c, cal) in [(&[][..], &s.baseline), (&cs[..], &s.last)] {
            let p = Problem { forward: &subject.forward, observation: obs, candidates: c };
            let d = obs.difference(
                &subject
                    .forward
                    .log_power(&cal.values, &p.extensions(&cal.values).unwrap())
                    .unwrap(),
            );
            let b = subject.forward.bands.count();
            for jj in j..j + 2 {
                for v in 0..subject.forward.speeds_m_s.len() {
                    println!(
                        "SN{} v{} {:?}",
                        jj + 7,
                        v,
                        (0..b)
                            .map(|k| (4.343
                                * d[jj * subject.forward.per_sleeper() + v * b + k]
                                * 10.0)
                                .round()
                                / 10.0)
                            .collect::<Vec<_>>()
                    );
                }
            }
        }
    }
    eprintln!("total {:?}", t.elapsed());
}
